"""Forces without motion: in balance where they say so, exact where balance alone decides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.baselines.still_forces import GAP_SIGMAS, NEAR, estimate_still, touching_gap
from solver.bodies.motion import Snapshot
from solver.bodies.packing import Material, Packing
from solver.statistics.balance import unbalances
from tests.packings import LENGTH, Heap, box, heap_at_rest, rods

NOISE = 1e-5  # [m]
BALANCED = 1e-2  # of the mean force: an unbalance has a price, it is not forbidden
RADIUS = 0.008


@pytest.fixture(scope="module")
def heap() -> Heap:
    return heap_at_rest(columns=4, rows=3)


def snapshot_of(heap: Heap) -> Snapshot:
    n = len(heap.state.position)
    return Snapshot(0.0, heap.state.position, np.zeros(n), heap.state.present, heap.walls.endpoints, NOISE)


def column(heights: tuple[float, ...], *, pressure: float = np.nan, gravity: tuple[float, float] = (0.0, 0.0)):
    """Rods one above the other between sides that they do not touch, and their snapshot; the top may be a plate."""
    n = len(heights)
    walls = box(0.1, heights[-1] + RADIUS)
    packing = Packing(
        rods(*np.full(n, RADIUS)),
        LENGTH,
        Material(0.3, 0.3, 0.0, gravity),
        np.array([np.nan, np.nan, pressure, np.nan]),
    )
    position = np.column_stack([np.full(n, 0.05), heights])
    return packing, Snapshot(0.0, position, np.zeros(n), np.ones(n, np.bool_), walls.endpoints, NOISE)


STACKED = tuple(RADIUS * (1 + 2 * k) for k in range(4))


def test_fields_of_a_heap_are_in_balance_and_friction_is_within_its_limit(heap: Heap) -> None:
    still = estimate_still(heap.packing, [snapshot_of(heap)], 0, NOISE)
    for force in (still.balanced, still.overlapping):
        fn, ft = force.T
        assert unbalances(still.contacts, fn, ft, heap.packing.weight).max() < BALANCED * fn.mean()
        assert np.all(np.abs(ft) <= 0.3 * fn + 1e-9)
    np.testing.assert_array_equal(still.uniform[:, 1], 0.0)
    assert np.ptp(still.uniform[:, 0]) == 0.0


def test_where_balance_decides_the_weight_above_is_carried() -> None:
    packing, snapshot = column(STACKED, gravity=(0.0, -9.81))
    still = estimate_still(packing, [snapshot], 0, NOISE)
    weight = float(-packing.weight[0, 1])
    assert list(zip(still.contacts.i, still.contacts.j, strict=True)) == [(0, 1), (0, 4), (1, 2), (2, 3), (3, 6)]
    carried = dict(zip(still.contacts.key.tolist(), still.balanced[:, 0] - still.balanced[-1, 0], strict=True))
    np.testing.assert_allclose(list(carried.values()), weight * np.array([3, 4, 2, 1, 0]), atol=BALANCED * weight)


def test_a_plate_sets_the_size_of_the_forces() -> None:
    packing, snapshot = column(STACKED, pressure=1e4)
    still = estimate_still(packing, [snapshot], 0, NOISE)
    np.testing.assert_allclose(still.balanced[:, 0], 1e4 * 0.1 * LENGTH, rtol=BALANCED)
    np.testing.assert_allclose(still.uniform[:, 0], 1e4 * 2 * RADIUS * LENGTH)


def test_without_load_or_weight_the_forces_on_walls_are_one_on_average() -> None:
    packing, snapshot = column(STACKED)
    still = estimate_still(packing, [snapshot], 0, NOISE)
    np.testing.assert_allclose(still.balanced[:, 0], 1.0, rtol=BALANCED)


def test_overlaps_are_those_of_the_photographs_around() -> None:
    """Two rods between bottom and a wall on top share its force: balance leaves open how, the mean overlap tells."""
    walls = box(0.08, 2 * RADIUS)
    packing = Packing(rods(RADIUS, RADIUS), LENGTH, Material(0.3, 0.3), np.full(4, np.nan))

    def seen(first: float, second: float) -> Snapshot:
        """The rods squeezed by so much [m] between bottom and top, evenly."""
        squeezed, ends = np.array([first, second]), walls.endpoints.copy()
        ends[2, :, 1] -= [1.5 * second - 0.5 * first, 1.5 * first - 0.5 * second]  # over x = 0.08 and 0
        position = np.column_stack([[0.02, 0.06], RADIUS - 0.5 * squeezed])
        return Snapshot(0.0, position, np.zeros(2), np.ones(2, np.bool_), ends, NOISE)

    uneven, reverse = seen(2e-5, 8e-5), seen(6e-5, 4e-5)
    bottom = estimate_still(packing, [uneven], 0, NOISE).contacts.j == 2
    alone, *_, mean = (
        estimate_still(packing, seen, 0, NOISE).overlapping[bottom, 0] for seen in ([uneven], [uneven, reverse])
    )
    np.testing.assert_allclose(alone, [0.4, 1.6], atol=0.05)
    np.testing.assert_allclose(mean, [0.8, 1.2], atol=0.05)
    np.testing.assert_allclose(estimate_still(packing, [uneven], 0, NOISE).balanced[:, 0], 1.0, atol=BALANCED)


def test_pairs_bear_up_to_what_noise_allows_and_are_compared_farther() -> None:
    sure, wide = 0.9 * GAP_SIGMAS * np.sqrt(2.0) * NOISE, 0.9 * NEAR * 2.0 * RADIUS
    packing, snapshot = column((RADIUS, 3 * RADIUS, 5 * RADIUS + sure, 7 * RADIUS + sure + wide))
    still = estimate_still(packing, [snapshot], 0, NOISE)
    pairs = {divmod(int(key), 8) for key in still.contacts.key}
    assert (1, 2) in pairs
    assert (2, 3) not in pairs
    assert set(still.contacts.key) < set(still.near)
    assert (2, 3) in {divmod(int(key), 8) for key in still.near}


def test_pairs_whose_radii_are_too_small_bear_as_well() -> None:
    packing, snapshot = column(STACKED, pressure=1e4)
    small = replace(packing, grains=rods(*np.full(4, 0.97 * RADIUS)))
    still = estimate_still(small, [snapshot], 0, NOISE)
    assert [(i, j) for i, j in zip(still.contacts.i, still.contacts.j, strict=True) if j < 4] == [
        (0, 1),
        (1, 2),
        (2, 3),
    ]


def test_a_rod_that_is_not_there_bears_nothing() -> None:
    packing, snapshot = column(STACKED, gravity=(0.0, -9.81))
    lost = replace(snapshot, present=np.array([True, True, True, False]))
    still = estimate_still(packing, [snapshot, lost, snapshot], 1, NOISE)
    assert 3 not in still.contacts.i
    assert np.isfinite(still.overlapping).all()


def test_radii_that_are_too_small_are_seen_in_the_gaps() -> None:
    rng = np.random.default_rng(0)
    gap = np.concatenate([rng.normal(0.0, 1e-6, 150), rng.uniform(0.0, 1e-3, 400)])
    assert touching_gap(gap, 100) < 2e-6
    assert touching_gap(gap + 4e-4, 100) == pytest.approx(4e-4, abs=3e-6)
    assert touching_gap(gap - 4e-4, 100) == 0.0
    assert touching_gap(np.empty(0), 100) == 0.0
