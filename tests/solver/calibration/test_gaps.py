import tracemalloc
from dataclasses import replace

import numpy as np
from rodsight.solver.bodies.wall_shapes import IN, OUT, STRAIGHT, wall_distance
from rodsight.solver.calibration.gaps import GapRows, MeasuredSequence, find_gap_rows, measure_gaps

SIDE, PITCH, R = 40, 0.02, 0.009
MEMORY = 5e6  # [B]; all pairs of these grains would take fifty


def square_of_grains() -> MeasuredSequence:
    """Make a square lattice of grains that do not touch, one corner of it at two walls."""
    n = SIDE**2
    position = PITCH * np.stack(np.divmod(np.arange(n), SIDE), axis=1) + R
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) * (SIDE * PITCH + R)
    endpoints = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)[None]
    zero = np.zeros((1, n))
    return MeasuredSequence(np.full(n, R), position[None], zero, zero == 0.0, endpoints, zero + 1e-5)


def test_wall_reach_alone_lists_no_pair_of_grains():
    sequence = square_of_grains()
    tracemalloc.start()
    rows = find_gap_rows(sequence, -np.inf, wall_reach=1e-3)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert rows.count == 2 * SIDE
    assert np.all(rows.j >= sequence.grain_count)
    assert peak < MEMORY


def test_pairs_within_reach_are_those_of_neighbours():
    sequence = square_of_grains()
    apart = PITCH - 2 * R
    assert find_gap_rows(sequence, 0.9 * apart, wall_reach=-np.inf).count == 0
    rows = find_gap_rows(sequence, 1.1 * apart, wall_reach=-np.inf)
    assert rows.count == 2 * SIDE * (SIDE - 1)
    assert np.all(rows.i < rows.j)


def test_the_gap_of_two_grains_is_their_distance_less_both_radii():
    sequence = square_of_grains()
    radius = np.linspace(0.5 * R, R, sequence.grain_count)
    pair = GapRows(*(np.array([value], np.int32) for value in (0, 2, SIDE + 3, 0)))  # frame, i, j, pair
    found = measure_gaps(pair, sequence.position, sequence.endpoints, radius)
    distance = PITCH * np.sqrt(2.0)
    np.testing.assert_allclose(found.gap, distance - radius[2] - radius[SIDE + 3], rtol=1e-9)
    np.testing.assert_allclose(found.normal, [[np.sqrt(0.5), np.sqrt(0.5)]], rtol=1e-9)


def test_boundary_grains_need_not_touch_each_other_nor_walls():
    sequence = square_of_grains()
    boundary = np.arange(sequence.grain_count) < 2 * SIDE  # two columns of the lattice, the first one at a wall
    reach = 1.1 * (PITCH - 2 * R)
    everywhere = find_gap_rows(sequence, reach, wall_reach=1e-3)
    rows = find_gap_rows(replace(sequence, boundary=boundary), reach, wall_reach=1e-3)
    imposed = np.append(boundary, np.ones(sequence.wall_count, bool))
    assert not (imposed[rows.i] & imposed[rows.j]).any()
    moves = ~(imposed[everywhere.i] & imposed[everywhere.j])
    assert 0 < moves.sum() < everywhere.count
    np.testing.assert_array_equal(np.stack([rows.i, rows.j]), np.stack([everywhere.i, everywhere.j])[:, moves])
    assert replace(sequence, boundary=boundary).thinned(1).boundary is boundary


def test_gaps_at_walls_have_the_bits_of_wall_distance():
    rng = np.random.default_rng(2)
    position, radius = rng.uniform(-1.0, 1.0, (2, 50, 2)), rng.uniform(0.01, 0.02, 50)
    position[0, 0] = 0.5 * (ends := rng.uniform(-2.0, 2.0, (2, 3, 2, 2)))[0, 1].sum(axis=0)  # the middle of a circle
    side, frame, wall = np.array([STRAIGHT, IN, OUT], np.int8), rng.integers(0, 2, 200), rng.integers(0, 3, 200)
    grain = np.append([0], rng.integers(0, 50, 199))
    frame[0], wall[0] = 0, 1
    rows = GapRows(*(each.astype(np.int32) for each in (frame, grain, 50 + wall, np.arange(200))))
    found = measure_gaps(rows, position, ends, radius, side)
    place = position[frame, grain]
    distance, outward = wall_distance(ends[frame, wall], side[wall], place)
    along = np.stack([-outward[:, 1], outward[:, 0]], axis=1)
    from_middle = np.einsum("mk,mk->m", place - ends[frame, wall].mean(axis=1), along)
    assert np.array_equal(found.gap, distance - radius[grain])
    assert np.array_equal(found.normal, outward, equal_nan=True)
    assert np.isnan(found.normal[0]).all()
    assert np.array_equal(found.along, np.where(side[wall] == STRAIGHT, from_middle, 0.0))
