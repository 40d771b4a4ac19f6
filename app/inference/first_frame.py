"""Estimate of the first frame once all others are solved.

No motion leads to the first frame: its forces rest on positions, where constant errors of centres and radii matter
most. The forces of later frames determine these errors better than any calibration beforehand, and where the second
frame resembles the first its forces are evidence of their own. Both enter one posterior, from which the frame is solved
once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..solver.calibration.calibrate import Calibration
from ..solver.calibration.equations import rotate_offsets
from ..solver.calibration.grain_errors import find_grain_errors
from ..solver.contacts.verdicts import NO_VERDICTS
from ..solver.frame_forces import FrameForces, FrameStatus
from ..solver.mixture.fringe_evidence import calibrate_sequence_fringes
from ..solver.mixture.position_estimates import PositionEstimates, frame_generator
from ..solver.posterior.frame_posterior import FramePosterior, infer_frame
from ..solver.posterior.sequence_evidence import SequenceEvidence
from ..tracks import Tracks, WallTracks
from .backward_pass import fuse_second_frame
from .corrected_sequence import CorrectedSequence
from .known_pairs import correct_grain_errors, gather_evidence_of, known_pairs, rows_of
from .snapshots import measure_sequence

FRAMES = 16  # later frames that determine the errors; after more of them other contacts bear
MIN_FRAMES = 2  # fewer frames do not determine the errors
DETECTABLE = 0.5  # errors smaller than so many standard deviations of a position are left
SEED = 1  # of the draws of the remaining errors
UNSOUND = (FrameStatus.FAILED, FrameStatus.SUSPECT)


def estimate_first_frame(
    sequence: CorrectedSequence, frames: Sequence[FrameForces]
) -> tuple[FramePosterior, str] | None:
    """Estimate the forces of the first frame from its positions and from all later frames.

    Parameters
    ----------
    sequence : CorrectedSequence
    frames : sequence of FrameForces
        All frames in order. Only those after the first are read, so a repeated estimate is the same bit for bit.

    Returns
    -------
    FramePosterior and str, or None
        The posterior and a sentence on its evidence; None where positions are not used or show no force.
    """
    if not sequence.settings.uses_positions or not frames or frames[0].status is FrameStatus.FAILED:
        return None
    found = _posterior_without_errors(sequence, frames)
    evidence = ["errors of its grains' centres and radii are known from later photographs"] if found is not None else []
    if found is None:
        found = _posterior_of_positions(sequence)
    if found is None or not found.fn.any():
        return None
    if len(frames) > 1 and frames[1].status not in UNSOUND:
        fused = fuse_second_frame(sequence, found, frames[1])
        if fused is not None:
            found = fused
            evidence.append("the forces of the next photograph are fused with those of its positions")
    return found, "; ".join(evidence)


def _posterior_of_positions(sequence: CorrectedSequence) -> FramePosterior | None:
    """Position-only estimate of the first frame; None where no two bodies are close."""
    if sequence.settings.soft and sequence.tracks.fringes is None:  # averaged with later ones, as those of all frames
        settings, verdicts = sequence.settings, sequence.verdicts.get(0, NO_VERDICTS)
        estimates = PositionEstimates(
            sequence.packing, sequence.snapshots, settings.posterior, settings.workers, alone=True
        )  # fmt: skip
        return estimates.at(0, verdicts)
    try:
        evidence = gather_evidence_of(sequence, sequence.tracks)
    except ValueError:  # no two bodies are close
        return None
    return _sample(sequence, evidence, None)


def _posterior_without_errors(sequence: CorrectedSequence, frames: Sequence[FrameForces]) -> FramePosterior | None:
    """The same after correction of the grains' own errors, which later forces determine; None where they do not."""
    calibration = sequence.calibration
    if calibration is None or 0 in sequence.failed:
        return None
    rows, force = known_pairs([each for each in frames[1 : FRAMES + 1] if each.status not in UNSOUND])
    if len(np.unique(rows.frame)) < MIN_FRAMES:
        return None
    given, walls = _without_own_corrections(sequence.tracks, sequence.walls, calibration), sequence.walls
    centre, radius = _prior_errors(gather_evidence_of(sequence, given))
    if centre == radius == 0.0:
        return None
    measured = measure_sequence(given, walls)
    found = find_grain_errors(measured, rows, force, centre=centre, radius=radius, rng=np.random.default_rng(SEED))
    evidence = gather_evidence_of(sequence, correct_grain_errors(given, measured, found))
    contacts = evidence.of_frame(0, verdicts=sequence.verdicts.get(0, NO_VERDICTS)).contacts
    return _sample(sequence, evidence, found.gap_sd(measured, rows_of(0, contacts)))


def _sample(
    sequence: CorrectedSequence, evidence: SequenceEvidence, gap_sd: np.ndarray | None
) -> FramePosterior | None:
    """Sample the posterior of the first frame; gap_sd (c,) [m]: remaining errors of its gaps."""
    evidence, fringes = calibrate_sequence_fringes(evidence, sequence.settings.workers)
    first = evidence.of_frame(0, verdicts=sequence.verdicts.get(0, NO_VERDICTS), fringes=fringes)
    if first.contacts.count == 0:
        return None
    if gap_sd is not None:
        first = replace(first, gap_sd=gap_sd)
    settings = evidence.settings.for_isolated_frame()
    return infer_frame(first, settings, frame_generator(0), sequence.settings.workers)


def _without_own_corrections(tracks: Tracks, walls: WallTracks, calibration: Calibration) -> Tracks:
    """Restore every grain's own errors; corrections that all grains share stay."""
    own = rotate_offsets(measure_sequence(tracks, walls), calibration.offset)
    shared = calibration.shared_radius(tracks.radius - calibration.radius)
    return replace(
        tracks,
        radius=tracks.radius - (calibration.radius - shared),
        position=tracks.position - own,
    )


def _prior_errors(evidence: SequenceEvidence) -> tuple[float, float]:
    """Standard deviations [m] of errors of centres and of radii; 0 where noise hides them."""
    noise, least = evidence.noise.sigma, DETECTABLE * evidence.noise.sigma
    centre = float(np.sqrt(max(float(np.median(evidence.centre_sd)) ** 2 - noise**2, 0.0)))
    return centre if centre > least else 0.0, evidence.radius_sd if evidence.radius_sd > least else 0.0
