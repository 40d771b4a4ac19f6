"""Fringes of photoelastic discs beside the forces: measured G² against the pressure, and the residual of every disc."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..results.results import Results
from .figure_style import BLUE, INK, OUTLINE, NothingToDrawError, Width, add_title, new_figure
from .force_network import bounds_of
from .kinematics import SIGNED, draw_map


def draw_fringes(results: Results, frame: int, width: Width) -> Figure:
    """Draw the pressures of the discs over their G² with the curve of the run, and what the fringes show beyond them.

    Raises
    ------
    NothingToDrawError
        The run has no photoelastic photographs.
    """
    found, fringes = results.fringes, results.tracks.fringes
    if found is None or fringes is None:
        raise NothingToDrawError("this run has no fringes: give photographs.fringes")
    low, high = bounds_of(results)
    tall = float((high - low)[1] / (high - low)[0])
    figure = new_figure(width, 0.5 * tall + 0.15 if width == "double" else tall + 1.0)
    curve, residual = figure.subplots(*((1, 2) if width == "double" else (2, 1)))
    unit = found.mean
    others = np.arange(len(fringes)) != frame
    curve.plot(fringes[others].ravel(), found.inferred[others].ravel() / unit, ".", color=OUTLINE, markersize=1.0,
               label="all photographs", zorder=1)  # fmt: skip
    curve.plot(fringes[frame], found.inferred[frame] / unit, ".", color=BLUE, markersize=3.0, label=f"frame {frame}")
    curve.plot(found.knot, found.level / unit, color=INK, linewidth=1.0, label="curve")
    curve.set(xlabel="squared brightness gradient G²", ylabel="sum of f$_n$ over its mean", xlim=(0.0, None))
    curve.legend(fontsize=5.5)
    add_title(curve, f"{results.name}\nr of pressures and fringes {found.correlation[frame]:.2f}")
    value = found.residual[frame] / unit
    draw_map(residual, results, frame, value, SIGNED, "fringes − forces, over the mean", signed=True)
    add_title(residual, "pressure by the fringes\nminus that by the forces")
    return figure
