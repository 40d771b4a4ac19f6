"""Tracks: where every grain is in every frame, and how well that is known."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.quantity import Quantity


class TrackStatus(IntEnum):
    """How a pose was found. Stored with its names."""

    OK = 0  # correlation converged from the predicted pose
    RESCUED = 1  # found again by an exhaustive search
    ROBUST = 2  # a part of the patch was disregarded (occlusion, damage)
    SUSPECT = 3  # converged, but not to be relied on
    LOST = 4  # no pose
    OUT_OF_FRAME = 5  # its patch leaves the photograph: no pose
    GIVEN = 6  # read from a table

    @property
    def has_pose(self) -> bool:
        return self not in (TrackStatus.LOST, TrackStatus.OUT_OF_FRAME)


@dataclass(frozen=True, slots=True)
class Tracks:
    """Poses of n grains in f frames. Poses of grains without one are NaN."""

    id: Annotated[NDArray[np.int64], Quantity("name of the grain", dims="grain", essential=True, path="grains/id")]
    radius: Annotated[Array, Quantity("radius as it was used", "m", "grain", essential=True, path="grains/radius")]
    time: Annotated[Array, Quantity("time of the frame, ascending", "s", "frame", essential=True, path="frames/time")]
    position: Annotated[Array, Quantity("centre; NaN: lost", "m", "frame grain xy", essential=True)]
    rotation: Annotated[
        Array, Quantity("angle, counter-clockwise, not wrapped; NaN: lost", "rad", "frame grain", essential=True)
    ]
    sigma: Annotated[Array, Quantity("standard deviation of a position component", "m", "frame grain")]
    zncc: Annotated[Array, Quantity("correlation with the reference patch, NaN: unknown", dims="frame grain")]
    status: Annotated[
        NDArray[np.uint8],
        Quantity("how the pose was found", dims="frame grain", absent=TrackStatus.GIVEN, names=TrackStatus),
    ]
    centre_sigma: Annotated[Array | None, Quantity("standard deviation of a centre's constant error", "m", "grain")] = (
        None
    )
    second_zncc: Annotated[
        Array | None, Quantity("correlation of the best other place, NaN: not searched", dims="frame grain")
    ] = None
    reference_frame: Annotated[
        NDArray[np.int32] | None, Quantity("photograph it is compared with", dims="frame grain")
    ] = None

    def __post_init__(self) -> None:
        f, n = len(self.time), len(self.id)
        if self.position.shape != (f, n, 2):
            raise ValueError(f"position must be ({f}, {n}, 2), not {self.position.shape}")
        for name in ("rotation", "sigma", "zncc", "status"):
            if getattr(self, name).shape != (f, n):
                raise ValueError(f"{name} must be ({f}, {n}), not {getattr(self, name).shape}")
        for name in ("second_zncc", "reference_frame"):
            value = getattr(self, name)
            if value is not None and value.shape != (f, n):
                raise ValueError(f"{name} must be ({f}, {n}), not {value.shape}")
        if self.radius.shape != (n,):
            raise ValueError(f"radius must be ({n},), not {self.radius.shape}")

    @property
    def frame_count(self) -> int:
        return len(self.time)

    @property
    def grain_count(self) -> int:
        return len(self.id)

    @property
    def position_sigma(self) -> Array:
        """Standard deviation of a position component with the centre's own error, rms over present grains (f,) [m]."""
        fixed = 0.0 if self.centre_sigma is None else float(np.mean(self.centre_sigma**2))
        variance = np.where(self.present, self.sigma**2, 0.0).sum(axis=1)
        return np.sqrt(variance / np.maximum(self.present.sum(axis=1), 1) + fixed)

    @property
    def renewal_count(self) -> int:
        """How many grains are compared with a later photograph than the first by the last frame, being damaged."""
        if self.reference_frame is None:
            return 0
        return int((self.reference_frame > 0).any(axis=0).sum())

    @property
    def present(self) -> NDArray[np.bool_]:
        """Which grains have a pose (f, n)."""
        return np.isfinite(self.rotation) & np.isfinite(self.position).all(axis=2)

    def frames(self, start: int, stop: int, step: int = 1) -> Tracks:
        """Every step-th of the frames start … stop − 1 alone."""
        part = slice(start, stop, step)
        return Tracks(
            self.id, self.radius, self.time[part], self.position[part], self.rotation[part],
            self.sigma[part], self.zncc[part], self.status[part], self.centre_sigma,
            None if self.second_zncc is None else self.second_zncc[part],
            None if self.reference_frame is None else self.reference_frame[part],
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class WallTracks:
    """The walls of f frames, with the pressure that some of them carry."""

    name: Annotated[tuple[str, ...], Quantity("name of the wall", dims="wall", essential=True)]
    endpoints: Annotated[
        Array, Quantity("ends; packing to the left of 0 → 1", "m", "frame wall end xy", essential=True)
    ]
    pressure: Annotated[
        Array, Quantity("pressure on the wall, NaN where its motion is imposed", "Pa", "wall", essential=True)
    ]
    force: Annotated[
        Array | None, Quantity("recorded force of the packing on the wall, NaN: none", "N", "frame wall xy")
    ] = None
    # (f, w) [m] standard deviation of a followed wall's endpoint along its normal, against frame 0, rms over its two
    # endpoints; NaN in frames where a table gives the wall, None where tables give all
    sigma: Annotated[
        Array | None, Quantity("standard deviation of an end along the normal; NaN: given", "m", "frame wall")
    ] = None

    @property
    def count(self) -> int:
        return len(self.name)

    def frames(self, start: int, stop: int, step: int = 1) -> WallTracks:
        """Every step-th of the frames start … stop − 1 alone."""
        part = slice(start, stop, step)
        force = None if self.force is None else self.force[part]
        sigma = None if self.sigma is None else self.sigma[part]
        return WallTracks(self.name, self.endpoints[part], self.pressure, force, sigma)
