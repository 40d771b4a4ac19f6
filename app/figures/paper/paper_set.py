"""The figures of the paper that introduced the method: apparatus, single frames, consecutive ones, comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...drawing.force_range import ForceRange
from ...drawing.frame_caption import caption_of_trust
from ...inference.zero_start import ZeroStart
from ...results.results import Results, TruthContacts
from ...solver.bodies.grains import Array
from ...solver.bodies.wall_shapes import outlines
from ...solver.frame_forces import FrameStatus
from ...solver.statistics.force_statistics import FORCE_EDGES, force_density
from ..figure_style import BLUE, INK, OUTLINE, VERMILION, Width, add_scale_bar, add_title, new_figure
from ..force_network import bar_length, bounds_of, draw_network
from ..time_curves import DEGREE
from .recorded_stress import recorded_stress

STRIP = 5  # consecutive networks
SCALE_BAR = 0.07  # of the width, below the packing
INSET_RADII = 2.2  # half width of the inset, in radii of the shown rod


@dataclass(frozen=True, slots=True)
class Picture:
    """A photograph of the packing."""

    frame: int
    grey: NDArray[np.floating]  # (h, w), the first row on top
    extent: tuple[float, float, float, float]  # [m] left, right, bottom, top


def draw_apparatus(results: Results, pictures: Sequence[Picture], width: Width) -> Figure:
    """Draw the packing in its first and last frame, photographs where there are any, with a rod enlarged."""
    frames = [picture.frame for picture in pictures] or [0, results.tracks.frame_count - 1]
    low, high = bounds_of(results)
    height = float((high - low)[1] / (high - low)[0])
    count = len(frames)
    if width == "double":
        figure = new_figure(width, height / (count + 0.5) + 0.04)
        *panels, inset = figure.subplots(1, count + 1, width_ratios=[1.0] * count + [0.5])
    else:
        figure = new_figure(width, count * height + 0.6)
        *panels, inset = figure.subplots(count + 1, 1, height_ratios=[height] * count + [0.5])
    for number, (axes, frame) in enumerate(zip(panels, frames, strict=True)):
        picture = _above(pictures[number], float(low[1] + SCALE_BAR * (high - low)[0])) if pictures else None
        _draw_rods(axes, results, frame, picture)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.axis("off")
        shear = results.frames[frame].shear
        label = f"shear {np.degrees(shear):.2f}°" if np.isfinite(shear) else f"{results.tracks.time[frame]:.4g} s"
        add_title(axes, f"({'abcdefgh'[number]}) frame {frame}, {label}")
        add_scale_bar(axes, bar_length(float(high[0] - low[0])))
    grain = _enlarge(inset, results, frames[-1], pictures[-1] if pictures else None)
    add_title(inset, f"rod {results.tracks.id[grain]}, frame {frames[-1]}")
    return figure


def draw_zero_starts(results: Results, worst: ZeroStart, best: ZeroStart, width: Width) -> Figure:
    """Draw two frames swept from zero forces: the one that departs most from the reported forces, and the nearest."""
    figure, panels = _row(results, 2, width)
    force_range = ForceRange.of(results.frames)
    for axes, letter, found in zip(panels, "ab", (worst, best), strict=True):
        draw_network(axes, results, found.frame, found.contacts, found.fn, force_range)
        add_title(axes, f"({letter}) frame {found.frame} from zero forces\nr with the reported: {found.agreement:.2f}")
    return figure


def draw_strip(results: Results, frame: int, width: Width) -> Figure:
    """Draw the networks of consecutive frames that end with a given one."""
    last = range(max(frame - STRIP + 1, 0), frame + 1)
    frames = [k for k in last if results.frames[k].status is not FrameStatus.FAILED]
    figure, panels = _row(results, len(frames), width)
    force_range = ForceRange.of(results.frames)
    for axes, k in zip(panels, frames, strict=True):
        forces = results.frames[k]
        draw_network(axes, results, k, forces.contacts, forces.fn, force_range)
        add_title(axes, f"frame {k}\n{caption_of_trust(forces)}")
    return figure


def draw_recorded(results: Results, truth: TruthContacts | None, frame: int, width: Width) -> Figure:
    """Draw P(f_n), friction angle and principal direction: identified, and recorded where that is known."""
    figure = new_figure(width, 0.36 if width == "double" else 2.0)
    density, angle, direction = figure.subplots(*((1, 3) if width == "double" else (3, 1)))
    _draw_density(density, results, truth)
    time, recorded = results.tracks.time, recorded_stress(results, truth)
    for axes, name, label in (
        (angle, "friction_angle", "friction angle [°]"), (direction, "principal_direction", "direction of σ$_1$ [°]"),
    ):  # fmt: skip
        value = np.array([getattr(each, name) for each in results.statistics], np.float64)
        value = value if name == "friction_angle" else _continuous(value)
        sd = np.array([getattr(each, f"{name}_sd", np.nan) for each in results.statistics], np.float64)
        axes.fill_between(
            time, DEGREE * (value - 2.0 * sd), DEGREE * (value + 2.0 * sd), color=BLUE, alpha=0.18, linewidth=0.0
        )
        axes.plot(time, DEGREE * value, color=BLUE, label="identified")
        if recorded is not None:
            given = getattr(recorded, name)
            given = given if name == "friction_angle" else value + (given - value + 0.5 * np.pi) % np.pi - 0.5 * np.pi
            axes.plot(time, DEGREE * given, color=VERMILION, linestyle=(0, (5, 1.5)), label=recorded.source)
        axes.axvline(time[frame], color=OUTLINE, linewidth=0.6, zorder=0)
        axes.set(xlabel="time [s]", ylabel=label)
        axes.legend(loc="best")
    add_title(angle, "(b) band: two standard deviations")
    add_title(direction, "(c)" if recorded is not None else "(c) nothing was recorded")
    return figure


def _draw_density(axes: Axes, results: Results, truth: TruthContacts | None) -> None:
    """Draw P(f_n / ⟨f_n⟩) pooled over the frames, with the true one."""
    middle = 0.5 * (FORCE_EDGES[1:] + FORCE_EDGES[:-1])
    known = [each.fn_density for each in results.statistics if np.isfinite(each.fn_density).all()]
    if known:
        axes.plot(middle, _positive(np.mean(known, axis=0)), color=BLUE, label="identified")
    if truth is not None:
        bodies = results.grains.count + results.walls.count
        by_frame = [force[:, 0] for _, force in truth.by_frame(bodies, len(results.frames))]
        true = [force_density(fn[fn > 0.0]) for fn in by_frame if (fn > 0.0).any()]
        axes.plot(middle, _positive(np.mean(true, axis=0)), "o", color=VERMILION, mfc="white", label="true")
    axes.plot(middle, np.exp(-middle), ":", color=INK, linewidth=0.8, label="exp(−x)")
    axes.set(yscale="log", xlim=(0.0, 6.0), ylim=(2e-3, 3.0), xlabel="f$_n$ over its mean", ylabel="density")
    axes.legend()
    add_title(axes, f"(a) {results.name}: all frames")


def _draw_rods(axes: Axes, results: Results, frame: int, picture: Picture | None) -> None:
    for line in outlines(results.walls.endpoints[frame], results.walls.side):
        if picture is not None:  # a photograph is dark here and bright there
            axes.plot(*line.T, color="white", linewidth=2.0, zorder=2)
        axes.plot(*line.T, color=INK if picture is None else VERMILION, linewidth=0.7, zorder=2)
    if picture is not None:
        axes.imshow(picture.grey, cmap="gray", extent=picture.extent, origin="upper", zorder=0)
        return
    here = results.tracks.present[frame]
    place, size = results.tracks.position[frame, here], results.tracks.radius[here]
    axes.add_collection(EllipseCollection(
        2.0 * size, 2.0 * size, np.zeros(len(size)), units="xy", offsets=place, offset_transform=axes.transData,
        facecolor="#eceef2", edgecolor=INK, linewidth=0.35, zorder=1,
    ))  # fmt: skip
    turned = np.nan_to_num(results.tracks.rotation[frame, here])
    arm = size[:, None] * np.stack([np.cos(turned), np.sin(turned)], axis=1)
    marks = np.stack([place, place + arm], axis=1)
    axes.add_collection(LineCollection(list(marks), colors=INK, linewidths=0.3, zorder=1))


def _enlarge(axes: Axes, results: Results, frame: int, picture: Picture | None) -> int:
    """Enlarge the largest rod near the middle; return its row."""
    here = np.flatnonzero(results.tracks.present[frame])
    place = results.tracks.position[frame, here]
    away = np.linalg.norm(place - np.median(place, axis=0), axis=1)
    grain = int(here[np.argmax(results.tracks.radius[here] - 0.02 * away)])
    centre, reach = results.tracks.position[frame, grain], INSET_RADII * float(results.tracks.radius[grain])
    _draw_rods(axes, results, frame, picture)
    axes.set(
        xlim=(centre[0] - reach, centre[0] + reach), ylim=(centre[1] - reach, centre[1] + reach), aspect="equal",
        xticks=[], yticks=[],
    )  # fmt: skip
    for spine in axes.spines.values():
        spine.set(visible=True, color=INK, linewidth=0.6)
    return grain


def _above(picture: Picture, lowest: float) -> Picture:
    """Return a picture without the rows below a height [m]."""
    left, right, bottom, top = picture.extent
    rows = len(picture.grey)
    kept = int(np.clip(np.ceil((top - lowest) / (top - bottom) * rows), 1, rows))
    return Picture(picture.frame, picture.grey[:kept], (left, right, top - kept * (top - bottom) / rows, top))


def _row(results: Results, count: int, width: Width) -> tuple[Figure, list[Axes]]:
    """Return panels side by side, of the shape of the packing."""
    low, high = bounds_of(results)
    height = float((high - low)[1] / (high - low)[0])
    figure = new_figure(width, height / count + 0.12)
    return figure, list(np.atleast_1d(figure.subplots(1, count)).ravel())


def _continuous(direction: Array) -> Array:
    """Return directions (f,) [rad] without jumps by π."""
    known = np.isfinite(direction)
    result = direction.copy()
    result[known] = 0.5 * np.unwrap(2.0 * direction[known])
    return result


def _positive(density: Array) -> Array:
    return np.where(density > 0, density, np.nan)
