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

from ..solver.contacts.verdicts import NO_VERDICTS
from ..solver.frame_forces import FrameForces, FrameStatus
from ..solver.mixture.fringe_evidence import calibrate_sequence_fringes
from ..solver.mixture.position_estimates import PositionEstimates, frame_generator
from ..solver.posterior.frame_posterior import FramePosterior, infer_frame
from ..solver.posterior.sequence_evidence import SequenceEvidence
from .backward_pass import fuse_second_frame
from .corrected_sequence import CorrectedSequence
from .correction.errors_by_forces import UNSOUND, find_errors, size_of_errors, without_own_corrections
from .known_pairs import correct_grain_errors, gather_evidence_of, rows_of
from .snapshots import measure_sequence

FRAMES = 16  # later frames that determine the errors; after more of them other contacts bear


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
    given, walls = without_own_corrections(sequence.tracks, sequence.walls, calibration), sequence.walls
    size = size_of_errors(gather_evidence_of(sequence, given))
    if size == (0.0, 0.0):
        return None
    measured = measure_sequence(given, walls)
    found = find_errors(measured, frames[1 : FRAMES + 1], size)
    if found is None:
        return None
    errors, _ = found
    evidence = gather_evidence_of(sequence, correct_grain_errors(given, measured, errors))
    contacts = evidence.of_frame(0, verdicts=sequence.verdicts.get(0, NO_VERDICTS)).contacts
    return _sample(sequence, evidence, errors.gap_sd(measured, rows_of(0, contacts)))


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
