"""From measured poses to the motion that leads to a frame, taken as linear between photographs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int8
from scipy.spatial import KDTree

from solver.bodies.cell import Cell
from solver.bodies.grains import Array, GrainMotion
from solver.bodies.strain import displacement_gradient, shear_of
from solver.bodies.wall_shapes import moved_back, walls_moved
from solver.bodies.walls import Walls

NEIGHBOURS = 6  # whose motion stands in for that of a grain seen for the first time


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One frame, as measured. Rows of grains that are not present may hold any number."""

    time: float  # [s]
    position: Float[Array, "n 2"]  # [m]
    rotation: Float[Array, " n"]  # [rad]
    present: Bool[np.ndarray, " n"]
    endpoints: Float[Array, "w 2 2"]  # [m]
    sigma: float  # [m] standard deviation of a position component, error of the centre included
    side: Int8[np.ndarray, " w"] | None = None  # which walls are circles, as of Walls; None: none
    load: Float[Array, " w"] | None = None  # [N] measured on walls, NaN where none was; None: on none
    cell: Float[Array, "2 2"] | None = None  # [m] vectors of the periodic cell, in place of walls

    @property
    def walls(self) -> Walls:
        """The walls at rest, without their loads."""
        return Walls.at_rest(self.endpoints, side=self.side, cell=self.cell)


@dataclass(frozen=True, slots=True)
class LastSeen:
    """When and where each grain was last seen; NaN: never."""

    time: Float[Array, " n"]  # [s]
    position: Float[Array, "n 2"]  # [m]
    rotation: Float[Array, " n"]  # [rad]

    @classmethod
    def never(cls, grain_count: int) -> LastSeen:
        nan = np.full(grain_count, np.nan)
        return cls(nan, np.full((grain_count, 2), np.nan), nan.copy())

    def renewed(self, snapshot: Snapshot) -> LastSeen:
        here = snapshot.present
        return LastSeen(
            np.where(here, snapshot.time, self.time),
            np.where(here[:, None], snapshot.position, self.position),
            np.where(here, snapshot.rotation, self.rotation),
        )


@dataclass(frozen=True, slots=True)
class FrameMotion:
    """The motion over one interval, that ends (or, for the first frame, begins) at a frame."""

    interval: float  # [s]
    grains: GrainMotion  # at the frame
    endpoints: Float[Array, "w 2 2"]  # [m] at the frame
    wall_velocity: Float[Array, "w 2 2"]  # [m/s]
    spans: bool  # True: the interval ends here, so that earlier instants of it exist
    sigma: float  # [m]
    side: Int8[np.ndarray, " w"] | None = None  # which walls are circles; None: none
    load: Float[Array, " w"] | None = None  # [N] measured on walls at the frame, NaN: none
    cell: Cell | None = None

    @property
    def velocity_rms(self) -> float:
        """v_rms [m/s] of the present grains, not less than what noise alone makes."""
        v = self.grains.velocity[self.grains.present]
        measured = float(np.sqrt(np.mean(np.sum(v**2, axis=1)))) if len(v) else 0.0
        return max(measured, self.sigma / self.interval, 1e-30)

    def at(self, fraction: float, load: Array) -> tuple[GrainMotion, Walls]:
        """Grains and walls after a fraction of the interval; load (w,) [N] on plates, NaN elsewhere."""
        back = (1.0 - fraction) * self.interval if self.spans else 0.0
        grains = GrainMotion(
            self.grains.position - back * self.grains.velocity,
            self.grains.velocity,
            self.grains.spin,
            self.grains.present,
        )
        cell = None if self.cell is None else replace(self.cell, vectors=self.cell.vectors - back * self.cell.velocity)
        endpoints = moved_back(self.endpoints, back * self.wall_velocity, self.side)
        return grains, Walls(endpoints, self.wall_velocity, load, self.side, cell)


def motion_to(
    snapshot: Snapshot, seen: LastSeen, former_time: float, former_endpoints: Array, former_cell: Array | None = None
) -> FrameMotion:
    """The motion that leads to a snapshot from the frame before it.

    seen: of the frames before; former_time [s], former_endpoints (w, 2, 2) [m] and former_cell (2, 2) [m]: of the
    frame before. A grain that was lost in between moves with its mean velocity since it was last seen; one never seen,
    like its neighbours.
    """
    interval = snapshot.time - former_time
    if not interval > 0:
        raise ValueError(f"the time of a frame ({snapshot.time} s) is not after that of the frame before it")
    velocity, spin = _velocities(snapshot, seen)
    grains = GrainMotion(snapshot.position, velocity, spin, snapshot.present)
    wall_velocity = walls_moved(former_endpoints, snapshot.endpoints, snapshot.side) / interval
    cell = _cell_between(snapshot, former_cell, snapshot.cell, interval)
    return FrameMotion(
        interval, grains, snapshot.endpoints, wall_velocity, True, snapshot.sigma, snapshot.side, snapshot.load, cell
    )


def motion_from(snapshot: Snapshot, following: Snapshot) -> FrameMotion:
    """The motion that leads away from the first snapshot: nothing was measured before it."""
    interval = following.time - snapshot.time
    if not interval > 0:
        raise ValueError("the second frame is not after the first")
    both = snapshot.present & following.present
    seen = LastSeen.never(len(both)).renewed(snapshot)
    velocity, spin = _velocities(following, seen)
    velocity[~both], spin[~both] = 0.0, 0.0
    grains = GrainMotion(snapshot.position, velocity, spin, snapshot.present)
    way = walls_moved(snapshot.endpoints, following.endpoints, snapshot.side, at=snapshot.endpoints)
    cell = _cell_between(snapshot, snapshot.cell, following.cell, interval)
    return FrameMotion(
        interval, grains, snapshot.endpoints, way / interval, False, snapshot.sigma, snapshot.side, snapshot.load, cell
    )


def no_motion(snapshot: Snapshot) -> FrameMotion:
    """A single snapshot, at rest for a second."""
    n = len(snapshot.present)
    grains = GrainMotion(snapshot.position, np.zeros((n, 2)), np.zeros(n), snapshot.present)
    still, cell = np.zeros_like(snapshot.endpoints), None if snapshot.cell is None else Cell.at_rest(snapshot.cell)
    return FrameMotion(
        1.0, grains, snapshot.endpoints, still, False, snapshot.sigma, snapshot.side, snapshot.load, cell
    )


def shear_over(motion: FrameMotion) -> float:
    """Amount of shear of the packing over the interval [rad], from the best homogeneous motion of the grains."""
    grains = motion.grains
    gradient = displacement_gradient(grains.position, grains.velocity, grains.present) * motion.interval
    if not np.isfinite(gradient).all():
        return 0.0
    strain = 0.5 * (gradient + gradient.T)
    return shear_of(strain)


def _cell_between(snapshot: Snapshot, before: Array | None, after: Array | None, interval: float) -> Cell | None:
    """The cell of a snapshot, moving as it does from the vectors before to those after [m]."""
    if snapshot.cell is None or before is None or after is None:
        return None
    return Cell(snapshot.cell, (after - before) / interval)


def _velocities(snapshot: Snapshot, seen: LastSeen) -> tuple[Array, Array]:
    n = len(snapshot.present)
    velocity, spin = np.zeros((n, 2)), np.zeros(n)
    known = snapshot.present & np.isfinite(seen.time)
    lapse = snapshot.time - seen.time[known]
    velocity[known] = (snapshot.position[known] - seen.position[known]) / lapse[:, None]
    spin[known] = (snapshot.rotation[known] - seen.rotation[known]) / lapse
    strangers = np.flatnonzero(snapshot.present & ~known)
    if len(strangers) and known.any():
        rows = np.flatnonzero(known)
        count = min(NEIGHBOURS, len(rows))
        _, near = KDTree(snapshot.position[rows]).query(snapshot.position[strangers], k=count)
        velocity[strangers] = velocity[rows[np.reshape(near, (len(strangers), count))]].mean(axis=1)
    return velocity, spin
