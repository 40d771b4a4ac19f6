"""What a discrete-element simulation is given, and the truth that it gives: photographs of a packing at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

WALL_NAMES = ("bottom", "right", "top", "left")
STABLE_DAMPING = 0.14  # greatest damping ratio × time step factor: at 0.17 packings were seen to shake themselves


class UnbalancedError(ArithmeticError):
    """The simulation did not come to rest: its forces are no truth."""


@dataclass(frozen=True, slots=True)
class DemSettings:
    """Material, load and numerics of a simulation."""

    density: float = 2700.0  # [kg/m³]
    length: float = 0.06  # [m], of the rods
    friction: float = 0.25
    wall_friction: float = 0.25
    pressure: float = 50e3  # [Pa] on the plate; NaN: the plate is held
    gravity: tuple[float, float] = (0.0, 0.0)  # [m/s²]
    normal_stiffness: float = 2e7  # [N/m]
    stiffness_ratio: float = 0.7  # tangential over normal spring
    damping_ratio: float = 0.5  # of the normal dashpot, over critical
    plate_damping: float = 0.25  # of the plate's dashpot, over the packing's wave impedance
    inertial_number: float = 1e-4  # γ̇ √(m̄ / (pressure · length)), the greatest while shearing
    time_step_factor: float = 0.25  # time step over √(least mass / normal stiffness)
    rest: float = 2e-4  # a photograph waits until the mean unbalance is below this
    unbalance_limit: float = 1e-2  # … and is refused above this
    pause_limit: int = 60_000  # steps that a photograph may wait

    def __post_init__(self) -> None:
        for name in ("density", "length", "normal_stiffness", "stiffness_ratio", "inertial_number"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, not {getattr(self, name)}")
        for name in ("friction", "wall_friction", "damping_ratio", "plate_damping"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name} must not be negative, not {getattr(self, name)}")
        if not 0.0 < self.time_step_factor <= 0.4:
            raise ValueError(f"time_step_factor must be in (0, 0.4], not {self.time_step_factor}")
        if self.damping_ratio * self.time_step_factor > STABLE_DAMPING:
            raise ValueError("the dashpots are too strong for this time step: the simulation would not be stable")


@dataclass(frozen=True, slots=True)
class DemFrame:
    """The packing at one photograph, at rest."""

    position: Array  # (n, 2) [m]
    rotation: Array  # (n,) [rad], continuous
    endpoints: Array  # (w, 2, 2) [m], the packing lies to the left of 1 → 2
    i: NDArray[np.int32]  # (c,) ascending in (i, j), closed contacts only
    j: NDArray[np.int32]  # (c,) grain (j > i), or n + wall
    fn: Array  # (c,) [N]
    ft: Array  # (c,) [N]
    unbalance: float  # mean |ΣF| of a grain / mean f_n
    plate_unbalance: float  # |force on the plate − load| / load
    shear: float  # [rad]
    pause: int  # steps that the frame stood still before the photograph


@dataclass(frozen=True, slots=True)
class DemTruth:
    """All photographs of one simulation; contact rows of frame k are offset[k] : offset[k+1]."""

    radius: Array  # (n,) [m]
    position: Array  # (f, n, 2) [m]
    rotation: Array  # (f, n) [rad], continuous
    endpoints: Array  # (f, w, 2, 2) [m], in the order of wall_names
    wall_names: tuple[str, ...]  # (w,)
    offset: NDArray[np.int64]  # (f+1,)
    i: NDArray[np.int32]  # (c,) row of a grain
    j: NDArray[np.int32]  # (c,) row of a grain, j > i, or n + row of a wall
    fn: Array  # (c,) [N] that i exerts on j, compression positive
    ft: Array  # (c,) [N] along the normal turned by +90°
    unbalance: Array  # (f,) mean |ΣF| of a grain / mean f_n
    shear: Array  # (f,) [rad]
    settings: DemSettings

    @property
    def frame_count(self) -> int:
        return len(self.unbalance)

    @classmethod
    def of_frames(cls, radius: Array, frames: list[DemFrame], settings: DemSettings) -> DemTruth:
        """Collect photographs; raise UnbalancedError if one of them was not at rest."""
        for k, frame in enumerate(frames):
            if not max(frame.unbalance, frame.plate_unbalance) <= settings.unbalance_limit:
                raise UnbalancedError(
                    f"photograph {k}: the mean unbalance is {frame.unbalance:.2g} of the mean force on the grains, "
                    f"{frame.plate_unbalance:.2g} of the load on the plate; the limit is {settings.unbalance_limit:.2g}"
                )
        return cls(
            radius=radius,
            position=np.stack([frame.position for frame in frames]),
            rotation=np.stack([frame.rotation for frame in frames]),
            endpoints=np.stack([frame.endpoints for frame in frames]),
            wall_names=WALL_NAMES,
            offset=np.concatenate([[0], np.cumsum([len(frame.i) for frame in frames])]).astype(np.int64),
            i=np.concatenate([frame.i for frame in frames]),
            j=np.concatenate([frame.j for frame in frames]),
            fn=np.concatenate([frame.fn for frame in frames]),
            ft=np.concatenate([frame.ft for frame in frames]),
            unbalance=np.array([frame.unbalance for frame in frames]),
            shear=np.array([frame.shear for frame in frames]),
            settings=settings,
        )

    def frames(self, start: int, stop: int) -> DemTruth:
        """The photographs start … stop − 1 alone."""
        part, rows = slice(start, stop), slice(int(self.offset[start]), int(self.offset[stop]))
        return DemTruth(
            self.radius, self.position[part], self.rotation[part], self.endpoints[part], self.wall_names,
            self.offset[start : stop + 1] - self.offset[start],
            self.i[rows], self.j[rows], self.fn[rows], self.ft[rows],
            self.unbalance[part], self.shear[part], self.settings,
        )  # fmt: skip
