"""The difference of two force networks: width by its magnitude, colour and lightness by its sign."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ..drawing.force_range import DIFFERENCE_FRACTION, ForceRange
from ..results.comparison import Comparison
from ..results.results import Results
from ..solver.contacts.contacts import measure_pairs
from ..solver.contacts.pairs import align
from .figure_style import Width, add_title, new_figure
from .force_network import bounds_of, branch_lines, describe_frame, draw_packing, line_widths

MORE, LESS = "#e8833a", "#0b3c8c"  # of which the second is darker, so that the sign shows in grey


def draw_difference(comparison: Comparison, frame: int, width: Width) -> Figure:
    """Draw first − second on the contacts of either, with scale bar, key and correlation.

    Parameters
    ----------
    comparison : Comparison
        Both fields; the second is the reference.
    frame : int
        Frame of `comparison.base`.
    width : str
        "single" or "double" column.
    """
    base, first, second = comparison.base, comparison.first.frames[frame], comparison.second.frames[frame]
    low, high = bounds_of(base)
    size = high - low
    figure = new_figure(width, min(size[1] / size[0] + 0.12, 1.5))
    axes = figure.add_subplot()
    draw_packing(axes, base, frame)
    key, ours, theirs = align(
        first.contacts.key, np.nan_to_num(first.fn), second.contacts.key, np.nan_to_num(second.fn)
    )  # fmt: skip
    contacts = measure_pairs(base.grains, base.tracks.position[frame], base.walls.at_rest(frame), key)
    drawn = np.flatnonzero(np.isfinite(contacts.point).all(axis=1))
    difference = (ours - theirs)[drawn]
    order = np.argsort(np.abs(difference))
    drawn, difference = drawn[order], difference[order]
    top = DIFFERENCE_FRACTION * ForceRange.of(base.frames).top
    axes.add_collection(LineCollection(
        list(branch_lines(base, frame, contacts)[drawn]),
        linewidths=line_widths(axes, base, np.abs(difference), top),
        colors=np.where(difference > 0.0, MORE, LESS).tolist(), capstyle="butt", zorder=3,
    ))  # fmt: skip
    _add_key(axes, base, top, (comparison.first.name, comparison.second.name))
    r = comparison.agreement[frame].r_fn
    title = f"{comparison.first.name} − {comparison.second.name}: r(f$_n$) = {r:.3f}"
    add_title(axes, f"{describe_frame(base, frame)}\n{title}")
    return figure


def _add_key(axes: Axes, base: Results, top: float, names: tuple[str, str]) -> None:
    (x0, x1), y0 = axes.get_xlim(), axes.get_ylim()[0]
    width = x1 - x0
    y, length = y0 + 0.045 * width, 0.09 * width
    wide = float(line_widths(axes, base, np.array([0.5 * top]), top)[0])
    for place, colour, name in ((0.36, MORE, names[0]), (0.76, LESS, names[1])):
        left = x0 + place * width
        axes.plot([left, left + length], [y, y], color=colour, linewidth=wide, solid_capstyle="butt", zorder=8)
        text = f"{name} more by {0.5 * top:.3g} {base.force_unit}"
        axes.text(left + 0.5 * length, y - 0.022 * width, text, fontsize=6.0, va="top", ha="center", zorder=9)
