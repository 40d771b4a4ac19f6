"""Errors of grains found where forces are known, on a lattice whose overlaps, errors and noise are made."""

from __future__ import annotations

import numpy as np
import pytest

from solver.bodies.grains import Array
from solver.calibration.equations import rotate_offsets
from solver.calibration.gaps import GapRows, MeasuredSequence, find_gap_rows, measure_gaps
from solver.calibration.known_forces import GrainErrors, find_grain_errors

R, SIGMA, FRAMES, SIDE = 5e-3, 1e-5, 12, 7
OVERLAP = 4e-6  # [m] of the mean force
NONE = GapRows(*(np.empty(0, np.int32),) * 4)


def make_lattice(
    rng: np.random.Generator, *, centre: float = 0.0, radius: float = 0.0
) -> tuple[MeasuredSequence, Array]:
    """A square lattice that changes its spacing from frame to frame, rods that roll, measured with constant errors."""
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
    told = true.radius - rng.normal(0.0, 1.0, n) * radius
    errors = rotate_offsets(true, rng.normal(0.0, 1.0, (n, 2)) * centre) - rng.normal(0.0, SIGMA, position.shape)
    return MeasuredSequence(told, position - errors, rotation, present, walls, true.sigma), position


def find(sequence: MeasuredSequence, position: Array, **sds: float) -> tuple[GrainErrors, GapRows, Array]:
    """What is found, the pairs of the first frame, and the errors that are left of their gaps, noise and all."""
    rows = find_gap_rows(sequence, 1e-3)
    exact = measure_gaps(rows, position, sequence.endpoints, np.full(SIDE * SIDE, R)).gap
    later = rows.frame > 0
    errors = find_grain_errors(
        sequence, rows.select(later), -exact[later] / OVERLAP, **sds, rng=np.random.default_rng(1)
    )  # fmt: skip
    first = rows.select(~later)
    better = sequence.position + rotate_offsets(sequence, errors.offset)
    found = measure_gaps(first, better, sequence.endpoints, sequence.radius + errors.radius).gap
    return errors, first, found - exact[~later]


@pytest.mark.parametrize(("centre", "radius"), [(5e-5, 0.0), (0.0, 1e-4), (5e-5, 5e-5)])
def test_errors_of_later_frames_are_taken_off_the_first(centre: float, radius: float):
    sequence, position = make_lattice(np.random.default_rng(0), centre=centre, radius=radius)
    errors, first, left = find(sequence, position, centre=centre, radius=radius)
    stated = errors.gap_deviation(sequence, first)
    assert errors.overlap == pytest.approx(OVERLAP, rel=0.2)
    assert np.sqrt(np.mean(left**2)) < 1.3 * np.sqrt(2.0) * SIGMA  # of errors ten times as large
    assert np.median(stated) < 0.6 * np.sqrt(2.0) * SIGMA
    assert np.sqrt(np.mean(left**2 / (2.0 * SIGMA**2 + stated**2))) == pytest.approx(1.0, abs=0.15)


def test_what_is_exact_beforehand_stays():
    sequence, position = make_lattice(np.random.default_rng(2), radius=1e-4)
    errors, _, _ = find(sequence, position, centre=0.0, radius=1e-4)
    assert not errors.offset.any()
    assert errors.radius.std() == pytest.approx(1e-4, rel=0.3)


def test_a_rod_that_was_lost_track_of_says_little():
    sequence, position = make_lattice(np.random.default_rng(3), centre=5e-5)
    for frame in range(1, FRAMES, 3):
        sequence.position[frame, 3 * frame] += 4e-4
    _, _, left = find(sequence, position, centre=5e-5, radius=0.0)
    assert np.sqrt(np.mean(left**2)) < 1.5 * np.sqrt(2.0) * SIGMA


def test_a_pair_that_no_later_frame_shows_keeps_its_doubt():
    sequence, position = make_lattice(np.random.default_rng(4), centre=5e-5)
    rows = find_gap_rows(sequence, 1e-3)
    apart = rows.pair == 0
    exact = measure_gaps(rows, position, sequence.endpoints, np.full(SIDE * SIDE, R)).gap
    told = ~apart & (rows.frame > 0)
    errors = find_grain_errors(
        sequence, rows.select(told), -exact[told] / OVERLAP, centre=5e-5, radius=0.0, rng=np.random.default_rng(1)
    )  # fmt: skip
    stated = errors.gap_deviation(sequence, rows.select(rows.frame == 0))
    assert stated[0] > 3.0 * np.median(stated[1:])


def test_nothing_to_find_is_refused():
    sequence, _ = make_lattice(np.random.default_rng(0))
    rows = find_gap_rows(sequence, 1e-3)
    for given, sd in ((NONE, 1e-5), (rows, 0.0)):
        with pytest.raises(ValueError, match="no gap with a known force, or nothing that could be wrong"):
            find_grain_errors(
                sequence, given, np.ones(given.count), centre=sd, radius=0.0, rng=np.random.default_rng(0)
            )
