"""Motion-free baselines: in equilibrium, and exact where equilibrium alone determines the forces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.baselines.motion_free import CANDIDATE_GAP, GAP_SIGMAS, estimate_motion_free, touching_gap
from rodsight.solver.bodies.motion import Snapshot
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.statistics.balance import resultant_norms

from tests.packings import LENGTH, Heap, box, heap_at_rest, rods

NOISE = 1e-5  # [m]
BALANCED = 1e-2  # of the mean force: the force residual is penalised, not excluded
RADIUS = 0.008


@pytest.fixture(scope="module")
def heap() -> Heap:
    return heap_at_rest(columns=4, rows=3)


def snapshot_of(heap: Heap) -> Snapshot:
    n = len(heap.state.position)
    return Snapshot(0.0, heap.state.position, np.zeros(n), heap.state.present, heap.walls.endpoints, NOISE)


def column(heights: tuple[float, ...], *, pressure: float = np.nan, gravity: tuple[float, float] = (0.0, 0.0)):
    """A column of rods that does not touch the sides, and its snapshot; the top may be a plate."""
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
    baseline = estimate_motion_free(heap.packing, [snapshot_of(heap)], 0, NOISE)
    for force in (baseline.balanced, baseline.overlapping):
        fn, ft = force.T
        assert resultant_norms(baseline.contacts, fn, ft, heap.packing.weight).max() < BALANCED * fn.mean()
        assert np.all(np.abs(ft) <= 0.3 * fn + 1e-9)
    np.testing.assert_array_equal(baseline.uniform[:, 1], 0.0)
    assert np.ptp(baseline.uniform[:, 0]) == 0.0


def test_where_equilibrium_determines_the_forces_they_carry_the_weight_above() -> None:
    packing, snapshot = column(STACKED, gravity=(0.0, -9.81))
    baseline = estimate_motion_free(packing, [snapshot], 0, NOISE)
    weight = float(-packing.weight[0, 1])
    assert list(zip(baseline.contacts.i, baseline.contacts.j, strict=True)) == [(0, 1), (0, 4), (1, 2), (2, 3), (3, 6)]
    carried = dict(zip(baseline.contacts.key.tolist(), baseline.balanced[:, 0] - baseline.balanced[-1, 0], strict=True))
    np.testing.assert_allclose(list(carried.values()), weight * np.array([3, 4, 2, 1, 0]), atol=BALANCED * weight)


def test_a_plate_sets_the_size_of_the_forces() -> None:
    packing, snapshot = column(STACKED, pressure=1e4)
    baseline = estimate_motion_free(packing, [snapshot], 0, NOISE)
    np.testing.assert_allclose(baseline.balanced[:, 0], 1e4 * 0.1 * LENGTH, rtol=BALANCED)
    np.testing.assert_allclose(baseline.uniform[:, 0], 1e4 * 2 * RADIUS * LENGTH)


def test_without_load_or_weight_the_forces_on_walls_are_one_on_average() -> None:
    packing, snapshot = column(STACKED)
    baseline = estimate_motion_free(packing, [snapshot], 0, NOISE)
    np.testing.assert_allclose(baseline.balanced[:, 0], 1.0, rtol=BALANCED)


def test_overlaps_are_those_of_the_photographs_around() -> None:
    """Two rods between bottom and top share the force: equilibrium leaves the ratio open, the mean overlap sets it."""
    walls = box(0.08, 2 * RADIUS)
    packing = Packing(rods(RADIUS, RADIUS), LENGTH, Material(0.3, 0.3), np.full(4, np.nan))

    def squeezed_snapshot(first: float, second: float) -> Snapshot:
        """The rods squeezed by so much [m] between bottom and top, evenly."""
        squeezed, ends = np.array([first, second]), walls.endpoints.copy()
        ends[2, :, 1] -= [1.5 * second - 0.5 * first, 1.5 * first - 0.5 * second]  # over x = 0.08 and 0
        position = np.column_stack([[0.02, 0.06], RADIUS - 0.5 * squeezed])
        return Snapshot(0.0, position, np.zeros(2), np.ones(2, np.bool_), ends, NOISE)

    uneven, reverse = squeezed_snapshot(2e-5, 8e-5), squeezed_snapshot(6e-5, 4e-5)
    bottom = estimate_motion_free(packing, [uneven], 0, NOISE).contacts.j == 2
    alone, *_, mean = (
        estimate_motion_free(packing, snapshots, 0, NOISE).overlapping[bottom, 0]
        for snapshots in ([uneven], [uneven, reverse])
    )
    np.testing.assert_allclose(alone, [0.4, 1.6], atol=0.05)
    np.testing.assert_allclose(mean, [0.8, 1.2], atol=0.05)
    np.testing.assert_allclose(estimate_motion_free(packing, [uneven], 0, NOISE).balanced[:, 0], 1.0, atol=BALANCED)


def test_pairs_within_the_noise_are_contacts_and_wider_ones_candidates() -> None:
    sure, wide = 0.9 * GAP_SIGMAS * np.sqrt(2.0) * NOISE, 0.9 * CANDIDATE_GAP * 2.0 * RADIUS
    packing, snapshot = column((RADIUS, 3 * RADIUS, 5 * RADIUS + sure, 7 * RADIUS + sure + wide))
    baseline = estimate_motion_free(packing, [snapshot], 0, NOISE)
    pairs = {divmod(int(key), 8) for key in baseline.contacts.key}
    assert (1, 2) in pairs
    assert (2, 3) not in pairs
    assert set(baseline.contacts.key) < set(baseline.candidates)
    assert (2, 3) in {divmod(int(key), 8) for key in baseline.candidates}


def test_pairs_with_too_small_radii_are_contacts() -> None:
    packing, snapshot = column(STACKED, pressure=1e4)
    small = replace(packing, grains=rods(*np.full(4, 0.97 * RADIUS)))
    baseline = estimate_motion_free(small, [snapshot], 0, NOISE)
    assert [(i, j) for i, j in zip(baseline.contacts.i, baseline.contacts.j, strict=True) if j < 4] == [
        (0, 1),
        (1, 2),
        (2, 3),
    ]


def test_a_missing_rod_has_no_contacts() -> None:
    packing, snapshot = column(STACKED, gravity=(0.0, -9.81))
    lost = replace(snapshot, present=np.array([True, True, True, False]))
    baseline = estimate_motion_free(packing, [snapshot, lost, snapshot], 1, NOISE)
    assert 3 not in baseline.contacts.i
    assert np.isfinite(baseline.overlapping).all()


def test_too_small_radii_shift_the_gaps() -> None:
    rng = np.random.default_rng(0)
    gap = np.concatenate([rng.normal(0.0, 1e-6, 150), rng.uniform(0.0, 1e-3, 400)])
    assert touching_gap(gap, 100) < 2e-6
    assert touching_gap(gap + 4e-4, 100) == pytest.approx(4e-4, abs=3e-6)
    assert touching_gap(gap - 4e-4, 100) == 0.0
    assert touching_gap(np.empty(0), 100) == 0.0
