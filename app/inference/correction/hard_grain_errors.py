"""Errors of centres of hard rods that hardly move, by the forces between them.

Calibration corrects the gaps of all pairs that seem to touch. Where rods move, other pairs touch later, so that errors
and gaps separate. Where they hardly move, gaps between rods that bear nothing are taken for errors, and errors for
gaps. The forces of solved photographs show which pairs bear: with them the errors are found anew, and the step is
repeated with the better forces. Every pass confirms the pairs that the one before it took for bearing, right or wrong;
the mean over the passes and the calibration depends less on them than the last one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ...process.counts import mean_of_known
from ...process.progress import Progress, no_progress
from ...solver.bodies.grains import Array
from ...solver.calibration.calibrate import Calibration
from ...solver.calibration.equations import rotate_offsets
from ...solver.calibration.gaps import MeasuredSequence
from ...solver.calibration.grain_errors import GrainErrors, find_grain_errors
from ...solver.frame_forces import FrameForces, FrameStatus
from ...solver.posterior.sequence_evidence import SequenceEvidence
from ...tracks import Tracks, WallTracks
from ..corrected_sequence import CorrectedSequence
from ..known_pairs import correct_grain_errors, gather_evidence_of, known_pairs
from ..snapshots import measure_sequence
from .preliminary_forces import solve_first

FRAMES = 12  # solved beforehand
FEWEST = 2  # frames that determine the errors
PASSES = 4
FITS = 0.9  # expected r from which on the motion confirms what calibration did
DETECTABLE = 0.5  # errors smaller than so many standard deviations of a position are left
MOST_OF_RADII = 0.3  # greatest size of errors of radii over those of centres
SEED = 1  # of the draws of the remaining errors
UNSOUND = (FrameStatus.FAILED, FrameStatus.SUSPECT)


def correct_hard_grains(sequence: CorrectedSequence, progress: Progress = no_progress) -> CorrectedSequence:
    """Find the errors of centres of hard rods by forces where the motion shows little; elsewhere unchanged.

    Parameters
    ----------
    sequence : CorrectedSequence
    progress : callable
        Called after every pass.
    """
    calibration = sequence.calibration
    if calibration is None or sequence.settings.soft or not sequence.settings.uses_positions:
        return sequence
    given = without_own_corrections(sequence.tracks, sequence.walls, calibration)
    try:
        size = size_of_errors(gather_evidence_of(sequence, given))
    except ValueError:  # no two bodies are close
        return sequence
    if not size[1] < MOST_OF_RADII * size[0]:  # errors of radii look like forces of the same pairs: r rises and falls
        return sequence
    frames = list(solve_first(sequence, FRAMES))
    if not mean_of_known(each.expected_correlation for each in frames[1:]) < FITS:
        return sequence
    measured, better = measure_sequence(given, sequence.walls), sequence
    shared = calibration.shared_radius(sequence.tracks.radius - calibration.radius)
    offsets, radii = [calibration.offset], [calibration.radius - shared]
    for passed in range(PASSES):
        frames = list(solve_first(better, FRAMES)) if passed else frames
        found = errors_by_forces(measured, frames[1:], size)
        if found is None:
            break
        offsets.append(found.offset)
        radii.append(found.radius)
        mean = replace(found, offset=np.mean(offsets, axis=0), radius=np.mean(radii, axis=0))
        own = _with_own_errors(calibration, shared, mean)
        settings = replace(sequence.settings, centres_by_forces=True)
        corrected = sequence.with_tracks(correct_grain_errors(given, measured, mean))
        better = replace(corrected, calibration=own, settings=settings)
        progress("correcting centres", passed + 1, PASSES)
    return better if better is sequence else _with_remark(better)


def errors_by_forces(
    measured: MeasuredSequence, frames: Iterable[FrameForces], size: tuple[float, float]
) -> GrainErrors | None:
    """Find the errors of grains from the gaps of pairs that surely bear.

    Parameters
    ----------
    measured : MeasuredSequence
        Without corrections of single grains.
    frames : iterable of FrameForces
        Those that are suspect are left out.
    size : (float, float)
        As of `size_of_errors`.

    Returns
    -------
    GrainErrors or None
        None: fewer than two frames, which do not determine them.
    """
    rows, force = known_pairs(each for each in frames if each.status not in UNSOUND)
    if len(np.unique(rows.frame)) < FEWEST:
        return None
    centre, radius = size
    return find_grain_errors(measured, rows, force, centre=centre, radius=radius, rng=np.random.default_rng(SEED))


def without_own_corrections(tracks: Tracks, walls: WallTracks, calibration: Calibration) -> Tracks:
    """Restore every grain's own errors; corrections that all grains share stay."""
    own = rotate_offsets(measure_sequence(tracks, walls), calibration.offset)
    shared = calibration.shared_radius(tracks.radius - calibration.radius)
    return replace(
        tracks,
        radius=tracks.radius - (calibration.radius - shared),
        position=tracks.position - own,
    )


def size_of_errors(evidence: SequenceEvidence) -> tuple[float, float]:
    """Standard deviations [m] of errors of centres and of radii; 0 where noise hides them."""
    noise, least = evidence.noise.sigma, DETECTABLE * evidence.noise.sigma
    centre = float(np.sqrt(max(float(np.median(evidence.centre_sd)) ** 2 - noise**2, 0.0)))
    return centre if centre > least else 0.0, evidence.radius_sd if evidence.radius_sd > least else 0.0


def _with_remark(sequence: CorrectedSequence) -> CorrectedSequence:
    assert sequence.calibration is not None
    size = 1e6 * float(np.sqrt(np.mean(sequence.calibration.offset**2)))
    remark = f"errors of centres ({size:.0f} µm rms) were found again by the forces of the first photographs"
    return replace(sequence, remark="; ".join(filter(None, (sequence.remark, remark))))


def _with_own_errors(calibration: Calibration, shared: Array, found: GrainErrors) -> Calibration:
    """The calibration with other errors of single grains; shared (n,) [m]: the part of radii that all grains share."""
    n, sd = len(shared), found.draws.std(axis=0)
    return replace(
        calibration, offset=found.offset, offset_sd=sd[: 2 * n].reshape(n, 2),
        radius=shared + found.radius, radius_sd=sd[2 * n :],
    )  # fmt: skip
