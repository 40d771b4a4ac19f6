"""Constant errors of grains from known forces, on a lattice with known overlaps, errors and noise."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.bodies.grains import Array
from rodsight.solver.calibration.equations import rotate_offsets
from rodsight.solver.calibration.gaps import GapRows, MeasuredSequence, find_gap_rows, measure_gaps
from rodsight.solver.calibration.grain_errors import GrainErrors, find_grain_errors

R, SIGMA, FRAMES, SIDE = 5e-3, 1e-5, 12, 7
OVERLAP = 4e-6  # [m] of the mean force
NONE = GapRows(*(np.empty(0, np.int32),) * 4)


def make_lattice(
    rng: np.random.Generator, *, centre: float = 0.0, radius: float = 0.0
) -> tuple[MeasuredSequence, Array]:
    """Make a square lattice of rolling rods with changing spacing, measured with constant errors; and true centres."""
    n = SIDE * SIDE
    row, column = np.divmod(np.arange(n), SIDE)
    strain = rng.normal(0.0, 2.0 * OVERLAP / (2.0 * R), (FRAMES, SIDE - 1, 2)) + OVERLAP / (2.0 * R)
    along = 2.0 * R * (1.0 - strain)
    place = np.concatenate([np.zeros((FRAMES, 1, 2)), np.cumsum(along, axis=1)], axis=1)
    position = np.stack([place[:, column, 0], place[:, row, 1]], axis=2)
    rotation = np.cumsum(rng.normal(0.0, 0.02, (FRAMES, n)), axis=0)
    present = np.ones((FRAMES, n), np.bool_)
    walls = np.empty((FRAMES, 0, 2, 2))
    true = MeasuredSequence(np.full(n, R), position, rotation, present, walls, np.full((FRAMES, n), SIGMA))
    given = true.radius - rng.normal(0.0, 1.0, n) * radius
    errors = rotate_offsets(true, rng.normal(0.0, 1.0, (n, 2)) * centre) - rng.normal(0.0, SIGMA, position.shape)
    return MeasuredSequence(given, position - errors, rotation, present, walls, true.sigma), position


def find(sequence: MeasuredSequence, position: Array, **sds: float) -> tuple[GrainErrors, GapRows, Array]:
    """Return the estimate, the pairs of the first frame, and the remaining errors of their gaps, noise included."""
    rows = find_gap_rows(sequence, 1e-3)
    exact = measure_gaps(rows, position, sequence.endpoints, np.full(SIDE * SIDE, R)).gap
    later = rows.frame > 0
    errors = find_grain_errors(
        sequence, rows.select(later), -exact[later] / OVERLAP, **sds, rng=np.random.default_rng(1)
    )  # fmt: skip
    first = rows.select(~later)
    corrected = sequence.position + rotate_offsets(sequence, errors.offset)
    found = measure_gaps(first, corrected, sequence.endpoints, sequence.radius + errors.radius).gap
    return errors, first, found - exact[~later]


@pytest.mark.parametrize(("centre", "radius"), [(5e-5, 0.0), (0.0, 1e-4), (5e-5, 5e-5)])
def test_errors_from_later_frames_correct_the_first(centre: float, radius: float):
    sequence, position = make_lattice(np.random.default_rng(0), centre=centre, radius=radius)
    errors, first, residual = find(sequence, position, centre=centre, radius=radius)
    stated = errors.gap_sd(sequence, first)
    assert errors.overlap == pytest.approx(OVERLAP, rel=0.2)
    assert np.sqrt(np.mean(residual**2)) < 1.3 * np.sqrt(2.0) * SIGMA  # of errors ten times as large
    unknowns = SIDE**2 * ((2 if centre else 0) + (1 if radius else 0))
    known = np.sqrt(min(unknowns / first.count, 1.0) / (FRAMES - 1))  # of the noise, by as many frames
    assert np.median(stated) == pytest.approx(known * np.sqrt(2.0) * SIGMA, rel=0.25)
    assert np.sqrt(np.mean(residual**2 / (2.0 * SIGMA**2 + stated**2))) == pytest.approx(1.0, abs=0.15)


def test_overlap_is_per_unit_of_force():
    sequence, position = make_lattice(np.random.default_rng(0), centre=5e-5)
    rows = find_gap_rows(sequence, 1e-3)
    force = -measure_gaps(rows, position, sequence.endpoints, np.full(SIDE * SIDE, R)).gap / OVERLAP
    one, kilo = (
        find_grain_errors(sequence, rows, scale * force, centre=5e-5, radius=0.0, rng=np.random.default_rng(1))
        for scale in (1.0, 1e3)
    )
    assert kilo.overlap == pytest.approx(1e-3 * one.overlap)


def test_exact_quantities_are_not_corrected():
    sequence, position = make_lattice(np.random.default_rng(2), radius=1e-4)
    errors, _, _ = find(sequence, position, centre=0.0, radius=1e-4)
    assert not errors.offset.any()
    assert errors.radius.std() == pytest.approx(1e-4, rel=0.3)


def test_tracking_errors_have_little_weight():
    sequence, position = make_lattice(np.random.default_rng(3), centre=5e-5)
    for frame in range(1, FRAMES, 3):
        sequence.position[frame, 3 * frame] += 4e-4
    _, _, residual = find(sequence, position, centre=5e-5, radius=0.0)
    assert np.sqrt(np.mean(residual**2)) < 1.5 * np.sqrt(2.0) * SIGMA


def test_pair_without_later_frames_keeps_its_standard_deviation():
    sequence, position = make_lattice(np.random.default_rng(4), centre=5e-5)
    rows = find_gap_rows(sequence, 1e-3)
    apart = rows.pair == 0
    exact = measure_gaps(rows, position, sequence.endpoints, np.full(SIDE * SIDE, R)).gap
    known = ~apart & (rows.frame > 0)
    errors = find_grain_errors(
        sequence, rows.select(known), -exact[known] / OVERLAP, centre=5e-5, radius=0.0, rng=np.random.default_rng(1)
    )  # fmt: skip
    stated = errors.gap_sd(sequence, rows.select(rows.frame == 0))
    assert stated[0] > 3.0 * np.median(stated[1:])


def test_missing_gaps_or_errors_are_rejected():
    sequence, _ = make_lattice(np.random.default_rng(0))
    rows = find_gap_rows(sequence, 1e-3)
    for given, sd in ((NONE, 1e-5), (rows, 0.0)):
        with pytest.raises(ValueError, match="no gap has a known force, or both prior standard deviations are zero"):
            find_grain_errors(
                sequence, given, np.ones(given.count), centre=sd, radius=0.0, rng=np.random.default_rng(0)
            )
