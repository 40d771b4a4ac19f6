"""The force network of one frame: each contact is a line between centres, its width and colour given by f_n.

A line is hollow where its force is uncertain: the white core is as wide as the standard deviation is large beside the
force, which shows in grey and to colour-blind readers, too.
"""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from ..results.results import Results
from ..solver.bodies.grains import Array
from ..solver.bodies.wall_shapes import outlines
from ..solver.contacts.contacts import Contacts, ContactState
from ..solver.frame_forces import FrameForces, FrameStatus
from .figure_style import BLUE, INK, OUTLINE, Width, add_scale_bar, add_title, new_figure

TOP_QUANTILE = 0.995  # of f_n over all frames: above it width and colour are constant
THICKEST = 0.5  # line width of the greatest force over the mean radius
FORCE_MAP = LinearSegmentedColormap.from_list("force", colormaps["magma_r"](np.linspace(0.18, 0.95, 128)))
STEPS = (1.0, 2.0, 5.0)
THINNEST, THINNEST_CORE = 0.15, 0.12  # [pt]
LONGEST_REASON = 60  # characters of a reason in a title
WIDEST_CORE = 0.8  # of the line


def draw_forces(results: Results, frame: int, width: Width) -> Figure:
    """Draw the network of one frame with its sliding contacts, a colour bar and a scale bar."""
    forces = results.frames[frame]
    low, high = bounds_of(results)
    size = high - low
    figure = new_figure(width, min(0.96 * size[1] / size[0] + 0.16, 1.5))
    axes = figure.add_subplot()
    top = top_force(results)
    draw_network(axes, results, frame, forces.contacts, forces.fn, top)
    sliding = (forces.state == ContactState.SLIDING) & (forces.fn > 0)
    axes.scatter(
        *forces.contacts.point[sliding].T, s=(0.9 * _points_per_metre(axes) * _radius(results) * 0.35) ** 2,
        facecolor="white", edgecolor=BLUE, linewidth=0.5, zorder=5, label="sliding",
    )  # fmt: skip
    draw_uncertainty(axes, results, frame, top)
    _add_key(axes, results, top)
    add_title(axes, f"{describe_frame(results, frame)}; ○ sliding, hollow: uncertain")
    bar = figure.colorbar(
        ScalarMappable(Normalize(0.0, top), FORCE_MAP), ax=axes, shrink=0.75, aspect=30, pad=0.02, extend="max"
    )
    bar.set_label("normal force f$_n$ [N]")
    return figure


def draw_network(axes: Axes, results: Results, frame: int, contacts: Contacts, fn: Array, top: float) -> None:
    """Draw grains, walls and forces fn (c,) [N] of contacts; the force `top` [N] is widest and darkest."""
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
    bearing = np.flatnonzero(np.nan_to_num(fn) > 0)
    bearing = bearing[np.argsort(fn[bearing])]  # strong forces are drawn over weak ones
    fraction = np.clip(fn[bearing] / top, 0.0, 1.0)
    axes.add_collection(LineCollection(
        list(branch_lines(results, frame, contacts)[bearing]), linewidths=_line_widths(axes, results, fn[bearing], top),
        colors=FORCE_MAP(fraction), capstyle="round", zorder=3,
    ))  # fmt: skip
    add_scale_bar(axes, bar_length(float(high[0] - low[0])))


def draw_uncertainty(axes: Axes, results: Results, frame: int, top: float) -> None:
    """Draw the white cores of uncertain forces, as wide as σ(f_n) / f_n of the line, at most WIDEST_CORE of it."""
    forces = results.frames[frame]
    bearing = np.flatnonzero(np.nan_to_num(forces.fn) > 0)
    bearing = bearing[np.argsort(forces.fn[bearing])]
    relative = relative_uncertainty(forces)[bearing]
    line = _line_widths(axes, results, forces.fn[bearing], top)
    core = np.clip(relative, 0.0, WIDEST_CORE) * line
    shown = np.isfinite(core) & (core > THINNEST_CORE)
    axes.add_collection(LineCollection(
        list(branch_lines(results, frame, forces.contacts)[bearing[shown]]), linewidths=core[shown], colors="white",
        capstyle="butt", zorder=4,
    ))  # fmt: skip


def relative_uncertainty(forces: FrameForces) -> Array:
    """Return σ(f_n) / f_n of every contact (c,); NaN where no standard deviation is known or no force is borne."""
    borne = np.where(forces.fn > 0, forces.fn, np.nan)
    return np.asarray(forces.fn_sd / borne, np.float64)


def describe_frame(results: Results, frame: int) -> str:
    """Describe a frame in two lines: name, frame, time and shear; status and trust."""
    forces = results.frames[frame]
    shear = f", shear {np.degrees(forces.shear):.2f}°" if np.isfinite(forces.shear) else ""
    return f"{results.name}, frame {frame}, {results.tracks.time[frame]:.4g} s{shear}\n{_counts(forces)}"


def _add_key(axes: Axes, results: Results, top: float) -> None:
    """Add lines of a round force, certain and uncertain, below the drawing on the right."""
    force = max((step * 10.0**k for k in range(-6, 9) for step in STEPS if step * 10.0**k <= top), default=top)
    (x0, x1), y0 = axes.get_xlim(), axes.get_ylim()[0]
    width = x1 - x0
    line = float(_line_widths(axes, results, np.array([force]), top)[0])
    y, length = y0 + 0.035 * width, 0.06 * width
    for column, (relative, label) in enumerate(((0.0, f"{force:g} N"), (0.3, "± 30 %"), (0.7, "± 70 %"))):
        x = x0 + (0.42 + 0.2 * column) * width
        axes.plot(
            [x, x + length], [y, y], color=FORCE_MAP(force / top), linewidth=line, solid_capstyle="butt", zorder=8
        )
        if relative:
            axes.plot(
                [x, x + length], [y, y], color="white", linewidth=relative * line, solid_capstyle="butt", zorder=9
            )
        axes.text(x + length + 0.012 * width, y, label, fontsize=7.0, va="center", zorder=9)


def _line_widths(axes: Axes, results: Results, fn: Array, top: float) -> Array:
    """Return the widths [pt] of the lines of forces fn (c,) [N]."""
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
    return low - np.array([margin, margin + 0.07 * (high - low)[0]]), high + margin


def top_force(results: Results) -> float:
    """Return the force [N] drawn widest, the same for every frame of a run; 1 if there is none."""
    fn = np.concatenate([np.empty(0), *(frame.fn for frame in results.frames)])
    fn = fn[np.isfinite(fn) & (fn > 0)]
    return float(np.quantile(fn, TOP_QUANTILE)) if len(fn) else 1.0


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


def _counts(forces: FrameForces) -> str:
    trust = f", trust {forces.trust:.2f}" if np.isfinite(forces.trust) else ""
    suspect = f": {forces.reason}" if forces.status is FrameStatus.SUSPECT and forces.reason else ""
    return f"{forces.status.name.lower()}{trust}{suspect[:LONGEST_REASON]}"
