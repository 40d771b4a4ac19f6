"""Motion over the interval of a frame, from measured positions; linear in time between photographs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int8, Int32

from .cell import Cell
from .grains import Array, GrainMotion
from .strain import RigidMotion, displacement_gradient, find_dominant_rigid_motion, shear_strain
from .wall_shapes import wall_displacement, walls_before
from .walls import Walls

NEIGHBOURS = 6  # number of neighbours whose mean velocity is that of a grain seen for the first time


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One frame as measured. Rows of absent grains may hold any number."""

    time: float  # [s]
    position: Float[Array, "n 2"]  # [m]
    rotation: Float[Array, " n"]  # [rad]
    present: Bool[np.ndarray, " n"]
    endpoints: Float[Array, "w 2 2"]  # [m]
    sigma: float  # [m] standard deviation of a position component, error of the centre included
    side: Int8[np.ndarray, " w"] | None = None  # shapes of the walls, as in Walls; None: all straight
    load: Float[Array, " w"] | None = None  # [N] measured loads of walls, NaN: not measured; None: none measured
    cell: Float[Array, "2 2"] | None = None  # [m] vectors of the periodic cell, in place of walls
    plate: Int32[np.ndarray, " w"] | None = None  # loaded wall that each is fixed to, as in Walls; None: none is fixed
    fringes: Float[Array, " n"] | None = None  # squared brightness gradient of photoelastic discs, NaN: not read

    @property
    def walls(self) -> Walls:
        """The walls at rest, without loads."""
        return Walls.at_rest(self.endpoints, side=self.side, cell=self.cell)


@dataclass(frozen=True, slots=True)
class LastSeen:
    """Time, position and rotation of every grain when it was last seen; NaN: never."""

    time: Float[Array, " n"]  # [s]
    position: Float[Array, "n 2"]  # [m]
    rotation: Float[Array, " n"]  # [rad]

    @classmethod
    def never(cls, grain_count: int) -> LastSeen:
        nan = np.full(grain_count, np.nan)
        return cls(nan, np.full((grain_count, 2), np.nan), nan.copy())

    def updated(self, snapshot: Snapshot) -> LastSeen:
        here = snapshot.present
        return LastSeen(
            np.where(here, snapshot.time, self.time),
            np.where(here[:, None], snapshot.position, self.position),
            np.where(here, snapshot.rotation, self.rotation),
        )

    def moved(self, motion: RigidMotion, now: float, interval: float) -> LastSeen:
        """The same with all grains moved as one body, once for every interval [s] since they were seen."""
        position, rotation = self.position.copy(), self.rotation.copy()
        times = np.nan_to_num(np.round((now - self.time) / interval))
        for each in range(int(times.max(initial=0.0))):
            again = times > each
            position[again], rotation[again] = motion.moved(position[again]), rotation[again] + motion.angle
        return LastSeen(self.time, position, rotation)


@dataclass(frozen=True, slots=True)
class FrameMotion:
    """The motion over the interval that ends at a frame; for the first frame, that begins there."""

    interval: float  # [s]
    grains: GrainMotion  # at the frame
    endpoints: Float[Array, "w 2 2"]  # [m] at the frame
    wall_velocity: Float[Array, "w 2 2"]  # [m/s]
    ends_here: bool  # True: the interval ends at the frame, so that earlier instants of it exist
    sigma: float  # [m]
    side: Int8[np.ndarray, " w"] | None = None  # shapes of the walls; None: all straight
    load: Float[Array, " w"] | None = None  # [N] measured loads of walls at the frame, NaN: not measured
    cell: Cell | None = None
    plate: Int32[np.ndarray, " w"] | None = None  # loaded wall that each is fixed to; None: none is fixed

    @property
    def velocity_rms(self) -> float:
        """v_rms [m/s] of the present grains, at least that of the noise, σ / interval."""
        v = self.grains.velocity[self.grains.present]
        measured = float(np.sqrt(np.mean(np.sum(v**2, axis=1)))) if len(v) else 0.0
        return max(measured, self.sigma / self.interval, 1e-30)

    def at(self, fraction: float, load: Array) -> tuple[GrainMotion, Walls]:
        """Return grains and walls after a fraction of the interval; load (w,) [N] of plates, NaN of driven walls."""
        back = (1.0 - fraction) * self.interval if self.ends_here else 0.0
        grains = GrainMotion(
            self.grains.position - back * self.grains.velocity,
            self.grains.velocity,
            self.grains.spin,
            self.grains.present,
        )
        cell = None if self.cell is None else replace(self.cell, vectors=self.cell.vectors - back * self.cell.velocity)
        endpoints = walls_before(self.endpoints, back * self.wall_velocity, self.side)
        return grains, Walls(endpoints, self.wall_velocity, load, self.side, cell, self.plate)


def motion_to(
    snapshot: Snapshot, seen: LastSeen, former_time: float, former_endpoints: Array, former_cell: Array | None = None
) -> FrameMotion:
    """Return the motion from the frame before to a snapshot.

    Parameters
    ----------
    snapshot
        The frame at which the interval ends.
    seen
        Last observation of every grain before this frame. A grain lost in between has its mean velocity since then;
        a grain seen for the first time has the mean velocity of its neighbours.
    former_time
        Time of the frame before [s].
    former_endpoints : (w, 2, 2)
        Walls of the frame before [m].
    former_cell : (2, 2), optional
        Cell vectors of the frame before [m].

    Returns
    -------
    FrameMotion
        Without the motion that the packing makes as one rigid body, where that exceeds the rest by far.

    Raises
    ------
    ValueError
        The time of the frame does not exceed that of the frame before.
    """
    interval = snapshot.time - former_time
    if not interval > 0:
        raise ValueError(f"the time of a frame ({snapshot.time} s) is not after that of the frame before it")
    before = snapshot.present & (seen.time == former_time)
    rigid = None if former_cell is not None else find_dominant_rigid_motion(seen.position, snapshot.position, before)
    if rigid is not None:
        seen, former_endpoints = seen.moved(rigid, snapshot.time, interval), rigid.moved(former_endpoints)
    velocity, spin = _velocities(snapshot, seen)
    grains = GrainMotion(snapshot.position, velocity, spin, snapshot.present)
    wall_velocity = wall_displacement(former_endpoints, snapshot.endpoints, snapshot.side) / interval
    cell = _cell_between(snapshot, former_cell, snapshot.cell, interval)
    return FrameMotion(
        interval, grains, snapshot.endpoints, wall_velocity, True, snapshot.sigma, snapshot.side, snapshot.load, cell,
        snapshot.plate,
    )  # fmt: skip


def motion_from(snapshot: Snapshot, following: Snapshot) -> FrameMotion:
    """Return the motion from the first snapshot to the following one, taken at the first; see `motion_to`."""
    interval = following.time - snapshot.time
    if not interval > 0:
        raise ValueError(f"the time of the second frame ({following.time} s) is not after that of the first")
    both = snapshot.present & following.present
    rigid = (
        None if snapshot.cell is not None else find_dominant_rigid_motion(following.position, snapshot.position, both)
    )
    if rigid is not None:
        following = replace(
            following, position=rigid.moved(following.position), rotation=following.rotation + rigid.angle,
            endpoints=rigid.moved(following.endpoints),
        )  # fmt: skip
    seen = LastSeen.never(len(both)).updated(snapshot)
    velocity, spin = _velocities(following, seen)
    velocity[~both], spin[~both] = 0.0, 0.0
    grains = GrainMotion(snapshot.position, velocity, spin, snapshot.present)
    displacement = wall_displacement(snapshot.endpoints, following.endpoints, snapshot.side, at=snapshot.endpoints)
    cell = _cell_between(snapshot, snapshot.cell, following.cell, interval)
    return FrameMotion(
        interval,
        grains,
        snapshot.endpoints,
        displacement / interval,
        False,
        snapshot.sigma,
        snapshot.side,
        snapshot.load,
        cell,
        snapshot.plate,
    )


def no_motion(snapshot: Snapshot) -> FrameMotion:
    """Return a single snapshot at rest, over an interval of 1 s."""
    n = len(snapshot.present)
    grains = GrainMotion(snapshot.position, np.zeros((n, 2)), np.zeros(n), snapshot.present)
    at_rest, cell = np.zeros_like(snapshot.endpoints), None if snapshot.cell is None else Cell.at_rest(snapshot.cell)
    return FrameMotion(
        1.0, grains, snapshot.endpoints, at_rest, False, snapshot.sigma, snapshot.side, snapshot.load, cell,
        snapshot.plate,
    )  # fmt: skip


def shear_over(motion: FrameMotion) -> float:
    """Return the shear strain of the packing over the interval [rad], of the homogeneous motion that fits best."""
    grains = motion.grains
    gradient = displacement_gradient(grains.position, grains.velocity, grains.present) * motion.interval
    if not np.isfinite(gradient).all():
        return 0.0
    strain = 0.5 * (gradient + gradient.T)
    return shear_strain(strain)


def _cell_between(snapshot: Snapshot, before: Array | None, after: Array | None, interval: float) -> Cell | None:
    """Return the cell of a snapshot with its rate between the vectors before and after [m]."""
    if snapshot.cell is None or before is None or after is None:
        return None
    return Cell(snapshot.cell, (after - before) / interval)


def _velocities(snapshot: Snapshot, seen: LastSeen) -> tuple[Array, Array]:
    """Return mean velocities (n, 2) [m/s] and spins (n,) [rad/s] since each grain was last seen."""
    n = len(snapshot.present)
    velocity, spin = np.zeros((n, 2)), np.zeros(n)
    known = snapshot.present & np.isfinite(seen.time)
    elapsed = snapshot.time - seen.time[known]
    velocity[known] = (snapshot.position[known] - seen.position[known]) / elapsed[:, None]
    spin[known] = (snapshot.rotation[known] - seen.rotation[known]) / elapsed
    new = np.flatnonzero(snapshot.present & ~known)
    if len(new) and known.any():
        rows = np.flatnonzero(known)
        count = min(NEIGHBOURS, len(rows))
        from scipy.spatial import KDTree  # materials are read before

        _, near = KDTree(snapshot.position[rows]).query(snapshot.position[new], k=count)
        velocity[new] = velocity[rows[np.reshape(near, (len(new), count))]].mean(axis=1)
    return velocity, spin
