"""Writes force networks one above the other, the later the nearer: frames of the run, and sweeps of a frame.

Only strong contacts are drawn, and of few frames and sweeps, so that the stacks stay small and can be seen through.
"""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.wall_shapes import STRAIGHT
from solver.sequence.frame_forces import FrameForces

from ..look import entities
from ..look.clock import Clock
from ..look.colours import FAINT, INK, LOADED_WALL, Rgba, packed, packed_one
from ..look.scene import Scene
from .network import SweepChoice, visible_sweeps

LAYERS = 8  # frames of the run, at most
SWEEP_LAYERS = 5  # sweeps of a frame, the reported field among them
STACK_HEIGHT_SHARE = 1.1  # of the packing's greater side
THICKEST = 0.30  # radius of a line at the top of the range over that of the mean grain
STRONG = 1.5  # times the mean f_n of the run: the weakest force that is drawn among frames
STRONG_SWEEPS = 2.0  # … among sweeps, which every frame has a stack of


def layer_frames(frame_count: int) -> NDArray[np.int64]:
    """The frames that have a layer, the first and the last among them."""
    return np.unique(np.round(np.linspace(0, frame_count - 1, min(frame_count, LAYERS))).astype(np.int64))


class StackWriter:
    """Logs the stacks of a run, frame by frame."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._frames = layer_frames(scene.tracks.frame_count)
        corners = np.stack([scene.outline(frame) for frame in range(scene.tracks.frame_count)]).reshape(-1, 2)
        self._height = STACK_HEIGHT_SHARE * float(np.max(np.nanmax(corners, axis=0) - np.nanmin(corners, axis=0)))

    def log(self, clock: Clock, forces: FrameForces) -> None:
        """Log one frame: its layer, static, where it has one; where it lies in the stack; the stack of its sweeps."""
        scene, frame = self._scene, clock.frame
        depth = self._depth(frame, scene.tracks.frame_count - 1)
        if frame in self._frames:
            strips, fn = self._network(forces, forces.fn[None], np.array([depth]), STRONG)
            clock.stream.log(
                f"{entities.STACK_LAYERS}/{frame}",
                self._lines(strips, fn, [self._outline(frame, depth)]),
                self._label(frame, [depth], [f"frame {frame}"]),
                static=True,
            )
        clock.start()
        clock.stream.log(
            entities.STACK_PLACE,
            rr.LineStrips3D(
                self._outline(frame, depth).astype(np.float32),
                radii=np.float32(0.12 * self._grain),
                colors=packed_one(LOADED_WALL),
            ),
        )
        self._log_sweeps(clock, forces)

    def _log_sweeps(self, clock: Clock, forces: FrameForces) -> None:
        rows, fn, _ = visible_sweeps(forces, clock.last - clock.first, SweepChoice.LOG, SWEEP_LAYERS * 4)
        chosen = np.unique(np.round(np.linspace(0, len(rows) - 1, min(len(rows), SWEEP_LAYERS))).astype(np.int64))
        depths = np.array([self._depth(layer, len(chosen) - 1) for layer in range(len(chosen))])
        strips, shown = self._network(forces, fn[chosen], depths, STRONG_SWEEPS)
        names = [f"sweep {row + 1}" for row in rows[chosen].tolist()]
        names[-1] = "reported"
        clock.start()
        clock.stream.log(
            entities.STACK_SWEEPS,
            self._lines(strips, shown, [self._outline(clock.frame, depth) for depth in depths]),
            self._label(clock.frame, depths.tolist(), names),
        )

    @property
    def _grain(self) -> float:
        return float(np.mean(self._scene.tracks.radius))

    def _depth(self, layer: int, last: int) -> float:
        """Height of a layer above the first [m]."""
        return self._height * layer / max(last, 1)

    def _network(
        self, forces: FrameForces, fn: NDArray[np.floating], depths: Array, strong: float
    ) -> tuple[Array, Array]:
        """Lines (s, 2, 3) [m] and f_n (s,) [N] of the strong contacts of fn (layers, c) at their depths (layers,)."""
        ends = self._scene.lines(forces.frame, forces.contacts)
        layer, row = np.nonzero(np.nan_to_num(fn) > strong * self._scene.style.range.mean)
        lines = np.empty((len(row), 2, 3))
        lines[..., :2] = ends[row]
        lines[..., 2] = depths[layer][:, None]
        return lines, np.asarray(fn[layer, row], np.float64)

    def _lines(self, lines: Array, fn: Array, outlines: list[Array]) -> rr.LineStrips3D:
        """Lines (s, 2, 3) [m] coloured and wide by force (s,) [N], and faint outlines of the walls (l, 2, 3) [m]."""
        style, sides = self._scene.style, sum(len(outline) for outline in outlines)
        share = np.clip(fn / style.range.top, 0.0, 1.0)
        radii = np.concatenate([THICKEST * self._grain * share, np.full(sides, 0.04 * self._grain)])
        outline: Rgba = (*FAINT[:3], 160)
        colours = np.concatenate([style.colours(fn), np.full(sides, packed_one(outline))])
        # One array of lines of two points: a list of arrays takes ten times as long.
        strips = np.concatenate([lines, *outlines]).astype(np.float32)
        return rr.LineStrips3D(strips, radii=radii.astype(np.float32), colors=colours.astype(np.uint32))

    def _outline(self, frame: int, depth: float) -> Array:
        """The walls of a frame and what joins straight ones, or the cell, as lines (l, 2, 3) [m]."""
        walls = self._scene.walls
        corners = self._scene.outline(frame)
        circles = [line for line, side in zip(walls.outlines(frame), walls.sides, strict=True) if side != STRAIGHT]
        if circles:
            corners = walls.endpoints[frame, walls.sides == STRAIGHT].reshape(-1, 2)
        ends = np.concatenate([
            np.stack([corners, np.roll(corners, -1, axis=0)], axis=1),
            *(np.stack([line[:-1], line[1:]], axis=1) for line in circles),
        ])  # fmt: skip
        return np.concatenate([ends, np.full((*ends.shape[:2], 1), depth)], axis=2)

    def _label(self, frame: int, depths: list[float], names: list[str]) -> rr.Points3D:
        """Names of layers at their lower right corners."""
        corners = self._scene.outline(frame)
        corner = corners[np.argmax(corners[:, 0] - corners[:, 1])]
        return rr.Points3D(
            np.array([[*corner, depth] for depth in depths], np.float32),
            radii=np.float32(0.02 * self._grain),
            colors=packed(np.array([INK] * len(names), np.uint8)),
            labels=names,
            show_labels=True,
        )
