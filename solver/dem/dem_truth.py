"""Settings of a discrete-element simulation, and its result: the photographs of a packing at rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..bodies.wall_shapes import Sides

WALL_NAMES = ("bottom", "right", "top", "left")
STABLE_DAMPING = 0.14  # greatest damping ratio × time step factor: at 0.17 packings were unstable
GREATEST_OVALITY = 0.15  # contacts are computed to first order in it; errors of normals grow with its square


class UnbalancedError(ArithmeticError):
    """The simulation did not come to rest, so that its forces are not in equilibrium."""


@dataclass(frozen=True, slots=True)
class DemSettings:
    """Material, load and numerics of a simulation."""

    density: float = 2700.0  # [kg/m³]
    length: float = 0.06  # [m], of the rods
    friction: float = 0.25
    wall_friction: float = 0.25
    rolling_friction: float = 0.0  # greatest rolling moment over f_n and the rolling radius R_i R_j / (R_i + R_j)
    base_drag: float = 0.0  # [m/s²] deceleration by a base on which the rods lie, friction × gravity; 0: none
    friction_spread: float = 0.0  # contacts between grains have friction (1 ± this) times the mean, by pairs of grains
    adhesion: float = 0.0  # [N], attraction of closed contacts
    ovality: float = 0.0  # e of elliptic sections with semi-axes R (1 ± e), between flat walls
    pressure: float = 50e3  # [Pa] on the plate; NaN: the plate is held
    gravity: tuple[float, float] = (0.0, 0.0)  # [m/s²]
    normal_stiffness: float = 2e7  # [N/m]
    stiffness_ratio: float = 0.7  # tangential over normal spring
    damping_ratio: float = 0.5  # of the normal dashpot, over critical
    plate_damping: float = 0.25  # of the plate's dashpot, over the packing's wave impedance
    inertial_number: float = 1e-4  # γ̇ √(m̄ / (pressure · length)), the greatest while shearing
    time_step_factor: float = 0.25  # time step over √(least mass / normal stiffness)
    rest: float = 2e-4  # mean force residual below which a photograph is taken
    unbalance_limit: float = 1e-2  # mean force residual above which a photograph is an error
    pause_limit: int = 60_000  # greatest number of steps before a photograph
    moving: bool = False  # photographs are taken while the boundary moves, not at rest

    def __post_init__(self) -> None:
        for name in ("density", "length", "normal_stiffness", "stiffness_ratio", "inertial_number"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, not {getattr(self, name)}")
        for name in (
            "friction",
            "wall_friction",
            "rolling_friction",
            "base_drag",
            "friction_spread",
            "adhesion",
            "ovality",
            "damping_ratio",
            "plate_damping",
        ):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name} must not be negative, not {getattr(self, name)}")
        if not self.ovality <= GREATEST_OVALITY:
            raise ValueError(f"ovality must be at most {GREATEST_OVALITY}, not {self.ovality}")
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
    shear: float  # [rad]; of a periodic cell the displacement of b along a over its height
    pause: int  # steps at rest before the photograph
    cell: Array | None = None  # (2, 2) [m] vectors of the periodic cell, in place of walls


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
    ft: Array  # (c,) [N] along the normal rotated by +90°
    unbalance: Array  # (f,) mean |ΣF| of a grain / mean f_n
    shear: Array  # (f,) [rad]
    settings: DemSettings
    cell: Array | None = None  # (f, 2, 2) [m] vectors of the periodic cell, in place of walls
    side: Sides = None  # (w,) shapes of the walls; None: all straight

    @property
    def frame_count(self) -> int:
        return len(self.unbalance)

    @classmethod
    def of_frames(
        cls,
        radius: Array,
        frames: list[DemFrame],
        settings: DemSettings,
        *,
        wall_names: tuple[str, ...] = WALL_NAMES,
        side: Sides = None,
    ) -> DemTruth:
        """Collect photographs.

        Raises
        ------
        UnbalancedError
            A photograph was not at rest.
        """
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
            wall_names=wall_names if frames[0].cell is None else (),
            offset=np.concatenate([[0], np.cumsum([len(frame.i) for frame in frames])]).astype(np.int64),
            i=np.concatenate([frame.i for frame in frames]),
            j=np.concatenate([frame.j for frame in frames]),
            fn=np.concatenate([frame.fn for frame in frames]),
            ft=np.concatenate([frame.ft for frame in frames]),
            unbalance=np.array([frame.unbalance for frame in frames]),
            shear=np.array([frame.shear for frame in frames]),
            settings=settings,
            cell=None if frames[0].cell is None else np.stack([np.asarray(frame.cell) for frame in frames]),
            side=side,
        )

    def without_wall(self, name: str) -> DemTruth:
        """Return the truth without a wall.

        Raises
        ------
        ValueError
            The wall bears force.
        """
        row, n = self.wall_names.index(name), len(self.radius)
        if np.any(self.j == n + row):
            raise ValueError(f"wall {name} bears force")
        return replace(
            self,
            endpoints=np.delete(self.endpoints, row, axis=1),
            side=None if self.side is None else np.delete(self.side, row),
            wall_names=tuple(other for other in self.wall_names if other != name),
            j=np.where(self.j > n + row, self.j - 1, self.j).astype(np.int32),
        )

    def without_walls(self) -> DemTruth:
        """Return the truth without walls and contacts with walls."""
        keep = self.j < len(self.radius)
        before = np.concatenate([[0], np.cumsum(keep)])
        return replace(
            self, endpoints=self.endpoints[:, :0], wall_names=(), side=None, offset=before[self.offset],
            i=self.i[keep], j=self.j[keep], fn=self.fn[keep], ft=self.ft[keep],
        )  # fmt: skip

    def frames(self, start: int, stop: int) -> DemTruth:
        """Return the photographs start … stop − 1."""
        return self.take(np.arange(start, stop))

    def take(self, chosen: NDArray[np.int64]) -> DemTruth:
        """Return the photographs of these numbers (f,) in this order."""
        rows = np.concatenate([np.arange(int(self.offset[k]), int(self.offset[k + 1])) for k in chosen])
        count = np.diff(self.offset)[chosen]
        return replace(
            self, position=self.position[chosen], rotation=self.rotation[chosen], endpoints=self.endpoints[chosen],
            offset=np.concatenate([[0], np.cumsum(count)]), i=self.i[rows], j=self.j[rows], fn=self.fn[rows],
            ft=self.ft[rows], unbalance=self.unbalance[chosen], shear=self.shear[chosen],
            cell=None if self.cell is None else self.cell[chosen],
        )  # fmt: skip
