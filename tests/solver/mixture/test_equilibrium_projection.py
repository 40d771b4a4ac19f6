"""Projection of a mixed field onto equilibrium, as strict as its standard deviations allow."""

import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.convex.program import (
    ConvexSettings,
    LoadScale,
    assemble_balance,
    project_onto_equilibrium,
    solve_convex_member,
)
from rodsight.solver.mixture import equilibrium_projection
from rodsight.solver.mixture.equilibrium_projection import (
    EXACT,
    MAX_CHANGE,
    MAX_CHANGE_EXACT,
    MAX_CHANGE_RELAXED,
    MAX_CHANGE_SOFT,
    RELAXATION,
    WeightedSum,
    project_mixed_field,
)

UNIT = 20.0  # N
RADIUS = 0.01  # m


def lattice(left_out=0):
    """Make a triangular packing under a plate without some contacts: true f_n, f_t (c,) and the balance."""
    position = np.array(
        [
            [RADIUS * (2 * q + 1 + row % 2), RADIUS * (1 + np.sqrt(3) * row)]
            for row in range(7)
            for q in range(6 - row % 2)
        ]
    )
    grains = Grains.of_rods(np.full(len(position), RADIUS), density=2700.0, length=0.06)
    width, height = 12 * RADIUS, RADIUS * (2 + np.sqrt(3) * 6)
    corner = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=float)
    endpoints = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
    walls = Walls(endpoints, np.zeros((4, 2, 2)), np.array([np.nan, np.nan, 60.0, np.nan]))
    contacts = detect_contacts(grains, position, np.ones(len(position), bool), walls, 1e-9)

    def balance_of(listed):
        return assemble_balance(
            listed, grains, walls, present=np.ones(grains.count, bool), friction=np.full(listed.count, 0.25),
            scale=LoadScale(UNIT),
        )  # fmt: skip

    none = np.zeros(contacts.count)
    true = solve_convex_member(balance_of(contacts), none, none + 1.0, none, none)
    strong = np.argsort(true.fn * ~contacts.with_wall)[::-1][:left_out]
    kept = np.setdiff1d(np.arange(contacts.count), strong)
    return true.fn[kept], true.ft[kept], balance_of(contacts.select(kept))


def change(found, fn, fn_sd):
    return np.sqrt(np.mean((found.fn - fn) ** 2) / np.mean(fn_sd**2))


def project_exactly(balance, fn, ft):
    return project_onto_equilibrium(balance, fn, ft, ConvexSettings(balance=EXACT * ConvexSettings().balance))


def test_consistent_field_is_projected_exactly():
    fn, ft, balance = lattice()
    noisy = fn * (1 + 0.1 * np.random.default_rng(5).normal(size=len(fn)))
    found = project_mixed_field(balance, noisy, ft, 0.2 * fn, ConvexSettings())
    np.testing.assert_array_equal(found.fn, project_exactly(balance, noisy, ft).fn)


@pytest.mark.parametrize("left_out", [4, 8])
def test_missing_pairs_do_not_remove_the_forces_around_them(left_out):
    fn, ft, balance = lattice(left_out)
    fn_sd = np.full(len(fn), 0.1 * fn.mean())
    strict = project_exactly(balance, fn, ft)
    assert change(strict, fn, fn_sd) > MAX_CHANGE_EXACT
    found = project_mixed_field(balance, fn, ft, fn_sd, ConvexSettings())
    assert change(found, fn, fn_sd) < 0.7 * change(strict, fn, fn_sd)
    assert np.corrcoef(found.fn, fn)[0, 1] > np.corrcoef(strict.fn, fn)[0, 1]
    assert np.all(np.abs(found.ft) <= 0.25 * found.fn)


def test_change_of_a_standard_deviation_is_no_missing_pair():
    fn, ft, balance = lattice(left_out=4)
    exact = project_exactly(balance, fn, ft)
    fn_sd = np.full(len(fn), 1.2 * np.sqrt(np.mean((exact.fn - fn) ** 2)) / MAX_CHANGE_EXACT)
    np.testing.assert_array_equal(project_mixed_field(balance, fn, ft, fn_sd, ConvexSettings()).fn, exact.fn)
    certain = project_mixed_field(balance, fn, ft, fn_sd / 2.0, ConvexSettings())
    assert change(certain, fn, fn_sd) < change(exact, fn, fn_sd)


def test_equilibrium_is_exact_for_hard_grains_that_all_find_it_and_else_strict(monkeypatch):
    fn, ft, balance = lattice()
    noisy = fn * (1 + 0.3 * np.random.default_rng(5).normal(size=len(fn)))
    exact, strict = project_exactly(balance, noisy, ft), project_onto_equilibrium(balance, noisy, ft)
    size = np.sqrt(np.mean((exact.fn - noisy) ** 2))

    def project(changed, *, soft=False):
        fn_sd = np.full(len(fn), size / changed)
        return project_mixed_field(balance, noisy, ft, fn_sd, ConvexSettings(), soft=soft).fn

    between = 0.5 * (MAX_CHANGE + MAX_CHANGE_EXACT)
    np.testing.assert_array_equal(project(between), exact.fn)
    np.testing.assert_array_equal(project(0.9 * MAX_CHANGE, soft=True), strict.fn)
    for other in (exact, strict):  # equilibrium is relaxed
        assert np.abs(project(between, soft=True) - other.fn).max() > 0.0
        assert np.abs(project(1.1 * MAX_CHANGE_EXACT) - other.fn).max() > 0.0
    monkeypatch.setattr(equilibrium_projection, "MAX_RESIDUAL", 1e-9)  # no residual is that small
    np.testing.assert_array_equal(project(0.9 * MAX_CHANGE), strict.fn)
    assert np.abs(project(between) - exact.fn).max() > 0.0


def test_equilibrium_is_relaxed_no_further_than_necessary(monkeypatch):
    fn, ft, balance = lattice(left_out=4)
    price = ConvexSettings().balance
    relaxed = [
        project_onto_equilibrium(balance, fn, ft, ConvexSettings(balance=factor * price)).fn for factor in RELAXATION
    ]
    size = [np.sqrt(np.mean((each - fn) ** 2)) for each in relaxed]
    assert size == sorted(size, reverse=True)
    for name in ("MAX_CHANGE", "MAX_CHANGE_EXACT"):
        monkeypatch.setattr(equilibrium_projection, name, 0.0)  # equilibrium is always relaxed
    fn_sd = np.full(len(fn), 1.01 * size[2] / MAX_CHANGE_RELAXED)
    found = project_mixed_field(balance, fn, ft, fn_sd, ConvexSettings())
    np.testing.assert_array_equal(found.fn, relaxed[2])
    fn_sd = np.full(len(fn), 1.01 * size[1] / MAX_CHANGE_SOFT)
    found = project_mixed_field(balance, fn, ft, fn_sd, ConvexSettings(), soft=True)
    np.testing.assert_array_equal(found.fn, relaxed[1])  # the forces of soft grains may change by more


def test_without_contacts_the_projection_is_empty():
    _, _, balance = lattice()
    empty = np.empty(0)
    nothing = balance.__class__(balance.matrix[:, :0], balance.load, empty, UNIT, balance.grains)
    assert len(project_mixed_field(nothing, empty, empty, empty, ConvexSettings()).fn) == 0


def residual(balance, found):
    force = np.concatenate([found.fn, found.ft]) / UNIT
    return np.abs(balance.matrix @ force - balance.load).max()


@pytest.mark.parametrize(("factor", "weight"), [(0.995, 1.0), (1.005, 1.0), (1.01, 0.4)])
def test_field_in_equilibrium_has_the_wanted_sum_of_forces_by_its_weight(factor, weight, monkeypatch):
    fn, ft, balance = lattice()
    noisy = fn * (1 + 0.6 * np.random.default_rng(5).normal(size=len(fn)))
    fn_sd = 10.0 * fn  # equilibrium is strict
    nearest = project_mixed_field(balance, noisy, ft, fn_sd, ConvexSettings())
    wanted = WeightedSum(factor * nearest.fn.sum(), weight)
    monkeypatch.setattr(
        equilibrium_projection, "RAISED", 60.0
    )  # one plate and two side walls leave the sum little room
    found = project_mixed_field(balance, noisy, ft, fn_sd, ConvexSettings(), wanted)
    assert found.fn.sum() == pytest.approx((1.0 + weight * (factor - 1.0)) * nearest.fn.sum(), rel=1e-9)
    assert residual(balance, found) < 2.0 * residual(balance, nearest)
    assert np.all(np.abs(found.ft) <= 0.25 * found.fn + 1e-9)


def test_sum_that_the_loads_forbid_is_approached_but_no_load_is_violated():
    fn, ft, balance = lattice()
    fn_sd = 10.0 * fn
    nearest = project_mixed_field(balance, fn, ft, fn_sd, ConvexSettings())
    found = project_mixed_field(balance, fn, ft, fn_sd, ConvexSettings(), WeightedSum(3.0 * nearest.fn.sum(), 1.0))
    assert nearest.fn.sum() < found.fn.sum() < 1.5 * nearest.fn.sum()
    assert residual(balance, found) < 0.01


def test_sum_that_is_reached_needs_no_second_projection():
    fn, ft, balance = lattice()
    nearest = project_mixed_field(balance, fn, ft, 10.0 * fn, ConvexSettings())
    found = project_mixed_field(
        balance, fn, ft, 10.0 * fn, ConvexSettings(), WeightedSum(1.0005 * nearest.fn.sum(), 1.0)
    )
    np.testing.assert_array_equal(found.fn, nearest.fn)


def test_sum_that_moves_away_is_not_extrapolated(monkeypatch):
    fn, ft, balance = lattice()
    noisy = fn * (1 + 0.6 * np.random.default_rng(5).normal(size=len(fn)))
    nearest = project_mixed_field(balance, noisy, ft, 10.0 * fn, ConvexSettings())
    monkeypatch.setattr(equilibrium_projection, "RAISED", -3.0)  # the second field is smaller where the sum must grow
    found = project_mixed_field(
        balance, noisy, ft, 10.0 * fn, ConvexSettings(), WeightedSum(1.02 * nearest.fn.sum(), 1.0)
    )
    np.testing.assert_array_equal(found.fn, nearest.fn)
