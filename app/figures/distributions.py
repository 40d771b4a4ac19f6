"""Distributions of forces: P(f) on a logarithmic axis."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..results.results import Results
from ..solver.bodies.grains import Array
from ..solver.statistics.force_statistics import FORCE_EDGES
from .figure_style import BLUE, INK, VERMILION, Width, add_title, new_figure


def draw_density(results: Results, frame: int, width: Width) -> Figure:
    """Draw P(f_n) and P(|f_t|) of one frame and of all, over the mean force, with the exponent of the tail."""
    figure = new_figure(width, 0.72)
    axes = figure.add_subplot()
    middle = 0.5 * (FORCE_EDGES[1:] + FORCE_EDGES[:-1])
    here = results.statistics[frame]
    for field, name, colour, mark in (("fn_density", "f$_n$", BLUE, "o"), ("ft_density", "|f$_t$|", VERMILION, "s")):
        known = [density for each in results.statistics if np.isfinite(density := getattr(each, field)).all()]
        if known:
            pooled = np.mean(known, axis=0)
            axes.plot(middle, _positive(pooled), color=colour, label=f"{name}, all frames")
        axes.plot(
            middle, _positive(getattr(here, field)), mark, color=colour, mfc="white", label=f"{name}, frame {frame}"
        )
    beta = here.tail_exponent
    if np.isfinite(beta):
        x = np.array([1.0, 4.5])
        start = np.interp(1.0, middle, here.fn_density)
        label = rf"$\beta$ = {beta:.2f} ± {here.tail_exponent_sd:.2f}"
        axes.plot(x, start * np.exp(-beta * (x - 1.0)), ":", color=INK, label=label)
    axes.set(
        yscale="log", xlim=(0.0, 6.0), ylim=(2e-3, 3.0), xlabel="force over its mean", ylabel="probability density"
    )
    axes.legend()
    add_title(axes, f"{results.name}: distribution of contact forces")
    return figure


def _positive(density: Array) -> Array:
    return np.where(density > 0, density, np.nan)
