"""ΣF on grains compared with plain loops and with the kernel of the solver."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.contacts.contacts import Contacts, detect_contacts
from rodsight.solver.nlgs.solve import NlgsSettings, relative_force_residual, solve
from rodsight.solver.statistics.balance import (
    grain_unbalance,
    measure_force_residual,
    resultant_forces,
    resultant_norms,
)

from tests.packings import heap_at_rest, problem_of, squeezed_heap

ROUNDING = 1e-12  # relative: the same sums in the same order
SOLVED = 1e-9  # of the mean force: how far the heap was solved


def plainly(contacts: Contacts, fn: np.ndarray, ft: np.ndarray, weight: np.ndarray) -> np.ndarray:
    total = weight.copy()
    for c in range(contacts.count):
        force = fn[c] * contacts.normal[c] + ft[c] * contacts.tangent[c]  # of i on j
        total[contacts.i[c]] -= force
        if contacts.j[c] < contacts.grain_count:
            total[contacts.j[c]] += force
    return total


def test_many_sets_of_forces_are_summed_independently() -> None:
    rng = np.random.default_rng(5)
    grains, state, walls = squeezed_heap(rng)
    contacts = detect_contacts(grains, state.position, state.present, walls, 2e-4)
    fn, ft = rng.uniform(0.0, 9.0, (2, 3, 4, contacts.count))
    weight = grains.weight((0.3, -9.81))
    found = resultant_forces(contacts, fn, ft, weight)
    assert found.shape == (3, 4, grains.count, 2)
    for row in np.ndindex(3, 4):
        np.testing.assert_allclose(found[row], plainly(contacts, fn[row], ft[row], weight), rtol=ROUNDING)
        np.testing.assert_array_equal(found[row], resultant_forces(contacts, fn[row], ft[row], weight))
    np.testing.assert_allclose(resultant_norms(contacts, fn, ft, weight), np.hypot(found[..., 0], found[..., 1]))


def test_empty_sets_have_sums() -> None:
    heap = heap_at_rest(2, 2)
    weight = heap.packing.weight
    assert resultant_norms(heap.contacts, *np.zeros((2, 0, heap.contacts.count)), weight).shape == (0, 3)
    nothing = heap.contacts.select(np.zeros(heap.contacts.count, bool))
    np.testing.assert_array_equal(resultant_forces(nothing, np.zeros(0), np.zeros(0), weight), weight)


def test_heap_at_rest_is_in_equilibrium_with_its_weight() -> None:
    heap = heap_at_rest()
    here = np.ones(heap.packing.grains.count, bool)
    unbalance = grain_unbalance(heap.contacts, heap.fn, heap.ft, heap.packing.weight, here)
    assert unbalance.max() < SOLVED
    assert measure_force_residual(heap.contacts, heap.fn, heap.ft, heap.packing.weight, here).worst == unbalance.max()
    weightless = np.zeros_like(heap.packing.weight)
    assert grain_unbalance(heap.contacts, heap.fn, heap.ft, weightless, here).min() > 0.1


def test_absent_grains_and_no_forces_give_nan() -> None:
    heap = heap_at_rest(3, 2)
    here = np.array([True, True, False, True, True])
    found = grain_unbalance(heap.contacts, heap.fn, heap.ft, heap.packing.weight, here)
    assert np.isnan(found).tolist() == (~here).tolist()
    none = np.zeros_like(heap.fn)
    assert np.isnan(grain_unbalance(heap.contacts, none, none, heap.packing.weight, here)).all()
    assert measure_force_residual(heap.contacts, none, none, heap.packing.weight, here) == (0.0, 0.0)


@pytest.mark.parametrize("gravity", [(0.0, 0.0), (0.0, -9.81)])
def test_kernel_measures_the_same_residual(gravity: tuple[float, float]) -> None:
    grains, state, walls = squeezed_heap(np.random.default_rng(3), columns=12, rows=12)
    state.present[17] = False
    problem, contacts = problem_of(grains, state, walls, gravity=gravity, threshold=2e-4)
    force = solve(problem, NlgsSettings(sweeps=15)).force
    found = grain_unbalance(contacts, force[:, 0], force[:, 1], grains.weight(gravity), state.present)
    there = found[state.present]
    assert relative_force_residual(problem, force) == pytest.approx((there.max(), there.mean()), rel=1e-9)


def test_worst_residual_is_over_present_grains() -> None:
    heap = heap_at_rest()
    n = heap.packing.grains.count
    fn, nothing = np.random.default_rng(1).uniform(1.0, 9.0, len(heap.fn)), np.zeros((n, 2))
    size = resultant_norms(heap.contacts, fn, heap.ft, nothing)
    worst = int(np.argmax(size))
    for here in (np.ones(n, bool), np.arange(n) != worst):
        found = measure_force_residual(heap.contacts, fn, heap.ft, nothing, here)
        assert found.worst == pytest.approx(size[here].max() / fn.mean())
        assert found.missing == pytest.approx(np.sum(size[here] ** 2) / (2.0 * np.sum(fn**2)))
    assert size[np.arange(n) != worst].max() < 0.99 * size[worst]
