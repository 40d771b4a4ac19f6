"""Errors of single rods by the forces of solved photographs, which show what of a gap is overlap."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from dataclasses import replace

import numpy as np

from ...solver.calibration.calibrate import Calibration
from ...solver.calibration.equations import rotate_offsets
from ...solver.calibration.gaps import MeasuredSequence
from ...solver.calibration.grain_errors import GrainErrors, find_grain_errors
from ...solver.frame_forces import FrameForces, FrameStatus
from ...solver.posterior.sequence_evidence import SequenceEvidence
from ...solver.sequence.frames import solve_sequence
from ...tracks import Tracks, WallTracks
from ..corrected_sequence import CorrectedSequence
from ..known_pairs import known_pairs
from ..snapshots import measure_sequence

FEWEST = 2  # frames that determine the errors
DETECTABLE = 0.5  # errors smaller than so many standard deviations of a position are left
SEED = 1  # of the draws of the remaining errors
UNSOUND = (FrameStatus.FAILED, FrameStatus.SUSPECT)


def solve_first(sequence: CorrectedSequence, count: int) -> Iterator[FrameForces]:
    """Solve up to `count` photographs, one after the other, as far as they are read."""
    solved = solve_sequence(
        sequence.packing, sequence.snapshots[:count], sequence.settings.without_sweeps(),
        verdicts=sequence.verdicts, failed={k: why for k, why in sequence.failed.items() if k < count},
    )  # fmt: skip
    return (forces for forces, _ in solved)


def find_errors(
    measured: MeasuredSequence,
    frames: Iterable[FrameForces],
    size: tuple[float, float],
    *,
    fewest: int = FEWEST,
    left_out: Container[FrameStatus] = UNSOUND,
) -> tuple[GrainErrors, float] | None:
    """Find the errors of grains from the gaps of pairs that surely bear.

    Parameters
    ----------
    measured : MeasuredSequence
        Without corrections of single grains.
    frames : iterable of FrameForces
    size : (float, float)
        Prior standard deviations [m] of the errors of centres and of radii; zero: exact.
    fewest : int
        Frames that determine the errors.
    left_out : container of FrameStatus
        Statuses of frames that are not read.

    Returns
    -------
    (GrainErrors, float) or None
        The errors, and the mean force [N] of the pairs; None: too few frames.
    """
    rows, force = known_pairs(each for each in frames if each.status not in left_out)
    if len(np.unique(rows.frame)) < fewest:
        return None
    centre, radius = size
    found = find_grain_errors(measured, rows, force, centre=centre, radius=radius, rng=np.random.default_rng(SEED))
    return found, float(force.mean())


def size_of_errors(evidence: SequenceEvidence) -> tuple[float, float]:
    """Standard deviations [m] of errors of centres and of radii; 0 where noise hides them."""
    centre, least = centre_error(evidence), DETECTABLE * evidence.noise.sigma
    return centre if centre > least else 0.0, evidence.radius_sd if evidence.radius_sd > least else 0.0


def centre_error(evidence: SequenceEvidence) -> float:
    """Standard deviation [m] of the constant errors of centres: what noise leaves of that of a centre."""
    return float(np.sqrt(max(float(np.median(evidence.centre_sd)) ** 2 - evidence.noise.sigma**2, 0.0)))


def without_own_corrections(tracks: Tracks, walls: WallTracks, calibration: Calibration) -> Tracks:
    """Restore every grain's own errors; corrections that all grains share stay."""
    own = rotate_offsets(measure_sequence(tracks, walls), calibration.offset)
    shared = calibration.shared_radius(tracks.radius - calibration.radius)
    return replace(
        tracks,
        radius=tracks.radius - (calibration.radius - shared),
        position=tracks.position - own,
    )
