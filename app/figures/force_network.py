"""The force network of one frame: each contact is a line between centres, its width and colour given by f_n.

A line is broken where its force is uncertain: the missing fraction is σ(f_n) / f_n, which shows in grey and to
colour-blind readers, too. Range and hues are those of the recording.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from ..drawing.force_range import ForceRange
from ..drawing.frame_caption import caption_of_time, caption_of_trust
from ..drawing.ramps import FORCE_RAMP_ON_WHITE
from ..drawing.uncertainty import WIDEST, line_gaps, relative_uncertainty
from ..results.results import Results
from ..solver.bodies.grains import Array
from ..solver.bodies.wall_shapes import outlines
from ..solver.contacts.contacts import Contacts, ContactState
from .figure_style import BLUE, INK, OUTLINE, Width, add_scale_bar, add_title, new_figure

THICKEST = 0.5  # line width of the greatest force over the mean radius
WEAK_GREY = (0.60, 0.60, 0.62, 1.0)  # forces below the weak level
STEPS = (1.0, 2.0, 5.0)
THINNEST = 0.25  # [pt]
GAP_MARGIN = 1.3  # width of a gap over that of its line
KEY = ((0.0, ""), (0.4, "± 40 %"), (WIDEST, "± 80 %"))  # σ / f_n and label of the lines in the key
MAP_LEVELS = 256


def draw_forces(results: Results, frame: int, width: Width) -> Figure:
    """Draw the network of one frame with its sliding contacts, a colour bar and a scale bar."""
    forces = results.frames[frame]
    low, high = bounds_of(results)
    size = high - low
    figure = new_figure(width, min(0.84 * size[1] / size[0] + 0.1, 1.5))
    axes = figure.add_subplot()
    force_range = ForceRange.of(results.frames)
    draw_network(axes, results, frame, forces.contacts, forces.fn, force_range)
    sliding = (forces.state == ContactState.SLIDING) & (forces.fn > 0)
    axes.scatter(
        *forces.contacts.point[sliding].T, s=(0.9 * _points_per_metre(axes) * _radius(results) * 0.35) ** 2,
        facecolor="white", edgecolor=BLUE, linewidth=0.5, zorder=5, label="sliding",
    )  # fmt: skip
    draw_uncertainty(axes, results, frame, force_range)
    _add_key(axes, results, force_range)
    add_title(axes, describe_frame(results, frame))
    colours = ListedColormap(force_colours(np.linspace(0.0, force_range.top, MAP_LEVELS), force_range))
    bar = figure.colorbar(
        ScalarMappable(Normalize(0.0, force_range.top), colours), ax=axes, shrink=0.75, aspect=30, pad=0.02,
        extend="max",
    )  # fmt: skip
    bar.set_label(f"normal force f$_n$ [{results.force_unit}]")
    return figure


def force_colours(fn: NDArray[np.floating], force_range: ForceRange) -> Array:
    """Return colours (c, 4) of forces fn (c,) [N] on white: grey below the weak level, then the darker the stronger."""
    ramp = FORCE_RAMP_ON_WHITE / 255.0
    level = np.round(force_range.fraction_of_ramp(fn) * (len(ramp) - 1)).astype(np.int64)
    return np.where((np.nan_to_num(fn) < force_range.weak)[:, None], WEAK_GREY, ramp[level])


def draw_network(
    axes: Axes, results: Results, frame: int, contacts: Contacts, fn: Array, force_range: ForceRange
) -> None:
    """Draw grains, walls and forces fn (c,) [N] of contacts, the top of the range widest and darkest."""
    draw_packing(axes, results, frame)
    bearing = np.flatnonzero(np.nan_to_num(fn) > 0)
    bearing = bearing[np.argsort(fn[bearing])]  # strong forces are drawn over weak ones
    axes.add_collection(LineCollection(
        list(branch_lines(results, frame, contacts)[bearing]),
        linewidths=line_widths(axes, results, fn[bearing], force_range.top),
        colors=force_colours(fn[bearing], force_range), capstyle="butt", zorder=3,
    ))  # fmt: skip


def draw_packing(axes: Axes, results: Results, frame: int) -> None:
    """Draw grains, walls and a scale bar."""
    low, high = bounds_of(results)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.axis("off")
    position = results.tracks.position[frame]
    present = results.tracks.present[frame]
    diameter = 2.0 * results.tracks.radius[present]
    axes.add_collection(EllipseCollection(
        diameter, diameter, np.zeros(len(diameter)), units="xy", offsets=position[present],
        offset_transform=axes.transData, facecolor="none", edgecolor=OUTLINE, linewidth=0.35, zorder=1,
    ))  # fmt: skip
    for line in outlines(results.walls.endpoints[frame], results.walls.side):
        axes.plot(*line.T, color=INK, linewidth=0.9, zorder=2)
    if results.walls.cell is not None:
        a, b = results.walls.cell[frame]
        axes.add_patch(Polygon(np.array([np.zeros(2), a, a + b, b]), fill=False, edgecolor=INK, linewidth=0.6))
    add_scale_bar(axes, bar_length(float(high[0] - low[0])))


def draw_uncertainty(axes: Axes, results: Results, frame: int, force_range: ForceRange) -> None:
    """Break the lines of uncertain forces: white gaps of the fraction σ(f_n) / f_n of their length."""
    forces = results.frames[frame]
    bearing = np.flatnonzero(np.nan_to_num(forces.fn) > 0)
    lines = branch_lines(results, frame, forces.contacts)[bearing]
    relative = relative_uncertainty(forces.fn[bearing], forces.fn_sd[bearing])
    width = line_widths(axes, results, forces.fn[bearing], force_range.top)
    _add_gaps(axes, lines, relative, width, _radius(results), 4.0)


def describe_frame(results: Results, frame: int) -> str:
    """Describe a frame in two lines: name, frame, time and strain; status and trust."""
    forces = results.frames[frame]
    when = caption_of_time(forces, float(results.tracks.time[frame]))
    return f"{results.name}, {when}\n{caption_of_trust(forces)}"


def _add_gaps(axes: Axes, lines: Array, relative: Array, width: Array, radius: float, order: float) -> None:
    gaps = line_gaps(lines, relative, radius)
    half = 0.5 * gaps.length[:, None] * gaps.direction
    axes.add_collection(LineCollection(
        list(np.stack([gaps.middle - half, gaps.middle + half], axis=1)), linewidths=GAP_MARGIN * width[gaps.row],
        colors="white", capstyle="butt", zorder=order,
    ))  # fmt: skip


def _add_key(axes: Axes, results: Results, force_range: ForceRange) -> None:
    """Add lines of a round force, sure and uncertain, below the drawing on the right, and the mark of sliding."""
    top = force_range.top
    force = max((step * 10.0**k for k in range(-6, 9) for step in STEPS if step * 10.0**k <= 0.6 * top), default=top)
    (x0, x1), y0 = axes.get_xlim(), axes.get_ylim()[0]
    width = x1 - x0
    y, length = y0 + 0.045 * width, 0.09 * width
    start = x0 + (0.27 + 0.21 * np.arange(len(KEY))) * width
    lines = np.stack([np.stack([start, start + length], axis=1), np.full((len(KEY), 2), y)], axis=2)
    wide = line_widths(axes, results, np.full(len(KEY), force), top)
    axes.add_collection(LineCollection(
        list(lines), linewidths=wide, colors=force_colours(np.full(len(KEY), force), force_range), capstyle="butt",
        zorder=8,
    ))  # fmt: skip
    _add_gaps(axes, lines, np.array([relative for relative, _ in KEY]), wide, _radius(results), 9.0)
    for left, (_, label) in zip(start, KEY, strict=True):
        text = label or f"{force:g} {results.force_unit}"
        axes.text(left + 0.5 * length, y - 0.022 * width, text, fontsize=6.0, va="top", ha="center", zorder=9)
    x = x0 + 0.93 * width
    axes.plot([x], [y], "o", markersize=3.0, mfc="white", mec=BLUE, mew=0.5, zorder=9)
    axes.text(x, y - 0.022 * width, "sliding", fontsize=6.0, va="top", ha="center", zorder=9)


def line_widths(axes: Axes, results: Results, fn: Array, top: float) -> Array:
    """Return the widths [pt] of the lines of forces fn (c,) [N], up to the force `top` [N]."""
    widest = THICKEST * _radius(results) * _points_per_metre(axes)
    return np.maximum(widest * np.clip(fn / top, 0.0, 1.0), THINNEST)


def branch_lines(results: Results, frame: int, contacts: Contacts) -> Array:
    """Return lines (c, 2, 2) [m] from centre to centre; at a wall or the edge of a cell, to the contact point."""
    position = results.tracks.position[frame]
    ends = np.stack([position[contacts.i], contacts.point], axis=1)
    inside = ~contacts.with_wall
    if contacts.shift is not None:
        inside = inside & ~contacts.shift.any(axis=1)
    ends[inside, 1] = position[contacts.j[inside]]
    return ends


def bounds_of(results: Results) -> tuple[Array, Array]:
    """Return the lower left and upper right corner [m] of all frames, with space for the scale bar."""
    centres = results.tracks.position[results.tracks.present]
    corners = [centres - results.tracks.radius.max(), centres + results.tracks.radius.max()]
    if results.walls.count:
        corners += [line for ends in results.walls.endpoints for line in outlines(ends, results.walls.side)]
    points = np.concatenate(corners)
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    margin = 0.015 * float((high - low).max())
    return low - np.array([margin, margin + 0.11 * (high - low)[0]]), high + margin


def bar_length(across: float) -> float:
    """Return a round length [m] of about a fifth of the drawing."""
    decade = 10.0 ** np.floor(np.log10(0.25 * across))
    return float(max(step * decade for step in STEPS if step * decade <= 0.25 * across))


def _radius(results: Results) -> float:
    return float(np.mean(results.tracks.radius))


def _points_per_metre(axes: Axes) -> float:
    """Return the points of 1/72 inch per metre of a drawing that fills most of its figure."""
    figure = axes.figure
    assert isinstance(figure, Figure)
    across = axes.get_xlim()[1] - axes.get_xlim()[0]
    return 72.0 * 0.8 * float(figure.get_size_inches()[0]) / across
