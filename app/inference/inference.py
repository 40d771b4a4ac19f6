"""The one road from tracks to forces: corrected, made a packing, solved frame after frame, summed up.

Arrays in, arrays out: what keeps, shows or compares the frames takes them as they come. Whoever keeps them can go on
after the last one, bit for bit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.bodies.rods import RodMaterial
from solver.calibration.calibrate import Calibration
from solver.contacts.radius_tuning import RadiusTuning
from solver.contacts.verdicts import Verdicts
from solver.convex.friction_check import FrictionCheck
from solver.sequence.frame_forces import FrameForces
from solver.sequence.frames import solve_sequence
from solver.sequence.settings import SequenceSettings
from solver.sequence.state import SequenceState
from solver.statistics.frame_statistics import FrameStatistics, frame_statistics

from ..tracks import Tracks, WallTracks
from .calibration import calibrate_tracks
from .friction_and_radii import friction_of, tuned_radii
from .settings import InferenceSettings
from .snapshots import make_snapshots


@dataclass(frozen=True, slots=True)
class Inputs:
    """All that the forces follow from."""

    tracks: Tracks
    walls: WallTracks
    material: RodMaterial = field(default_factory=RodMaterial)
    settings: InferenceSettings = field(default_factory=InferenceSettings)
    verdicts: Mapping[int, Verdicts] = field(default_factory=dict)  # what people said of frames, by row


@dataclass(frozen=True, slots=True)
class CorrectedSequence:
    """A sequence as the solver reads it: calibrated, its radii tuned, its settings complete."""

    packing: Packing
    tracks: Tracks
    walls: WallTracks
    snapshots: Sequence[Snapshot]
    settings: SequenceSettings
    verdicts: Mapping[int, Verdicts]
    calibration: Calibration | None  # None: not tried
    tuning: RadiusTuning | None  # None: not asked for

    def check_friction(self, frames: Sequence[FrameForces]) -> FrictionCheck | None:
        """What the motion of all solved frames says of the friction that was given."""
        probability = self.settings.for_radii(self.packing.grains.radius).ensemble.probability
        return friction_of(self.packing, self.snapshots, frames, probability)


@dataclass(frozen=True, slots=True)
class SolvedFrame:
    """What is known of one frame, and what it hands to the next."""

    forces: FrameForces
    statistics: FrameStatistics
    state: SequenceState


class CoordinationError(ValueError):
    """No change of the radii gives the coordination number that was asked for."""

    def __init__(self, tuning: RadiusTuning) -> None:
        low, high = tuning.coordination_number.min(), tuning.coordination_number.max()
        super().__init__(f"cannot be met: z goes from {low:.2f} to {high:.2f} as all radii change by up to 4 %")
        self.wanted = tuning.wanted


def correct_sequence(inputs: Inputs) -> CorrectedSequence:
    """Calibrate tracks and tune radii as the settings ask for. Raises CoordinationError."""
    tracks, walls, settings = inputs.tracks, inputs.walls, inputs.settings
    overlap = settings.overlap_of(tracks.radius)
    calibration = tuning = None
    if settings.calibration is not None:
        tracks, walls, calibration = calibrate_tracks(settings.calibration, tracks, walls, overlap)
    packing = inputs.material.pack(tracks.radius, walls.pressure)
    if settings.coordination is not None:
        tuning = tuned_radii(packing, tracks, walls, settings.coordination)
        if not tuning.met:
            raise CoordinationError(tuning)
        tracks = replace(tracks, radius=tracks.radius + tuning.found)
        packing = inputs.material.pack(tracks.radius, walls.pressure)
    return CorrectedSequence(
        packing, tracks, walls, make_snapshots(tracks, walls), settings.for_overlap(overlap), inputs.verdicts,
        calibration, tuning,
    )  # fmt: skip


def solve_frames(sequence: CorrectedSequence, *, after: SolvedFrame | None = None) -> Iterator[SolvedFrame]:
    """Solve frame after frame; `after`: the last one that is solved already, None: begin with the first."""
    for forces, state in solve_sequence(
        sequence.packing,
        sequence.snapshots,
        sequence.settings,
        state=None if after is None else after.state,
        first=0 if after is None else after.forces.frame + 1,
        verdicts=sequence.verdicts,
    ):
        yield SolvedFrame(forces, _summarize(sequence, forces), state)


def infer_frames(inputs: Inputs) -> Iterator[SolvedFrame]:
    """Correct, find contacts and solve, frame after frame, as a run does. Raises CoordinationError."""
    yield from solve_frames(correct_sequence(inputs))


def _summarize(sequence: CorrectedSequence, forces: FrameForces) -> FrameStatistics:
    packing, snapshot = sequence.packing, sequence.snapshots[forces.frame]
    return frame_statistics(
        forces.contacts, forces.fn, forces.ft, forces.state,
        snapshot.position, snapshot.present, packing.walls(snapshot.endpoints), packing.length,
        grains=packing.grains, material=packing.material,
    )  # fmt: skip
