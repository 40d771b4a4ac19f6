"""Errors of centres of hard rods that hardly move, by the forces between them.

Calibration corrects the gaps of all pairs that seem to touch. Where rods move, other pairs touch later, so that errors
and gaps separate. Where they hardly move, gaps between rods that bear nothing are taken for errors, and errors for
gaps. The forces of solved photographs show which pairs bear: with them the errors are found anew, and the step is
repeated with the better forces. Every pass confirms the pairs that the one before it took for bearing, right or wrong;
the mean over the passes and the calibration depends less on them than the last one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...process.counts import mean_of_known
from ...solver.bodies.grains import Array
from ...solver.calibration.calibrate import Calibration
from ...solver.calibration.grain_errors import GrainErrors
from ..corrected_sequence import CorrectedSequence
from ..known_pairs import correct_grain_errors, gather_evidence_of
from ..snapshots import measure_sequence
from ..solve_frames import Beginning, InferenceObserver, solve_beginning
from .errors_by_forces import find_errors, size_of_errors, solve_first, without_own_corrections

FRAMES = 12  # solved beforehand
MOST_POSES = 120_000  # in them; with more, frames with all their sweeps would take more than .2 GB, and are not kept
PASSES = 4
FITS = 0.9  # expected r from which on the motion confirms what calibration did
MOST_OF_RADII = 0.3  # greatest size of errors of radii over those of centres


def correct_hard_grains(
    sequence: CorrectedSequence, observer: InferenceObserver | None = None
) -> tuple[CorrectedSequence, Beginning | None]:
    """Find the errors of centres of hard rods by forces where the motion shows little; elsewhere unchanged.

    Parameters
    ----------
    sequence : CorrectedSequence
    observer : InferenceObserver, optional
        Receives the progress of every pass, and failures.

    Returns
    -------
    CorrectedSequence
    Beginning or None
        The first frames of an unchanged sequence, where they were solved.
    """
    calibration, observer = sequence.calibration, InferenceObserver() if observer is None else observer
    if calibration is None or sequence.settings.soft or not sequence.settings.uses_positions:
        return sequence, None
    given = without_own_corrections(sequence.tracks, sequence.walls, calibration)
    try:
        size = size_of_errors(gather_evidence_of(sequence, given))
    except ValueError:  # no two bodies are close
        return sequence, None
    if not size[1] < MOST_OF_RADII * size[0]:  # errors of radii look like forces of the same pairs: r rises and falls
        return sequence, None
    beginning = None
    if sequence.tracks.grain_count * FRAMES <= MOST_POSES:
        beginning = solve_beginning(sequence, FRAMES, observer)
    frames = list(solve_first(sequence, FRAMES)) if beginning is None else [each.forces for each in beginning.frames]
    if not mean_of_known(each.expected_correlation for each in frames[1:]) < FITS:
        return sequence, beginning
    measured, better = measure_sequence(given, sequence.walls), sequence
    shared = calibration.shared_radius(sequence.tracks.radius - calibration.radius)
    again = replace(sequence, settings=replace(sequence.settings, centres_by_forces=True))
    offsets, radii = [calibration.offset], [calibration.radius - shared]
    for passed in range(PASSES):
        frames = list(solve_first(better, FRAMES)) if passed else frames
        found = find_errors(measured, frames[1:], size)
        if found is None:
            break
        errors, _ = found
        offsets.append(errors.offset)
        radii.append(errors.radius)
        mean = replace(errors, offset=np.mean(offsets, axis=0), radius=np.mean(radii, axis=0))
        better = again.with_tracks(correct_grain_errors(given, measured, mean))
        better = replace(better, calibration=_with_own_errors(calibration, shared, mean))
        observer.progress("correcting centres", passed + 1, PASSES)
    if better is sequence:
        return sequence, beginning
    rms = 1e6 * float(np.sqrt(np.mean(np.mean(offsets, axis=0) ** 2)))
    errors_found = f"errors of centres ({rms:.0f} µm rms)"
    return better.with_remark(f"{errors_found} were found again by the forces of the first photographs"), None


def _with_own_errors(calibration: Calibration, shared: Array, found: GrainErrors) -> Calibration:
    """The calibration with other errors of single grains; shared (n,) [m]: the part of radii that all grains share."""
    n, sd = len(shared), found.draws.std(axis=0)
    return replace(
        calibration, offset=found.offset, offset_sd=sd[: 2 * n].reshape(n, 2),
        radius=shared + found.radius, radius_sd=sd[2 * n :],
    )  # fmt: skip
