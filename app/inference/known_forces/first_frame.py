"""The first frame once more, when the frames after it are known.

No motion leads to it: its forces rest on positions, where constant errors of centres and radii count most. The forces
of later frames, which motion tells, tell these errors apart from overlap better than any calibration beforehand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from solver.calibration.calibrate import Calibration
from solver.calibration.equations import rotate_offsets
from solver.calibration.known_forces import find_grain_errors
from solver.contacts.verdicts import NO_VERDICTS
from solver.mixture.positions import Positions, draws_of
from solver.posterior.frame_posterior import FramePosterior, infer_frame
from solver.posterior.sequence_evidence import SequenceEvidence
from solver.sequence.frame_forces import FrameForces, FrameStatus

from ...tracks import Tracks, WallTracks
from ..snapshots import measure_sequence
from .known_pairs import gather_evidence_of, known_pairs, rows_of, without_errors

if TYPE_CHECKING:
    from ..inference import CorrectedSequence

FRAMES = 16  # after the first that tell of the errors: later, other contacts bear
FEWEST = 2  # below which nothing is asked again
WORTH = 0.5  # scatter of errors over the noise of a position below which there is nothing to gain
SEED = 1  # of the draws behind the deviations that are left
UNSOUND = (FrameStatus.FAILED, FrameStatus.SUSPECT)


def expects_to_ask_again(sequence: CorrectedSequence) -> bool:
    """Whether later frames will probably tell more of the first one's positions than it does by itself."""
    calibration, failed = sequence.calibration, sequence.failed
    if calibration is None or not calibration.applied or 0 in failed:
        return False
    return sequence.tracks.frame_count - len(failed) > FEWEST


def ask_first_in_full(sequence: CorrectedSequence) -> FramePosterior | None:
    """What the positions of the first frame say by themselves; None where no two bodies are near."""
    settings = sequence.settings
    positions = Positions(sequence.packing, sequence.snapshots, settings.posterior, settings.workers)
    return positions.at(0, sequence.verdicts.get(0, NO_VERDICTS))


def ask_first_again(sequence: CorrectedSequence, frames: Sequence[FrameForces]) -> FramePosterior | None:
    """What the positions of the first frame say of its forces, once those of the others are known.

    None where that is no better: where calibration had nothing of each grain's own to correct, or too little is known.
    """
    calibration = sequence.calibration
    if calibration is None or 0 in sequence.failed:
        return None
    rows, force = known_pairs([each for each in frames[1 : FRAMES + 1] if each.status not in UNSOUND])
    if len(np.unique(rows.frame)) < FEWEST:
        return None
    told, walls = _as_told(sequence.tracks, sequence.walls, calibration), sequence.walls
    evidence = gather_evidence_of(sequence, told)
    centre, radius = _errors_beforehand(evidence)
    if centre == radius == 0.0:
        return None
    measured = measure_sequence(told, walls)
    found = find_grain_errors(
        measured, rows, force, centre=centre, radius=radius, rng=np.random.default_rng(SEED)
    )  # fmt: skip
    evidence = gather_evidence_of(sequence, without_errors(told, measured, found))
    first = evidence.of_frame(0, verdicts=sequence.verdicts.get(0, NO_VERDICTS))
    if first.contacts.count == 0:
        return None
    first = replace(first, gap_deviation=found.gap_deviation(measured, rows_of(0, first.contacts)))
    return infer_frame(first, evidence.settings.alone(), draws_of(0), sequence.settings.workers)


def _as_told(tracks: Tracks, walls: WallTracks, calibration: Calibration) -> Tracks:
    """Every grain with its own errors again; what all share stays corrected."""
    own = rotate_offsets(measure_sequence(tracks, walls), calibration.offset)
    return replace(
        tracks,
        radius=tracks.radius - (calibration.radius - calibration.radius_offset),
        position=tracks.position - own,
    )


def _errors_beforehand(evidence: SequenceEvidence) -> tuple[float, float]:
    """Standard deviations [m] of errors of centres and of radii, 0: too small to be told from noise."""
    noise, worth = evidence.noise.sigma, WORTH * evidence.noise.sigma
    centre = float(np.sqrt(max(float(np.median(evidence.centre_deviation)) ** 2 - noise**2, 0.0)))
    return centre if centre > worth else 0.0, evidence.radius_deviation if evidence.radius_deviation > worth else 0.0
