"""Grains that stand under the names of others are found, and real motions keep their names."""

import numpy as np
import pytest
from rodsight.solver.inferred.exchanged_ids import find_exchanged_ids

SIDE, FRAMES, NOISE = 7, 8, 1e-3  # lengths over the distance of neighbours
N, START = SIDE * SIDE, 3
ONE, BESIDE, ABOVE = 24, 25, 31  # in the middle, neighbours of it


def sheared():
    """Positions (f, n, 2) of a lattice in simple shear with noise, which moves by more than half a distance as well."""
    rng = np.random.default_rng(2)
    x, y = (each.ravel().astype(float) for each in np.meshgrid(np.arange(SIDE), np.arange(SIDE)))
    position = np.stack([np.column_stack([x + k * (0.6 + 0.1 / SIDE * y), y]) for k in range(FRAMES)])
    return position + NOISE * rng.standard_normal(position.shape)


def renamed(position, rows, start=START, stop=FRAMES):
    """The same with the poses of grains rows[i] under the name i from one photograph to another."""
    names = np.arange(N)
    names[list(rows)] = list(rows.values())
    found = position.copy()
    found[start:stop] = position[start:stop, names]
    return found


def restored(position):
    row = find_exchanged_ids(position)
    assert (np.sort(row, axis=1) == np.arange(N)).all()
    return np.take_along_axis(position, row[..., None], axis=1)


@pytest.mark.parametrize(
    "rows", [{ONE: BESIDE, BESIDE: ONE}, {ONE: BESIDE, BESIDE: ABOVE, ABOVE: ONE}, {0: 1, 1: 0, 40: 47, 47: 40}]
)
@pytest.mark.parametrize("stop", [START + 1, START + 2, FRAMES])
def test_exchanged_names_are_given_back(rows, stop):
    true = sheared()
    assert np.array_equal(restored(renamed(true, rows, stop=stop)), true)


def test_names_that_change_again_and_again_are_given_back():
    true = sheared()
    given = renamed(renamed(true, {ONE: BESIDE, BESIDE: ONE}, stop=5), {ONE: ABOVE, ABOVE: ONE}, start=5)
    assert np.array_equal(restored(given), true)


@pytest.mark.parametrize("unseen", [0, 2])
def test_a_grain_that_goes_on_under_a_new_name_is_the_same(unseen):
    true = sheared()
    true[START : START + unseen, ONE] = np.nan
    given = true.copy()
    given[START:, ONE], given[:, BESIDE] = np.nan, np.nan
    given[START:, BESIDE] = true[START:, ONE]
    true[:, BESIDE] = np.nan
    assert np.array_equal(restored(given), true, equal_nan=True)


def test_a_lost_grain_does_not_take_its_neighbour_with_it():
    true = sheared()
    true[START:, BESIDE] = np.nan
    given = true.copy()
    given[START:, BESIDE], given[START:, ONE] = true[START:, ONE], np.nan
    assert np.array_equal(restored(given), true, equal_nan=True)


def test_a_grain_that_moves_to_where_one_was_taken_out_keeps_its_name():
    position = sheared()
    position[START:, BESIDE] = np.nan
    position[START + 1 :, ONE] = sheared()[START + 1 :, BESIDE]
    assert np.array_equal(restored(position), position, equal_nan=True)


def as_given(position):
    return (find_exchanged_ids(position) == np.arange(N)).all()


def test_correct_names_stay():
    assert as_given(sheared())


def test_a_pose_that_jumps_keeps_its_name():
    position = sheared()
    position[START, ONE] += (1.0, 0.05)  # onto its neighbour
    assert as_given(position)


def test_a_chain_without_an_end_keeps_its_names():
    """Of a row that slips by a grain every one stands where the next one is expected, but for the last."""
    position = sheared()
    row = np.arange(3 * SIDE, 4 * SIDE)
    position[START:, row, 0] += 1.0
    assert as_given(position)


def test_an_exchange_beside_such_a_chain_is_undone():
    true = sheared()
    true[START:, 3 * SIDE : 4 * SIDE, 0] += 1.0
    assert np.array_equal(restored(renamed(true, {0: 1, 1: 0})), true)


def test_names_stay_exchanged_where_the_packing_rearranges():
    """Nothing is nearer than a quarter of a distance to where it is expected, but most are nearer than half."""
    true = sheared()
    true[START + 2 :, [ONE, BESIDE]] += (0.0, 0.3)
    assert np.array_equal(restored(renamed(true, {ONE: BESIDE, BESIDE: ONE})), true)


def test_names_without_meaning_stay():
    position, rng = sheared(), np.random.default_rng(1)
    position[START:] = position[START:, rng.permutation(N)]
    assert as_given(position)


def test_a_loose_grain_may_cross_its_hole():
    position = sheared()
    position[START:, BESIDE] = np.nan
    position[START:, ONE] += (0.6, 0.0)
    assert as_given(position)


def test_few_grains_keep_their_names():
    position = renamed(sheared(), {0: 1, 1: 0})[:, :8]
    assert (find_exchanged_ids(position) == np.arange(8)).all()


def test_a_photograph_without_poses_ends_nothing():
    true = sheared()
    true[START] = np.nan
    assert np.array_equal(restored(renamed(true, {ONE: BESIDE, BESIDE: ONE})), true, equal_nan=True)
