"""From measured poses to the motion that leads to a frame, taken as linear between photographs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray
from scipy.spatial import KDTree

from solver.bodies.grains import Array, GrainMotion
from solver.bodies.walls import Walls

NEIGHBOURS = 6  # whose motion stands in for that of a grain seen for the first time


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One frame, as measured. Rows of grains that are not present may hold any number."""

    time: float  # [s]
    position: Float[Array, "n 2"]  # [m]
    rotation: Float[Array, " n"]  # [rad]
    present: Bool[NDArray[np.bool_], " n"]
    endpoints: Float[Array, "w 2 2"]  # [m]
    sigma: float  # [m] standard deviation of a position component, error of the centre included


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
        return grains, Walls(self.endpoints - back * self.wall_velocity, self.wall_velocity, load)


def motion_to(snapshot: Snapshot, seen: LastSeen, former_time: float, former_endpoints: Array) -> FrameMotion:
    """The motion that leads to a snapshot from the frame before it.

    seen: of the frames before; former_time [s], former_endpoints (w, 2, 2) [m]: of the frame before. A grain that
    was lost in between moves with its mean velocity since it was last seen; one never seen, like its neighbours.
    """
    interval = snapshot.time - former_time
    if not interval > 0:
        raise ValueError(f"the time of a frame ({snapshot.time} s) is not after that of the frame before it")
    velocity, spin = _velocities(snapshot, seen)
    grains = GrainMotion(snapshot.position, velocity, spin, snapshot.present)
    wall_velocity = (snapshot.endpoints - former_endpoints) / interval
    return FrameMotion(interval, grains, snapshot.endpoints, wall_velocity, True, snapshot.sigma)


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
    wall_velocity = (following.endpoints - snapshot.endpoints) / interval
    return FrameMotion(interval, grains, snapshot.endpoints, wall_velocity, False, snapshot.sigma)


def no_motion(snapshot: Snapshot) -> FrameMotion:
    """A single snapshot, at rest for a second."""
    n = len(snapshot.present)
    grains = GrainMotion(snapshot.position, np.zeros((n, 2)), np.zeros(n), snapshot.present)
    return FrameMotion(1.0, grains, snapshot.endpoints, np.zeros_like(snapshot.endpoints), False, snapshot.sigma)


def shear_over(motion: FrameMotion) -> float:
    """Amount of shear of the packing over the interval [rad], from the best homogeneous motion of the grains."""
    here = motion.grains.present
    if here.sum() < 4:
        return 0.0
    x = motion.grains.position[here]
    design = np.column_stack([x - x.mean(axis=0), np.ones(len(x))])
    gradient = np.linalg.lstsq(design, motion.grains.velocity[here], rcond=None)[0][:2].T * motion.interval
    strain = 0.5 * (gradient + gradient.T)
    low, high = np.linalg.eigvalsh(strain)
    return float(high - low)


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
