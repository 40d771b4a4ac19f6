"""Writes force networks side by side: frames of the run, and sweeps of a frame.

Only the strong contacts of few frames and sweeps are drawn, so that the film is small.
"""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...drawing.frame_caption import caption_of_strain, caption_of_trust
from ...solver.bodies.grains import Array
from ...solver.bodies.wall_shapes import STRAIGHT
from ...solver.even_subset import even_subset
from ...solver.frame_forces import FrameForces
from ..look import entities
from ..look.axes import log_texts
from ..look.canvas import Canvas
from ..look.clock import Clock
from ..look.colours import FAINT, INK, LOADED_WALL, Rgba, packed, packed_one
from ..look.ramp_legend import PIECES
from ..look.scene import Scene
from ..look.values import strips
from .forces.network import SweepChoice, visible_sweeps
from .legends import scale_bar_of

COLUMNS, ROWS = 3, 3  # of frames
SWEEP_COLUMNS = 2  # of sweeps, in ROWS rows
PICTURES = COLUMNS * ROWS  # greatest number of frames
SWEEP_PICTURES = SWEEP_COLUMNS * ROWS  # greatest number of sweeps, including the reported field
STEP_DOWN = 1.6  # distance of rows over the height of a picture, with space for a name
NAME_WIDTH = {COLUMNS: 1.5, SWEEP_COLUMNS: 0.7}  # of the height of a picture: the least distance of columns
LINE_HEIGHT = 0.16  # of the height of a picture: from line to line above it
KEY_HEIGHT = 0.22  # of the height of a picture: the strip below all of them, for the legend
LONGEST_JOIN = 4.0  # mean radii between the ends of two walls that are joined
STRONG = 1.0  # times the mean f_n of the run: the least force drawn in pictures of frames
STRONG_SWEEPS = 1.5  # times the mean f_n of the run: the least force drawn in pictures of sweeps


def film_frames(frame_count: int) -> NDArray[np.int64]:
    """Return the frames that have a picture, including the first and the last."""
    return even_subset(frame_count, PICTURES)


def film_bounds(canvas: Canvas, columns: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the bounds of a film with this number of columns, in x and y [px]."""
    above = (STEP_DOWN - 1.0) * canvas.height
    top = canvas.top - above
    return (canvas.left, canvas.left + columns * step_across(canvas, columns)), (
        top,
        top + (ROWS * STEP_DOWN + KEY_HEIGHT) * canvas.height,
    )


def step_across(canvas: Canvas, columns: int) -> float:
    """Return the distance of the columns of a film [px], with space for the names of narrow pictures."""
    return max(canvas.width, NAME_WIDTH[columns] * canvas.height)


def film_caption(forces: FrameForces, time: float) -> list[str]:
    """Return the lines above a picture: frame and time, strain, status and trust."""
    when = f"frame {forces.frame} · {time:.4g} s" if np.isfinite(time) else f"frame {forces.frame}"
    return [when, caption_of_strain(forces) or "strain unknown", caption_of_trust(forces)]


class FilmWriter:
    """Logs the films of a run, frame by frame."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._frames = film_frames(scene.tracks.frame_count)

    def log_keys(self, stream: rr.RecordingStream) -> None:
        """Log the legend of forces and a scale bar, which hold for all pictures, below both films, static."""
        canvas, style = self._scene.canvas, self._scene.style
        for path, columns in ((entities.FILM_KEY, COLUMNS), (entities.FILM_SWEEPS_KEY, SWEEP_COLUMNS)):
            wide = columns * step_across(canvas, columns)
            x = canvas.left + np.linspace(0.25, 0.75, PIECES + 1) * wide
            y = np.full(PIECES, canvas.top + ((ROWS - 1) * STEP_DOWN + 1.0 + 0.3 * KEY_HEIGHT) * canvas.height)
            lines = np.stack([np.stack([x[:-1], y], axis=1), np.stack([x[1:], y], axis=1)], axis=1)
            fn = np.linspace(0.0, style.range.top, PIECES + 1)[1:]
            length, label = scale_bar_of(canvas)
            bar = np.array([[canvas.left + 0.04 * wide, y[0]], [canvas.left + 0.04 * wide + length, y[0]]])
            stream.log(
                path,
                rr.LineStrips2D(
                    np.concatenate([lines, bar[None]]).astype(np.float32),
                    radii=np.append(style.radii(fn), np.float32(0.16 * self._grain)),
                    colors=np.append(style.colours(fn), np.uint32(packed_one(INK))),
                ),
                static=True,
            )
            top = f"≥ {style.range.top:.3g} {self._scene.force_unit}"
            texts = (("0", x[0]), (top, x[-1]), (label, float(bar[:, 0].mean())))
            log_texts(stream, path + entities.TICKS, [(np.array([at, y[0]]), text, INK) for text, at in texts])

    def log(self, clock: Clock, forces: FrameForces) -> None:
        """Log one frame: its picture, static, if it has one; the nearest picture; the film of its sweeps."""
        frame = clock.frame
        nearest = int(np.argmin(np.abs(self._frames - frame)))
        if frame == self._frames[nearest]:
            at = self._places(np.array([nearest]), COLUMNS)
            clock.log(
                f"{entities.FILM_FRAMES}/{frame}",
                self._lines(forces, forces.fn[None], at, STRONG),
                self._names(np.repeat(at, 3, axis=0), film_caption(forces, clock.time)),
                static=True,
            )
        clock.start()
        at = self._places(np.array([nearest]), COLUMNS)[0]
        frame_lines = self._outline(int(self._frames[nearest])) + at
        clock.log(
            entities.FILM_PLACE,
            rr.LineStrips2D(
                frame_lines.astype(np.float32), radii=np.float32(0.16 * self._grain), colors=packed_one(LOADED_WALL)
            ),
        )
        self._log_sweeps(clock, forces)

    def _log_sweeps(self, clock: Clock, forces: FrameForces) -> None:
        rows, fn, _ = visible_sweeps(forces, clock.last - clock.first, SweepChoice.LOG, SWEEP_PICTURES * 4)
        chosen = even_subset(len(rows), SWEEP_PICTURES)
        at = self._places(np.arange(len(chosen)), SWEEP_COLUMNS)
        names = [f"sweep {row + 1}" for row in rows[chosen].tolist()]
        names[-1] = "reported"
        clock.start()
        clock.log(entities.FILM_SWEEPS, self._lines(forces, fn[chosen], at, STRONG_SWEEPS), self._names(at, names))

    @property
    def _grain(self) -> float:
        return self._scene.canvas.grain_radius

    def _places(self, pictures: NDArray[np.int64], columns: int) -> Array:
        """Return the offsets of pictures (k,) from the first (k, 2) [px]."""
        canvas = self._scene.canvas
        row, column = np.divmod(pictures, columns)
        step = step_across(canvas, columns)
        beside = 0.5 * (step - canvas.width)
        return np.column_stack([beside + column * step, row * STEP_DOWN * canvas.height])

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
        radii = np.append(style.radii(force), np.full(len(outlines), 0.05 * self._grain, np.float32))
        colours = np.append(style.colours(force), np.full(len(outlines), packed_one(faint)))
        return strips(np.concatenate([lines, outlines]), radii, colours.astype(np.uint32), 20.0)

    def _outline(self, frame: int) -> Array:
        """Return walls and short joins of straight walls, or the cell, of a frame as lines (l, 2, 2) [px]."""
        walls, canvas = self._scene.walls, self._scene.canvas
        corners = self._scene.outline(frame)
        circles = [line for line, side in zip(walls.outlines(frame), walls.sides, strict=True) if side != STRAIGHT]
        if circles:
            corners = walls.endpoints[frame, walls.sides == STRAIGHT].reshape(-1, 2)
        straight = canvas.points(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1))
        if walls.cell is None and walls.count:  # walls need not follow one another around the packing
            length = np.hypot(*(straight[:, 1] - straight[:, 0]).T)
            straight = straight[(np.arange(len(straight)) % 2 == 0) | (length < LONGEST_JOIN * self._grain)]
        pieces = [canvas.points(np.stack([line[:-1], line[1:]], axis=1)) for line in circles]
        reach = np.array([[canvas.left, canvas.top], [canvas.right, canvas.bottom]])
        beside = [each[((each >= reach[0]) & (each <= reach[1])).all(axis=(1, 2))] for each in pieces]
        return np.concatenate([straight, *beside])

    def _names(self, at: Array, names: list[str]) -> rr.Points2D:
        """Return the names of pictures, placed above them."""
        canvas = self._scene.canvas
        middle = np.array([0.5 * (canvas.left + canvas.right), canvas.top - 0.12 * canvas.height])
        above = np.zeros((len(names), 2))
        if len(names) > 1 and (at == at[0]).all():  # the lines of one picture, the last one lowest
            above[:, 1] = LINE_HEIGHT * canvas.height * np.arange(1 - len(names), 1)
        return rr.Points2D(
            (middle + at + above).astype(np.float32),
            radii=np.float32(0.01),
            colors=packed(np.array([INK] * len(names), np.uint8)),
            labels=names,
            show_labels=True,
        )
