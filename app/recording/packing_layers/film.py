"""Writes force networks side by side: frames of the run, and sweeps of a frame.

Only the strong contacts of few frames and sweeps are drawn, so that the film is small.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...solver.bodies.wall_shapes import STRAIGHT
from ...solver.frame_forces import FrameForces
from ..look import entities
from ..look.canvas import Canvas
from ..look.clock import Clock
from ..look.colours import FAINT, INK, LOADED_WALL, Rgba, packed, packed_one
from ..look.scene import Scene
from .forces.network import SweepChoice, visible_sweeps

COLUMNS, ROWS = 3, 3  # of frames
SWEEP_COLUMNS = 2  # of sweeps, in ROWS rows
PICTURES = COLUMNS * ROWS  # greatest number of frames
SWEEP_PICTURES = SWEEP_COLUMNS * ROWS  # greatest number of sweeps, including the reported field
STEP_DOWN = 1.14  # distance of rows over the height of a picture, with space for a name
STRONG = 1.0  # times the mean f_n of the run: the least force drawn in pictures of frames
STRONG_SWEEPS = 1.5  # times the mean f_n of the run: the least force drawn in pictures of sweeps


def film_frames(frame_count: int) -> NDArray[np.int64]:
    """Return the frames that have a picture, including the first and the last."""
    return np.unique(np.round(np.linspace(0, frame_count - 1, min(frame_count, PICTURES))).astype(np.int64))


def film_bounds(canvas: Canvas, columns: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the bounds of a film with this number of columns, in x and y [px]."""
    above = 0.5 * (STEP_DOWN - 1.0) * canvas.height
    top = canvas.top - above
    return (canvas.left, canvas.left + columns * canvas.width), (top, top + ROWS * STEP_DOWN * canvas.height)


class FilmWriter:
    """Logs the films of a run, frame by frame."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._frames = film_frames(scene.tracks.frame_count)

    def log(self, clock: Clock, forces: FrameForces) -> None:
        """Log one frame: its picture, static, if it has one; the nearest picture; the film of its sweeps."""
        frame = clock.frame
        nearest = int(np.argmin(np.abs(self._frames - frame)))
        if frame == self._frames[nearest]:
            at = self._places(np.array([nearest]), COLUMNS)
            clock.stream.log(
                f"{entities.FILM_FRAMES}/{frame}",
                self._lines(forces, forces.fn[None], at, STRONG),
                self._names(at, [f"frame {frame}"]),
                static=True,
            )
        clock.start()
        at = self._places(np.array([nearest]), COLUMNS)[0]
        frame_lines = self._outline(int(self._frames[nearest])) + at
        clock.stream.log(
            entities.FILM_PLACE,
            rr.LineStrips2D(
                frame_lines.astype(np.float32), radii=np.float32(0.16 * self._grain), colors=packed_one(LOADED_WALL)
            ),
        )
        self._log_sweeps(clock, forces)

    def _log_sweeps(self, clock: Clock, forces: FrameForces) -> None:
        rows, fn, _ = visible_sweeps(forces, clock.last - clock.first, SweepChoice.LOG, SWEEP_PICTURES * 4)
        chosen = np.unique(np.round(np.linspace(0, len(rows) - 1, min(len(rows), SWEEP_PICTURES))).astype(np.int64))
        at = self._places(np.arange(len(chosen)), SWEEP_COLUMNS)
        names = [f"sweep {row + 1}" for row in rows[chosen].tolist()]
        names[-1] = "reported"
        clock.start()
        clock.stream.log(
            entities.FILM_SWEEPS, self._lines(forces, fn[chosen], at, STRONG_SWEEPS), self._names(at, names)
        )

    @property
    def _grain(self) -> float:
        return self._scene.canvas.grain_radius

    def _places(self, pictures: NDArray[np.int64], columns: int) -> Array:
        """Return the offsets of pictures (k,) from the first (k, 2) [px]."""
        canvas = self._scene.canvas
        row, column = np.divmod(pictures, columns)
        return np.column_stack([column * canvas.width, row * STEP_DOWN * canvas.height])

    def _lines(self, forces: FrameForces, fn: NDArray[np.floating], at: Array, strong: float) -> rr.LineStrips2D:
        """Return the strong contacts of fn (k, c) [N] in pictures at offsets (k, 2) [px], and faint outlines."""
        scene, style = self._scene, self._scene.style
        picture, row = np.nonzero(np.nan_to_num(fn) > strong * style.range.mean)
        force = np.asarray(fn[picture, row], np.float64)
        lines = scene.branches(forces.frame, forces.contacts)[row] + at[picture][:, None]
        outline = self._outline(forces.frame)
        outlines = (outline[None] + at[:, None, None]).reshape(-1, 2, 2)
        faint: Rgba = (*FAINT[:3], 200)
        # One array of lines of two points: a list of arrays needs ten times the time.
        return rr.LineStrips2D(
            np.concatenate([lines, outlines]).astype(np.float32),
            radii=np.concatenate([style.radii(force), np.full(len(outlines), 0.05 * self._grain, np.float32)]),
            colors=np.concatenate([style.colours(force), np.full(len(outlines), packed_one(faint))]).astype(np.uint32),
            draw_order=20.0,
        )

    def _outline(self, frame: int) -> Array:
        """Return walls and joins of straight walls, or the cell, of a frame as lines (l, 2, 2) [px]."""
        walls = self._scene.walls
        corners = self._scene.outline(frame)
        circles = [line for line, side in zip(walls.outlines(frame), walls.sides, strict=True) if side != STRAIGHT]
        if circles:
            corners = walls.endpoints[frame, walls.sides == STRAIGHT].reshape(-1, 2)
        ends: list[Any] = [np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)]
        ends += [np.stack([line[:-1], line[1:]], axis=1) for line in circles]
        return self._scene.canvas.points(np.concatenate(ends))

    def _names(self, at: Array, names: list[str]) -> rr.Points2D:
        """Return the names of pictures, placed above them."""
        canvas = self._scene.canvas
        middle = np.array([0.5 * (canvas.left + canvas.right), canvas.top - 0.05 * canvas.height])
        return rr.Points2D(
            (middle + at).astype(np.float32),
            radii=np.float32(0.01),
            colors=packed(np.array([INK] * len(names), np.uint8)),
            labels=names,
            show_labels=True,
        )
