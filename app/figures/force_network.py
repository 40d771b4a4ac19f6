"""The force network of one frame: every contact a line between centres, width and colour by f_n."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from solver.bodies.grains import Array
from solver.bodies.wall_shapes import outlines
from solver.contacts.contacts import Contacts, ContactState
from solver.sequence.frame_forces import FrameForces

from ..results.results import Results
from .page import BLUE, INK, OUTLINE, Width, add_scale_bar, add_title, new_figure

TOP_QUANTILE = 0.995  # of f_n over all frames: above it width and colour no longer grow
THICKEST = 0.5  # line width of the greatest force over a mean radius
FORCE_MAP = LinearSegmentedColormap.from_list("force", colormaps["magma_r"](np.linspace(0.18, 0.95, 128)))
STEPS = (1.0, 2.0, 5.0)


def draw_forces(results: Results, frame: int, width: Width) -> Figure:
    """The network of one frame, sliding contacts marked, with colour bar and scale bar."""
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
    add_title(axes, f"{results.name}, frame {frame}: {_counts(forces)}")
    bar = figure.colorbar(
        ScalarMappable(Normalize(0.0, top), FORCE_MAP), ax=axes, shrink=0.75, aspect=30, pad=0.02, extend="max"
    )
    bar.set_label("normal force f$_n$ [N]")
    return figure


def draw_network(axes: Axes, results: Results, frame: int, contacts: Contacts, fn: Array, top: float) -> None:
    """Draw grains, walls and forces fn (c,) [N] of contacts; `top` [N] is widest and darkest."""
    low, high = bounds_of(results)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.axis("off")
    position = results.tracks.position[frame]
    seen = results.tracks.present[frame]
    diameter = 2.0 * results.tracks.radius[seen]
    axes.add_collection(EllipseCollection(
        diameter, diameter, np.zeros(len(diameter)), units="xy", offsets=position[seen],
        offset_transform=axes.transData, facecolor="none", edgecolor=OUTLINE, linewidth=0.35, zorder=1,
    ))  # fmt: skip
    for line in outlines(results.walls.endpoints[frame], results.walls.side):
        axes.plot(*line.T, color=INK, linewidth=0.9, zorder=2)
    if results.walls.cell is not None:
        a, b = results.walls.cell[frame]
        axes.add_patch(Polygon(np.array([np.zeros(2), a, a + b, b]), fill=False, edgecolor=INK, linewidth=0.6))
    bearing = np.flatnonzero(np.nan_to_num(fn) > 0)
    bearing = bearing[np.argsort(fn[bearing])]  # strong ones above weak ones
    share = np.clip(fn[bearing] / top, 0.0, 1.0)
    widest = THICKEST * _radius(results) * _points_per_metre(axes)
    axes.add_collection(LineCollection(
        list(branch_lines(results, frame, contacts)[bearing]), linewidths=np.maximum(widest * share, 0.15),
        colors=FORCE_MAP(share), capstyle="round", zorder=3,
    ))  # fmt: skip
    add_scale_bar(axes, bar_length(float(high[0] - low[0])))


def branch_lines(results: Results, frame: int, contacts: Contacts) -> Array:
    """Lines (c, 2, 2) [m] from centre to centre, to the contact point at a wall or across the edge of a cell."""
    position = results.tracks.position[frame]
    ends = np.stack([position[contacts.i], contacts.point], axis=1)
    inside = ~contacts.with_wall
    if contacts.shift is not None:
        inside = inside & ~contacts.shift.any(axis=1)
    ends[inside, 1] = position[contacts.j[inside]]
    return ends


def bounds_of(results: Results) -> tuple[Array, Array]:
    """Lower left and upper right corner [m] of all that is drawn in any frame, with room for the scale bar."""
    seen = results.tracks.position[results.tracks.present]
    corners = [seen - results.tracks.radius.max(), seen + results.tracks.radius.max()]
    if results.walls.count:
        corners += [line for ends in results.walls.endpoints for line in outlines(ends, results.walls.side)]
    points = np.concatenate(corners)
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    margin = 0.015 * float((high - low).max())
    return low - np.array([margin, margin + 0.07 * (high - low)[0]]), high + margin


def top_force(results: Results) -> float:
    """The force [N] that is drawn widest, the same for every frame of a run; 1 where there is none."""
    fn = np.concatenate([np.empty(0), *(frame.fn for frame in results.frames)])
    fn = fn[np.isfinite(fn) & (fn > 0)]
    return float(np.quantile(fn, TOP_QUANTILE)) if len(fn) else 1.0


def bar_length(across: float) -> float:
    """A round length of about a fifth of the drawing [m]."""
    decade = 10.0 ** np.floor(np.log10(0.25 * across))
    return float(max(step * decade for step in STEPS if step * decade <= 0.25 * across))


def _radius(results: Results) -> float:
    return float(np.mean(results.tracks.radius))


def _points_per_metre(axes: Axes) -> float:
    """Points of 1/72 inch that a metre takes, as long as the drawing fills most of its figure."""
    figure = axes.figure
    assert isinstance(figure, Figure)
    across = axes.get_xlim()[1] - axes.get_xlim()[0]
    return 72.0 * 0.8 * float(figure.get_size_inches()[0]) / across


def _counts(forces: FrameForces) -> str:
    trust = f", trust {forces.trust:.2f}" if np.isfinite(forces.trust) else ""
    return f"{forces.status.name.lower()}{trust}"
