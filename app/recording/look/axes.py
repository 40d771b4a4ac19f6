"""Axes drawn as lines, for plots that the viewer lacks: logarithmic axes, scatter plots, roses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from . import entities
from .clock import Clock
from .colours import FAINT, INK, SERIES, Rgba, packed
from .values import dots, strips

WIDTH, HEIGHT = 600.0, 380.0  # of a plot, in units of its view
PLOT_BOUNDS = ((-60.0, WIDTH + 25.0), (-15.0, HEIGHT + 45.0))  # of a view with its labels
CIRCLE = 100.0  # radius of the unit circle of a polar plot


@dataclass(frozen=True, slots=True)
class Axes:
    """Data ranges of a plot, drawn in a rectangle of width × height view units, y up."""

    x_range: tuple[float, float]
    y_range: tuple[float, float]
    width: float = WIDTH
    height: float = HEIGHT

    def points(self, x: Array, y: Array) -> NDArray[np.float32]:
        """Convert data coordinates to view coordinates (…, 2)."""
        (x0, x1), (y0, y1) = self.x_range, self.y_range
        across = (np.asarray(x) - x0) / (x1 - x0) * self.width
        down = (y1 - np.asarray(y)) / (y1 - y0) * self.height
        return np.stack(np.broadcast_arrays(across, down), axis=-1).astype(np.float32)

    def log(
        self,
        stream: rr.RecordingStream,
        path: str,
        *,
        x_ticks: Sequence[tuple[float, str]],
        y_ticks: Sequence[tuple[float, str]],
        notes: Sequence[tuple[float, float, str, Rgba]] = (),
        guides: Sequence[NDArray[np.float32]] = (),
    ) -> None:
        """Log grid lines and labels, static.

        Parameters
        ----------
        stream : RecordingStream
            The stream.
        path : str
            Entity of the lines; that of the texts is below it.
        x_ticks, y_ticks : sequence of (float, str)
            Value and label of every grid line.
        notes : sequence of (float, float, str, Rgba)
            Coloured texts at data coordinates x, y.
        guides : sequence of arrays (k, 2)
            Further lines, in view coordinates.
        """
        x0, x1, y0, y1 = *self.x_range, *self.y_range
        grid = [self.points(np.array([x, x]), np.array([y0, y1])) for x, _ in x_ticks]
        grid += [self.points(np.array([x0, x1]), np.array([y, y])) for y, _ in y_ticks]
        shades = np.array([FAINT] * len(grid) + [INK] * len(guides), np.uint8)
        shades[: len(grid), 3] = 90
        stream.log(path, strips([*grid, *guides], 0.6, packed(shades), 0.0), static=True)
        # The viewer places a text below its point.
        raised, left = 16.0 * (y1 - y0) / self.height, 22.0 * (x1 - x0) / self.width
        texts = [(x, y0, text, INK) for x, text in x_ticks]
        texts += [(x0 - left, y + raised, text, INK) for y, text in y_ticks]
        placed = [(self.points(np.array(x), np.array(y)), text, colour) for x, y, text, colour in [*texts, *notes]]
        log_texts(stream, path + entities.TICKS, placed)


def log_texts(
    stream: rr.RecordingStream | Clock, path: str, texts: Sequence[tuple[NDArray, str, Rgba]], *, static: bool = True
) -> None:
    """Log coloured texts at points (2,) in view coordinates."""
    stream.log(
        path,
        rr.Points2D(
            np.array([point for point, _, _ in texts], np.float32).reshape(-1, 2),
            radii=np.float32(0.01),
            colors=packed(np.array([colour for _, _, colour in texts], np.uint8).reshape(-1, 4)),
            labels=[text for _, text, _ in texts],
            show_labels=True,
        ),
        static=static,
    )


def circle(radius: float = CIRCLE) -> NDArray[np.float32]:
    """Return a closed circle about the origin (97, 2)."""
    angle = np.linspace(0.0, 2.0 * np.pi, 97)
    return polar(angle, np.full(97, radius / CIRCLE))


def polar(angle: Array, radius: Array) -> NDArray[np.float32]:
    """Return points (k, 2) at angles [rad], counter-clockwise on the screen, and radii in units of the circle."""
    return (CIRCLE * np.stack([radius * np.cos(angle), -radius * np.sin(angle)], axis=-1)).astype(np.float32)


def log_cross_hairs(stream: rr.RecordingStream, path: str, reach: float) -> None:
    """Log the unit circle and the axes of a polar plot, static, up to `reach` in units of the circle."""
    arm = reach * CIRCLE
    lines = [circle(), np.array([[-arm, 0], [arm, 0]]), np.array([[0, -arm], [0, arm]])]
    stream.log(path, strips(lines, 0.5, FAINT, 0.0), static=True)


def log_scatter_axes(stream: rr.RecordingStream, axes: Axes, path: str, across: str, up: str) -> None:
    """Log axes of equal ranges from zero with the line of equality and their names, static."""
    reach = axes.x_range[1]
    values = round_ticks(0.0, reach, 2.5)
    axes.log(
        stream, path, x_ticks=values, y_ticks=values,
        notes=[(0.8 * reach, 0.1 * reach, f"across: {across}", INK), (0.24 * reach, 0.97 * reach, f"up: {up}", INK)],
        guides=[axes.points(np.array([0.0, reach]), np.array([0.0, reach]))],
    )  # fmt: skip


def scatter(axes: Axes, x: Array, y: Array) -> rr.Points2D:
    """Return a point for every pair of data coordinates, at most the greatest of the axis of x."""
    reach = axes.x_range[1]
    return dots(axes.points(np.minimum(x, reach), np.minimum(y, reach)), 2.5, (*SERIES[0][:3], 200), 20.0)


def round_ticks(low: float, high: float, parts: float) -> list[tuple[float, str]]:
    """Return round values between the ends of an axis in about so many parts, with their texts."""
    step = round_step((high - low) / parts)
    first, last = int(np.ceil(low / step)), int(np.floor(high / step))
    return [(step * k, f"{step * k:g}".replace("-", "−")) for k in range(first, last + 1)]


def round_step(size: float) -> float:
    """Return the greatest of 1, 2, 5 × 10^k that is not above a size."""
    decade = 10.0 ** np.floor(np.log10(size))
    return float(decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= size))
