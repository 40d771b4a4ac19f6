"""Inferred over true forces of one frame."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..results.results import Results, TruthContacts
from ..solver.contacts.pairs import align
from ..solver.statistics.agreement import compare_forces
from .figure_style import BLUE, INK, VERMILION, Width, add_title, new_figure


def draw_truth(results: Results, truth: TruthContacts, frame: int, width: Width) -> Figure:
    """Draw f_n and f_t over the true forces, 0 for absent contacts; error bars are one standard deviation."""
    figure = new_figure(width, 0.55 if width == "double" else 1.95)
    panels = figure.subplots(1, 2) if width == "double" else figure.subplots(2, 1)
    forces = results.frames[frame]
    bodies = results.grains.count + results.walls.count
    key, true = truth.by_frame(bodies, len(results.frames))[frame]
    reported = np.column_stack([forces.fn, forces.ft, forces.fn_sd, forces.ft_sd])
    _, inferred, exact = align(forces.contacts.key, reported, key, true)
    agreement = compare_forces(forces.contacts.key, reported[:, :2], key, true)
    for axes, row, name, r, colour in (
        (panels[0], 0, "f$_n$", agreement.r_fn, BLUE),
        (panels[1], 1, "f$_t$", agreement.r_ft, VERMILION),
    ):
        x, y, bar = exact[:, row], inferred[:, row], np.nan_to_num(inferred[:, row + 2])
        axes.errorbar(x, y, bar, fmt="o", color=colour, markersize=1.6, markeredgewidth=0.0, elinewidth=0.35, alpha=0.6)
        ends = np.array([min(x.min(), y.min()), max(x.max(), y.max())])
        axes.plot(ends, ends, color=INK, linewidth=0.6)
        axes.set(xlabel=f"true {name} [N]", ylabel=f"inferred {name} [N]", aspect="equal")
        add_title(axes, f"frame {frame}: r({name}) = {r:.3f}")
    return figure
