"""Errors of centres and radii of soft rods, separated from their overlaps by forces that the motion determines.

Soft rods are not calibrated, because an overlap is a force and must not be removed as an error. But where centres and
radii are wrong by as much as rods overlap, errors look like forces. The motion determines forces independently of the
gaps: the first photographs are solved, with their forces each gap is error, noise and proportional overlap, the errors
found are subtracted, and the step is repeated with better forces.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np

from ...solver.assessment.mixture_trust import MAX_TRUST_CORRECTED
from ...solver.calibration.gaps import MeasuredSequence
from ...solver.calibration.grain_errors import GrainErrors
from ...solver.frame_forces import FrameForces, FrameStatus
from ..corrected_sequence import CorrectedSequence
from ..known_pairs import correct_grain_errors, gather_evidence_of
from ..snapshots import measure_sequence
from .errors_by_forces import centre_error, find_errors, solve_first

FRAMES = 8  # solved beforehand: enough for each rod to be pressed from several sides
PRELIMINARY_FRAMES = 4  # after which the errors must be detectable …
PRELIMINARY_RATIO = 0.8  # … by their size over their standard deviation: .2 to .6 for rods with exact radii
FEWEST = 3
PASSES = 2
DETECTABLE = 0.8  # errors below so many standard deviations of a position are left
SIGNIFICANT = 1.0  # size of the errors over their standard deviation: .4 to .6 for rods with exact radii
MIN_OVERLAP = 2.5  # mean overlap over the noise below which overlap is no evidence


def correct_soft_grains(sequence: CorrectedSequence) -> CorrectedSequence:
    """Correct the errors of soft rods that their forces determine; unchanged where they determine none."""
    if not sequence.settings.soft or not sequence.settings.uses_positions or sequence.packing.grains.count == 0:
        return sequence
    try:
        evidence = gather_evidence_of(sequence, sequence.tracks)
    except ValueError:  # no two bodies are close
        return sequence
    noise = evidence.noise.sigma
    error = centre_error(evidence)
    if error < DETECTABLE * noise:
        return sequence
    measured = measure_sequence(sequence.tracks, sequence.walls)
    cautious = replace(sequence.settings, soft_trust=min(sequence.settings.soft_trust, MAX_TRUST_CORRECTED))
    better = sequence
    for _ in range(PASSES):
        found = _find_errors(measured, better, error, MIN_OVERLAP * noise)
        if found is None:
            break
        better = sequence.with_tracks(correct_grain_errors(sequence.tracks, measured, found))
        better = replace(better, settings=cautious)
    return better


def _find_errors(
    measured: MeasuredSequence, sequence: CorrectedSequence, error: float, least: float
) -> GrainErrors | None:
    """Find errors of this size [m] in the measured sequence; None where rods overlap by less than `least` [m]."""
    solved = solve_first(sequence, FRAMES)
    frames = list(islice(solved, PRELIMINARY_FRAMES))
    found = _errors_by_forces(measured, frames, error)
    if found is not None and not _is_significant(found[0], PRELIMINARY_RATIO):
        return None
    frames += solved
    found = _errors_by_forces(measured, frames, error)
    if found is None:
        return None
    errors, force = found
    return errors if errors.overlap * force > least and _is_significant(errors, SIGNIFICANT) else None


def _errors_by_forces(
    measured: MeasuredSequence, frames: list[FrameForces], error: float
) -> tuple[GrainErrors, float] | None:
    """Errors that forces determine, and the mean force [N]; None of too few frames."""
    # No motion leads to the first frame: its forces rest on the gaps themselves.
    return find_errors(measured, frames[1:], (error, error), fewest=FEWEST, left_out=(FrameStatus.FAILED,))


def _is_significant(found: GrainErrors, least: float) -> bool:
    """Whether errors of centres or of radii exceed their standard deviation by this factor."""
    n = len(found.radius)
    sd = found.draws.std(axis=0)
    kinds = ((found.offset, sd[: 2 * n]), (found.radius - found.radius.mean(), sd[2 * n :]))
    return any(float(np.sqrt(np.mean(error**2) / np.mean(unknown**2))) > least for error, unknown in kinds)
