"""Writes the bodies: walls, grain outlines, marks that show rotation, crosses over lost grains."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...solver.frame_forces import FrameForces
from ...tracks import TrackStatus, WallTracks
from ..look import entities
from ..look.clock import Clock
from ..look.colours import BOUNDARY, INFERRED, INK, LOADED_WALL, LOST, OUTLINE, SUSPECT, WALL, packed_one
from ..look.level_of_detail import is_outlined
from ..look.printable_text import printable
from ..look.scene import Scene, cell_corners
from ..look.values import dots, nullable, strips

SEAM = 0.94  # of a radius, for discs without outlines: a dark seam separates them
DISC = 0.55  # of the brightness of an outline, for a whole disc


def log_grains_and_walls(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    """Log walls and grains of one frame."""
    clock.start()
    _log_walls(clock, scene)
    _log_grains(clock, scene, forces)


def last_seen(position: Array, frame: int) -> Array:
    """Return positions (n, 2) at a frame; for a grain without one its last, or else its next position."""
    shown = position[frame].copy()
    order = [*range(frame - 1, -1, -1), *range(frame + 1, len(position))]
    for other in order:
        missing = np.isnan(shown).any(axis=1)
        if not missing.any():
            break
        shown[missing] = position[other, missing]
    return shown


def _log_walls(clock: Clock, scene: Scene) -> None:
    walls, canvas = scene.walls, scene.canvas
    if walls.cell is not None:
        _log_cell(clock, scene, walls.cell[clock.frame])
    loaded = walls.loaded
    clock.log(
        entities.WALLS,
        strips(
            [canvas.points(line).astype(np.float32) for line in walls.outlines(clock.frame)],
            np.where(loaded, 0.14, 0.09) * canvas.grain_radius,
            np.where(loaded, packed_one(LOADED_WALL), packed_one(WALL)).astype(np.uint32), 5.0,
        ),
        rr.AnyValues(
            name=[printable(name) for name in walls.name],
            drive=[_drive(walls, row, clock.frame) for row in range(walls.count)],
        ),
    )  # fmt: skip


def _log_cell(clock: Clock, scene: Scene, vectors: Array) -> None:
    corners = scene.canvas.points(cell_corners(vectors)[[0, 1, 2, 3, 0]])
    clock.log(entities.CELL, strips(corners[None], 0.05 * scene.canvas.grain_radius, WALL, 5.0))


def _drive(walls: WallTracks, row: int, frame: int) -> str:
    load = walls.load_at(frame)
    if load is not None and np.isfinite(load[row]):
        return f"{load[row]:.4g} N measured"
    return f"{1e-3 * walls.pressure[row]:g} kPa" if np.isfinite(walls.pressure[row]) else "motion imposed"


def _log_grains(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    tracks, canvas, frame = scene.tracks, scene.canvas, clock.frame
    present = tracks.present_in(frame)
    centre = canvas.points(last_seen(tracks.position, frame))
    radius = canvas.lengths(tracks.radius)
    status = tracks.status[frame]
    unbalance = np.full(tracks.grain_count, np.nan) if forces.grain_unbalance is None else forces.grain_unbalance
    plain = present & ~np.isin(status, (TrackStatus.SUSPECT, TrackStatus.INFERRED))
    line = np.where(plain, 0.02, 0.05) * canvas.grain_radius
    outlined, colours = is_outlined(tracks.grain_count), grain_colours(status, present, tracks.boundary)
    clock.log(
        entities.GRAINS,
        rr.Ellipses2D(
            centers=centre.astype(np.float32),
            half_sizes=np.repeat(radius[:, None], 2, axis=1).astype(np.float32),
            line_radii=line.astype(np.float32),
            colors=colours,
            draw_order=10.0,
        )
        if outlined
        else dots(centre, SEAM * radius, dimmed(colours), 10.0),
        rr.AnyValues(
            id=tracks.id,
            x_mm=nullable(1e3 * tracks.position[frame, :, 0]),
            y_mm=nullable(1e3 * tracks.position[frame, :, 1]),
            theta_deg=nullable(np.degrees(tracks.rotation[frame])),
            sigma_um=nullable((1e6 * tracks.sigma[frame]).astype(np.float32)),
            zncc=nullable(tracks.zncc[frame].astype(np.float32)),
            status=[TrackStatus(s).name.lower() for s in status.tolist()],
            unbalance=nullable(np.asarray(unbalance, np.float32)),
        ),
    )
    rotation = tracks.rotation[frame] - _first_rotation(tracks.rotation)
    shown = present & np.isfinite(rotation) & outlined
    marks = _spin_marks(centre[shown], radius[shown], rotation[shown])
    clock.log(entities.GRAIN_SPINS, strips(marks, 0.03 * canvas.grain_radius, INK, 11.0))
    crosses = _crosses(centre[~present], radius[~present])
    clock.log(entities.GRAINS_LOST, strips(crosses, 0.07 * canvas.grain_radius, LOST, 40.0))


def grain_colours(
    status: NDArray[np.uint8], present: NDArray[np.bool_], boundary: NDArray[np.bool_] | None = None
) -> NDArray[np.uint32]:
    """Return outline colours (n,): grey; boundary sand; suspect pose amber; inferred blue; without a pose red."""
    usual = np.full(len(status), packed_one(OUTLINE))
    if boundary is not None:
        usual[boundary] = packed_one(BOUNDARY)
    colours = np.where(status == TrackStatus.SUSPECT, packed_one(SUSPECT), usual)
    colours = np.where(status == TrackStatus.INFERRED, packed_one(INFERRED), colours)
    return np.where(present, colours, packed_one(LOST)).astype(np.uint32)


def dimmed(colours: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Darken outline colours (n,) for whole discs, on which forces must be visible."""
    parts = np.stack([(colours >> shift) & 0xFF for shift in (24, 16, 8)], axis=-1).astype(np.float64)
    red, green, blue = np.rint(DISC * parts).astype(np.uint32).T
    return (red << 24) | (green << 16) | (blue << 8) | (colours & 0xFF)


def _first_rotation(rotation: Array) -> Array:
    """Return the first known rotation of every grain (n,) [rad]."""
    known = np.isfinite(rotation)
    return rotation[np.argmax(known, axis=0), np.arange(rotation.shape[1])]


def _spin_marks(centre: Array, radius: Array, rotation: Array) -> NDArray[np.float32]:
    """Return short strokes at the rim (k, 2, 2) [px], at the top for rotation 0 [rad] (counter-clockwise)."""
    direction = np.stack([-np.sin(rotation), -np.cos(rotation)], axis=1)  # y down: up is −y, counter-clockwise is left
    reach = radius[:, None, None] * np.array([0.62, 0.92])[None, :, None]
    return (centre[:, None] + reach * direction[:, None]).astype(np.float32)


def _crosses(centre: Array, radius: Array) -> NDArray[np.float32]:
    """Return two strokes through every centre (2 k, 2, 2) [px]."""
    arms = np.array([[[-1.0, -1.0], [1.0, 1.0]], [[-1.0, 1.0], [1.0, -1.0]]]) * 0.7
    return (centre[:, None, None] + radius[:, None, None, None] * arms).reshape(-1, 2, 2).astype(np.float32)
