"""Errors of soft rods: told from overlap once forces are known.

Where rods are soft nothing is calibrated, for an overlap is a force and must not be explained away. But where centres
and radii are wrong by as much as rods overlap, errors pass for forces. The motion tells forces whatever the gaps say:
the first photographs are solved, with their forces each gap is error, noise and overlap in proportion, what is found of
the errors is taken off, and with better forces it is found again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from solver.calibration.gaps import MeasuredSequence
from solver.calibration.known_forces import GrainErrors, find_grain_errors
from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.sequence.frames import solve_sequence

from ..snapshots import measure_sequence
from .known_pairs import gather_evidence_of, known_pairs, with_tracks, without_errors

if TYPE_CHECKING:
    from ..inference import CorrectedSequence

FRAMES = 8  # that are solved beforehand: enough for each rod to be pressed from several sides
LOOK = 4  # of them after which it is seen whether errors may be told at all …
HOPEFUL = 0.8  # … by errors found over what is not known of them: there .2 to .6 of rods that are as they were told
FEWEST = 3
PASSES = 2
WORTH = 0.8  # scatter of errors over the noise of a position below which there is nothing to gain
TOLD = 1.0  # errors that are found over what is not known of them: below it rods are as they were told; there .4 to .6
STANDS_OUT = 2.5  # mean overlap over that noise below which overlap is no witness
TRUST_AT_MOST = 0.9  # where errors were worth it: what is left of them shares its gaps with forces; r .87 to .98
SEED = 1  # of the draws behind deviations, of which none is asked here


def correct_soft(sequence: CorrectedSequence) -> CorrectedSequence:
    """The sequence with the errors that the forces of its soft rods tell; as it is where none can be told."""
    if not sequence.settings.soft or not sequence.settings.asks_positions or sequence.packing.grains.count == 0:
        return sequence
    try:
        evidence = gather_evidence_of(sequence, sequence.tracks)
    except ValueError:  # no two bodies are near
        return sequence
    noise = evidence.noise.sigma
    error = float(np.sqrt(max(float(np.median(evidence.centre_deviation)) ** 2 - noise**2, 0.0)))
    if error < WORTH * noise:
        return sequence
    measured = measure_sequence(sequence.tracks, sequence.walls)
    cautious = replace(sequence.settings, soft_trust=min(sequence.settings.soft_trust, TRUST_AT_MOST))
    better = sequence
    for _ in range(PASSES):
        found = _find_errors(measured, better, error, STANDS_OUT * noise)
        if found is None:
            break
        better = with_tracks(sequence, without_errors(sequence.tracks, measured, found))
        better = replace(better, settings=cautious)
    return better


def _find_errors(
    measured: MeasuredSequence, sequence: CorrectedSequence, error: float, least: float
) -> GrainErrors | None:
    """Errors of this size [m] of what was measured; None where rods overlap by less than `least` [m]."""
    solved = _solve_first(sequence)
    frames = list(islice(solved, LOOK))
    force, found = _errors_by_forces(measured, frames, error)
    if found is not None and not _is_told(found, HOPEFUL):
        return None
    frames += solved
    force, found = _errors_by_forces(measured, frames, error)
    return found if found is not None and found.overlap * force > least and _is_told(found, TOLD) else None


def _solve_first(sequence: CorrectedSequence) -> Iterator[FrameForces]:
    # Nobody asks for the forces of the very first, which lead to those of the others.
    settings = replace(sequence.settings.without_sweeps(), first_again=True)
    solved = solve_sequence(
        sequence.packing, sequence.snapshots[:FRAMES], settings,
        verdicts=sequence.verdicts, failed={k: why for k, why in sequence.failed.items() if k < FRAMES},
    )  # fmt: skip
    return (forces for forces, _ in solved)


def _errors_by_forces(
    measured: MeasuredSequence, frames: list[FrameForces], error: float
) -> tuple[float, GrainErrors | None]:
    """Mean force [N] and the errors that forces tell; None of too few frames."""
    # No motion leads to the first one: its forces rest on the very gaps that are asked about.
    rows, force = known_pairs(each for each in frames[1:] if each.status is not FrameStatus.FAILED)
    if len(np.unique(rows.frame)) < FEWEST:
        return 0.0, None
    rng = np.random.default_rng(SEED)
    return float(force.mean()), find_grain_errors(measured, rows, force, centre=error, radius=error, rng=rng)


def _is_told(found: GrainErrors, least: float) -> bool:
    """Whether errors of centres or of radii are so many times what is not known of them."""
    n = len(found.radius)
    left = found.draws.std(axis=0)
    kinds = ((found.offset, left[: 2 * n]), (found.radius - found.radius.mean(), left[2 * n :]))
    return any(float(np.sqrt(np.mean(error**2) / np.mean(unknown**2))) > least for error, unknown in kinds)
