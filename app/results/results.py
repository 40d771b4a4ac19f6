"""The results of one run in memory, for storing, recording, scoring and export."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ..solver.assessment.fringe_pressures import FringePressures
from ..solver.assessment.intervals.wall_sensors import compare_wall_forces
from ..solver.bodies.grains import Array, Grains, move_freely
from ..solver.bodies.wall_shapes import STRAIGHT, outward_normals
from ..solver.boundary.boundary_correction import Boundary
from ..solver.boundary.camera_distortion import CameraDistortion
from ..solver.calibration.calibrate import Calibration
from ..solver.contacts.pairs import Keys, make_keys
from ..solver.contacts.radius_tuning import RadiusTuning
from ..solver.convex.friction_check import FrictionCheck
from ..solver.frame_forces import FrameForces
from ..solver.kinematics.sequence_kinematics import SequenceKinematics
from ..solver.statistics.frame_statistics import FrameStatistics
from ..tracks import Tracks, WallTracks
from .finding import Finding


@dataclass(frozen=True, slots=True)
class TruthContacts:
    """True (or manually judged) contact forces, sorted by frame. j >= number of grains is a wall."""

    frame: NDArray[np.int64]  # (t,)
    i: NDArray[np.int64]  # (t,) row of a grain
    j: NDArray[np.int64]  # (t,) row of a grain, j > i, or grain count + row of a wall
    fn: Array  # (t,) [N]
    ft: Array  # (t,) [N]

    def outside(self, boundary: NDArray[np.bool_] | None) -> TruthContacts:
        """Return the contacts of free grains.

        Those of grains of the boundary (mask (n,), None: no such grains) with one another and with walls are left out:
        nothing shows their forces.
        """
        if boundary is None:
            return self
        keep = move_freely(boundary, self.i, self.j)
        return TruthContacts(self.frame[keep], self.i[keep], self.j[keep], self.fn[keep], self.ft[keep])

    def by_frame(self, bodies: int, frame_count: int) -> tuple[tuple[Keys, Array], ...]:
        """Return the pairs' keys (c,) and forces (c, 2) [N] of every frame; bodies: number of grains and walls."""
        key, force = make_keys(self.i, self.j, bodies), np.column_stack([self.fn, self.ft])
        bounds = np.searchsorted(self.frame, np.arange(frame_count + 1))
        return tuple((key[a:b], force[a:b]) for a, b in pairwise(bounds))


@runtime_checkable
class ReadsFrames(Protocol):
    """Reads kinematics of some frames without those of all others."""

    def of_frames(self, frames: slice) -> SequenceKinematics | None: ...


def _none() -> None:
    """No kinematics."""


@dataclass(frozen=True, slots=True)
class Results:
    """All results of one run."""

    name: str
    tracks: Tracks
    walls: WallTracks
    grains: Grains
    friction: float
    frames: Sequence[FrameForces]  # one per frame
    statistics: Sequence[FrameStatistics]  # one per frame
    configuration: str  # the resolved configuration, TOML
    calibration: Calibration | None = None  # None: not attempted
    friction_check: FrictionCheck | None = None
    radius_tuning: RadiusTuning | None = None  # None: not requested
    boundary: Boundary | None = None  # None: used as given
    lens: CameraDistortion | None = None  # None: not sought
    fringes: FringePressures | None = None  # None: no photoelastic photographs
    base_friction: float = 0.0  # coefficient of the base that was used; 0: none
    read_kinematics: Callable[[], SequenceKinematics | None] = _none  # on every access: it is as long as the tracks
    diagnosis: tuple[Finding, ...] = ()  # causes of wrong forces that the evidence supports
    ensemble_size: int = 0  # resampled sequences behind the standard deviations of the forces; 0: free formula

    @property
    def kinematics(self) -> SequenceKinematics | None:
        """Motion beyond the mean field; None: fewer than two frames, or not all are there. A file is read each time."""
        return self.read_kinematics()

    def kinematics_of(self, frames: slice) -> SequenceKinematics | None:
        """Kinematics with the maps of some frames; of a file, only these are read."""
        if isinstance(self.read_kinematics, ReadsFrames):
            return self.read_kinematics.of_frames(frames)
        whole = self.kinematics
        return None if whole is None else whole.of_frames(frames)

    @property
    def weight(self) -> Array:
        """Weight of every grain (n, 2) [N], from `material.gravity` of the configuration."""
        return grain_weight(self.grains, self.configuration)

    @property
    def force_unit(self) -> str:
        """Unit of the forces, see `WallTracks.force_unit`."""
        return self.walls.force_unit(self.weight)

    def contact_friction(self, frame: int) -> Array:
        """Coefficient of friction used at every contact of a frame (c,); files of earlier versions hold one for all."""
        forces = self.frames[frame]
        given = np.full(forces.contacts.count, np.nan) if forces.friction is None else forces.friction
        return np.where(np.isfinite(given), given, self.friction)

    def wall_force_ratio(self) -> Array:
        """Inferred over recorded normal forces on walls (w,), from the second frame on; NaN without a sensor."""
        if self.walls.force is None or len(self.statistics) < 2:
            return np.full(self.walls.count, np.nan)
        recorded = np.where((self.walls.sides == STRAIGHT)[:, None], self.walls.force, np.nan)
        inferred = np.stack([each.wall_force for each in self.statistics])
        return compare_wall_forces(inferred[1:], recorded[1:], outward_normals(self.walls.endpoints[1:]))


def grain_weight(grains: Grains, configuration: str) -> Array:
    """Return the weight of every grain (n, 2) [N], from `material.gravity` of a configuration; zero if not set."""
    gravity = setting(configuration, "material", "gravity")
    x, y = gravity if isinstance(gravity, list) else (0.0, 0.0)
    return grains.weight((float(x), float(y)))


def setting(configuration: str, section: str, key: str) -> Any:
    """Return one value of a configuration in TOML; None if it is not set or the text is not TOML."""
    try:
        part = tomllib.loads(configuration).get(section)
    except tomllib.TOMLDecodeError:
        return None
    return part.get(key) if isinstance(part, dict) else None
