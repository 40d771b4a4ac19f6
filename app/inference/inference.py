"""The one road from tracks to forces: corrected, made a packing, solved frame after frame, summed up.

Arrays in, arrays out: what keeps, shows or compares the frames takes them as they come. Whoever keeps them can go on
after the last one, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from solver.bodies.bridging import bridge_frames
from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.bodies.rods import RodMaterial
from solver.boundary.boundary import Boundary
from solver.calibration.calibrate import Calibration
from solver.contacts.radius_tuning import RadiusTuning
from solver.contacts.verdicts import Verdicts
from solver.convex.friction_check import FrictionCheck, WallFriction
from solver.posterior.frame_posterior import FramePosterior
from solver.sequence.failure import describe_error, failed_frame, find_unseen
from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.sequence.frames import solve_first_again, solve_sequence
from solver.sequence.judging.doubts import doubt_friction
from solver.sequence.judging.statistic_intervals import widen_for_friction, with_deviations
from solver.sequence.settings import SequenceSettings
from solver.sequence.state import SequenceState
from solver.statistics.frame_statistics import FrameStatistics, Likely, frame_statistics, no_statistics
from solver.together import one_ahead

from ..errors import UndeterminedError
from ..progress import Observer, unheard
from ..tracks import Tracks, WallTracks
from .boundary import measure_noise, mend
from .calibration import calibrate_tracks, known_radii
from .friction_and_radii import friction_of, measure_friction, measure_friction_of_walls, tuned_radii
from .known_forces.carried_back import carry_back
from .known_forces.first_frame import ask_first_again, ask_first_in_full, expects_to_ask_again
from .known_forces.soft_errors import correct_soft
from .radii import calibrate_with_radii
from .settings import InferenceSettings
from .snapshots import make_snapshots
from .softness import find_softness
from .unseen import add_unseen


@dataclass(frozen=True, slots=True)
class Inputs:
    """All that the forces follow from."""

    tracks: Tracks
    walls: WallTracks
    material: RodMaterial = field(default_factory=RodMaterial)
    settings: InferenceSettings = field(default_factory=InferenceSettings)
    verdicts: Mapping[int, Verdicts] = field(default_factory=dict)  # what people said of frames, by row

    def with_friction(self, friction: float, check: FrictionCheck | None = None) -> Inputs:
        """The same where a friction that was to be measured is known: sequences solved again do not measure theirs.

        check: what was found with it of walls, too.
        """
        if not self.material.friction_measured:
            return self
        of_walls = self.material.wall_friction
        if of_walls is None and check is not None and np.isfinite(check.wall_measured):
            of_walls = check.wall_measured
        known = replace(self.material, friction=friction, wall_friction=of_walls, friction_measured=False)
        return replace(self, material=known)


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
    boundary: Boundary | None  # None: taken as it was told
    failed: Mapping[int, str]  # frames that show nothing, and why; their snapshots lie between their neighbours'
    wall_friction: WallFriction | None = None  # that was measured; None: told, or as between grains
    friction_measured: bool = False
    noise_told: str = ""  # where the noise that was measured contradicts the stated one

    def with_first_renewed(self) -> CorrectedSequence:
        """The same for who calls `renew_first` after the last frame: the first is solved from a brief look before."""
        again = self.settings.asks_positions and expects_to_ask_again(self)
        return replace(self, settings=replace(self.settings, first_again=again))

    def check_friction(self, frames: Sequence[FrameForces]) -> tuple[list[FrameForces], FrictionCheck | None]:
        """What the motion of all solved frames says of the friction that was given, and how far they hold after it."""
        check = self.find_friction(frames)
        return [self.doubt_friction(frame, check) for frame in frames], check

    def doubt_friction(self, frame: FrameForces, check: FrictionCheck | None) -> FrameForces:
        """The frame as it is to be believed after the check."""
        return doubt_friction(frame, check, measured=self.friction_measured)

    def restate(self, statistics: FrameStatistics, judged: FrameForces, check: FrictionCheck | None) -> FrameStatistics:
        """The statistics of a frame after the check: of another friction other contacts slide."""
        if check is None or check.agrees or judged.status is FrameStatus.FAILED:
            return statistics
        return widen_for_friction(_summarize(self, judged), check.given, check.measured)

    def find_friction(self, frames: Sequence[FrameForces]) -> FrictionCheck | None:
        """What the motion of all solved frames says of the friction that was given; they are looked at once."""
        probability = self.settings.for_radii(self.packing.grains.radius).ensemble.probability
        check = friction_of(self.packing, self.snapshots, frames, probability, self.settings.workers)
        found = self.wall_friction
        if check is not None and found is not None:
            check = replace(check, wall_measured=found.measured, wall_low=found.low, wall_high=found.high)
        return check


@dataclass(frozen=True, slots=True)
class SolvedFrame:
    """What is known of one frame, and what it hands to the next."""

    forces: FrameForces
    statistics: FrameStatistics
    state: SequenceState


class CoordinationError(UndeterminedError):
    """No change of the radii gives the coordination number that was asked for."""

    def __init__(self, tuning: RadiusTuning) -> None:
        low, high = tuning.coordination_number.min(), tuning.coordination_number.max()
        super().__init__(f"cannot be met: z goes from {low:.2f} to {high:.2f} as all radii change by up to 4 %")
        self.key = f"contacts.coordination = {tuning.wanted}"


def correct_sequence(inputs: Inputs) -> CorrectedSequence:
    """Calibrate tracks and tune radii as the settings ask for. Raises UndeterminedError."""
    tracks, walls, settings = inputs.tracks, inputs.walls, inputs.settings
    told = make_snapshots(tracks, walls)
    failed = find_unseen(told) | tracks.failed
    nothing_seen = len(failed) == tracks.frame_count
    if nothing_seen:
        settings = replace(settings, boundary=None, calibration=None, coordination=None)
    else:  # walls that no photograph shows are between those of its neighbours
        walls = replace(walls, endpoints=np.stack([each.endpoints for each in bridge_frames(told, failed)]))
    overlap, as_given = settings.overlap_of(tracks.radius), settings.calibration is None
    calibration = tuning = boundary = None
    noise_told = ""
    if settings.boundary is not None:
        if settings.sequence.measure_precision:
            tracks, noise_told = measure_noise(tracks, walls)
        tracks, walls, boundary = mend(settings.boundary, tracks, walls)
    if settings.calibration is not None:  # tracks that were corrected are hard
        told = find_softness(inputs.material, settings.sequence, tracks, walls, failed)
        # Overlaps of soft grains are forces, not errors to be explained away.
        settings = replace(settings, sequence=told, calibration=None if told.soft else settings.calibration)
    if settings.calibration is not None:
        told_motion = settings.calibration, tracks, walls, overlap, failed
        if settings.sequence.asks_positions:
            tracks, walls, calibration = calibrate_with_radii(inputs.material, *told_motion)
        else:
            tracks, walls, calibration = calibrate_tracks(*told_motion)
    if settings.infer_unseen:
        tracks = add_unseen(tracks, walls, known_radii(inputs.tracks.radius), settings.sequence.overlap_seen)
        calibration = None if calibration is None else calibration.of_grains(tracks.grain_count)
    material, inferred = inputs.material, 0 if tracks.inferred is None else int(tracks.inferred.sum())
    packing = material.pack(tracks.radius, walls.usual_pressure(material.length), inferred, tracks.boundary)
    if settings.coordination is not None:
        tuning = tuned_radii(packing, tracks, walls, settings.coordination, failed)
        if not tuning.met:
            raise CoordinationError(tuning)
        tracks = replace(tracks, radius=tracks.radius + tuning.found)
        packing = material.pack(tracks.radius, walls.usual_pressure(material.length), inferred, tracks.boundary)
    snapshots, of_walls = make_snapshots(tracks, walls), None
    if material.friction_measured and not nothing_seen:
        seen = bridge_frames(snapshots, failed)
        probability = settings.for_overlap(overlap).for_radii(tracks.radius).ensemble.probability
        material = measure_friction(material, packing, seen, probability, settings.sequence.workers)
        packing = material.pack(tracks.radius, walls.usual_pressure(material.length), inferred, tracks.boundary)
        of_walls = measure_friction_of_walls(material, packing, seen, probability, settings.sequence.workers)
        if of_walls is not None:
            material = replace(material, wall_friction=of_walls.measured)
            packing = material.pack(tracks.radius, walls.usual_pressure(material.length), inferred, tracks.boundary)
    corrected = CorrectedSequence(
        packing, tracks, walls, snapshots if nothing_seen else bridge_frames(snapshots, failed),
        settings.for_overlap(overlap), inputs.verdicts, calibration, tuning, boundary, failed, of_walls,
        inputs.material.friction_measured, noise_told,
    )  # fmt: skip
    return corrected if as_given or nothing_seen or tuning is not None else correct_soft(corrected)


def solve_frames(
    sequence: CorrectedSequence,
    *,
    after: SolvedFrame | None = None,
    observer: Observer = unheard,
    ahead: bool = False,
) -> Iterator[SolvedFrame]:
    """Solve frame after frame; `after`: the last one that is solved already, None: begin with the first.

    observer: hears what a frame could not be solved for. ahead: whether the next frame is begun while one is worked at.
    """
    solved = solve_sequence(
        sequence.packing,
        sequence.snapshots,
        sequence.settings,
        state=None if after is None else after.state,
        first=0 if after is None else after.forces.frame + 1,
        verdicts=sequence.verdicts,
        failed=sequence.failed,
        observer=partial(observer, "solving"),
        ahead=ahead,
    )
    for forces, state in one_ahead(solved, sequence.settings.workers) if ahead else solved:
        try:
            statistics = _summarize(sequence, forces)
        except MemoryError:  # not the frame's fault
            raise
        except Exception as error:
            observer("statistics", forces.frame, error)
            n, w = sequence.packing.grains.count, len(sequence.packing.pressure)
            reason = f"nothing can be made of its forces ({describe_error(error)})"
            members = sequence.settings.keep_members
            forces, statistics = failed_frame(forces.frame, reason, n, w, with_members=members), no_statistics(w)
        yield SolvedFrame(_with_noise_told(sequence, forces), statistics, state)


def renew_first(sequence: CorrectedSequence, frames: Sequence[FrameForces]) -> SolvedFrame | None:
    """The first frame as it is solved when all frames are known; None where that changes nothing.

    frames: all of them, in order. It follows from those after the first alone: asked again, it is the same bit for bit.
    """
    if not sequence.settings.asks_positions or not frames or frames[0].status is FrameStatus.FAILED:
        return None
    renewed, positions = None, ask_first_again(sequence, frames)
    if positions is not None and positions.fn.any():
        renewed = _solve_first(sequence, positions, "later photographs tell the errors of its grains' own")
    elif sequence.settings.first_again:
        positions = ask_first_in_full(sequence)
        if positions is not None and positions.fn.any():
            renewed = _solve_first(sequence, positions, "its positions were asked at length when all were known")
    if len(frames) > 1:
        carried = carry_back(sequence, frames[0] if renewed is None else renewed.forces, frames[1])
        if carried is not None:
            renewed = _solve_first(sequence, carried, "the forces of the next photograph count here, too")
    return renewed


def _solve_first(sequence: CorrectedSequence, told: FramePosterior, why: str) -> SolvedFrame:
    forces, state = solve_first_again(
        sequence.packing, sequence.snapshots, sequence.settings, told, why,
        verdicts=sequence.verdicts, failed=sequence.failed,
    )  # fmt: skip
    return SolvedFrame(_with_noise_told(sequence, forces), _summarize(sequence, forces), state)


def _with_noise_told(sequence: CorrectedSequence, forces: FrameForces) -> FrameForces:
    """The first frame says what was found out about the noise of all."""
    if forces.frame != 0 or not sequence.noise_told:
        return forces
    return replace(forces, reason=f"{sequence.noise_told}; {forces.reason}")


def solve_all(sequence: CorrectedSequence, progress: Callable[[int], None] = lambda _: None) -> list[SolvedFrame]:
    """All frames as a run states them: the first as it is seen from the others. progress hears how many are solved."""
    frames, sequence = [], sequence.with_first_renewed()
    for frame in solve_frames(sequence, ahead=True):
        frames.append(frame)
        progress(len(frames))
    first = renew_first(sequence, [each.forces for each in frames])
    return frames if first is None else [first, *frames[1:]]


def infer_frames(inputs: Inputs) -> Iterator[SolvedFrame]:
    """Correct, find contacts and solve, frame after frame, as a run does. Raises UndeterminedError."""
    yield from solve_frames(correct_sequence(inputs))


def _summarize(sequence: CorrectedSequence, forces: FrameForces) -> FrameStatistics:
    packing, snapshot = sequence.packing, sequence.snapshots[forces.frame]
    if forces.status is FrameStatus.FAILED:
        return no_statistics(len(packing.pressure))
    assert forces.bearing_probability is not None
    assert forces.sliding_probability is not None
    statistics = frame_statistics(
        forces.contacts, forces.fn, forces.ft, Likely(forces.bearing_probability, forces.sliding_probability),
        snapshot.position, snapshot.present, packing.walls_of(snapshot), packing.length,
        grains=packing.grains, material=packing.material,
    )  # fmt: skip
    return with_deviations(statistics, forces, scale_is_known=packing.scale_is_known, moved=forces.frame > 0)
