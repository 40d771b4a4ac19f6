"""A sequence as the solver reads it: calibrated tracks, the packing, and complete settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from ..results.results import Results
from ..solver.bodies.interpolation import interpolate_ignored_frames
from ..solver.bodies.motion import Snapshot
from ..solver.bodies.packing import Packing
from ..solver.boundary.boundary_correction import Boundary
from ..solver.boundary.camera_distortion import CameraDistortion
from ..solver.calibration.calibrate import Calibration
from ..solver.contacts.radius_tuning import RadiusTuning
from ..solver.contacts.verdicts import Verdicts
from ..solver.convex.friction_check import WallFriction
from ..solver.sequence.settings import SequenceSettings
from ..tracks import Tracks, WallTracks
from .snapshots import make_snapshots


@dataclass(frozen=True, slots=True)
class CorrectedSequence:
    """A sequence after all corrections, ready to be solved."""

    packing: Packing
    tracks: Tracks
    walls: WallTracks
    snapshots: Sequence[Snapshot]
    settings: SequenceSettings
    verdicts: Mapping[int, Verdicts]
    calibration: Calibration | None  # None: not tried
    tuning: RadiusTuning | None  # None: not requested
    boundary: Boundary | None  # None: used as given
    failed: Mapping[int, str]  # unusable frames with the reason; their snapshots are interpolated
    base_gravity: float  # [m/s²] onto the base
    wall_friction: WallFriction | None = None  # measured at walls; None: given, or as between rods
    friction_measured: bool = False  # whether the friction between rods was measured
    remark: str = ""  # all corrections that the first frame reports, in a phrase
    lens: CameraDistortion | None = None  # None: not sought
    jumping: bool = False  # whether poses that jump were taken out
    softness_hidden: bool = False  # whether errors may hide that grains, taken for hard, are soft

    @property
    def undisturbed(self) -> bool:
        """Whether neither a distortion of the camera nor jumping poses were found."""
        return self.lens is None and not self.jumping

    def with_tracks(self, tracks: Tracks) -> CorrectedSequence:
        """The sequence of the same rods with other positions and radii."""
        snapshots = interpolate_ignored_frames(make_snapshots(tracks, self.walls), self.failed)
        packing = replace(self.packing, grains=replace(self.packing.grains, radius=tracks.radius))
        return replace(self, tracks=tracks, packing=packing, snapshots=snapshots)

    def with_remark(self, remark: str) -> CorrectedSequence:
        """The sequence with another correction that the first frame reports."""
        return replace(self, remark="; ".join(filter(None, (self.remark, remark))))

    def unsolved_results(self) -> Results:
        """Results without any frame."""
        return Results(
            "", self.tracks, self.walls, self.packing.grains, self.packing.material.friction, (), (), "",
            calibration=self.calibration, radius_tuning=self.tuning, boundary=self.boundary, lens=self.lens,
        )  # fmt: skip
