from itertools import pairwise

import numpy as np
import pytest
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.statistics.force_chains import find_force_chains, symmetric_grain_stresses
from rodsight.solver.statistics.stress import love_weber_stress

from tests.packings import LENGTH, box, rods, squeezed_heap

R = 0.01  # [m]
TOUCH = 1e-9  # [m] within which centres placed by trigonometry touch
WIDE = box(1.0, 1.0)


def path(start, *angles):
    """Centres of grains that touch one another in file, each at an angle [degrees] from the one before."""
    steps = 2 * R * np.array([[np.cos(a), np.sin(a)] for a in np.deg2rad(angles)])
    return np.array(start) + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])


def chains_of(position, force, *, idle=0):
    """Chains where contact (i, j) carries force[(i, j)] [N] and any other none; `idle` grains stand far off."""
    position = np.vstack([position, [[0.03 * k + 0.03, 0.95] for k in range(idle)]]) if idle else position
    grains, present = rods(*[R] * len(position)), np.ones(len(position), bool)
    contacts = detect_contacts(grains, position, present, WIDE, TOUCH)
    fn = np.array([force.get((int(i), int(j)), 0.0) for i, j in zip(contacts.i, contacts.j, strict=True)])
    assert (fn > 0).sum() == len(force), "every named contact exists"
    return find_force_chains(contacts, fn, np.zeros_like(fn), position, present, grains, LENGTH)


def in_file(*rows, force=10.0):
    return {(min(a, b), max(a, b)): force for a, b in pairwise(rows)}


def test_stress_of_a_squeezed_grain_is_its_force_over_its_section():
    # Three grains between two walls: two forces F at ± R on each, so σ = 2 F R / (π R² L) along the file.
    position = np.array([[R, 0.5], [3 * R, 0.5], [5 * R, 0.5]])
    grains = rods(R, R, R)
    contacts = detect_contacts(grains, position, np.ones(3, bool), box(6 * R, 1.0), TOUCH)
    stress = symmetric_grain_stresses(contacts, np.full(4, 30.0), np.zeros(4), position, grains, LENGTH)
    assert stress[:, 0, 0] == pytest.approx(2 * 30.0 / (np.pi * R * LENGTH))
    assert np.abs(stress[:, 1, 1]).max() < 1e-9 * stress[0, 0, 0]


def test_stresses_of_grains_add_up_to_that_of_the_packing():
    rng = np.random.default_rng(3)
    grains, state, walls = squeezed_heap(rng)
    contacts = detect_contacts(grains, state.position, state.present, walls, 3e-4)
    fn, ft = rng.exponential(10.0, contacts.count), rng.normal(0.0, 2.0, contacts.count)
    each = symmetric_grain_stresses(contacts, fn, ft, state.position, grains, LENGTH)
    total = np.einsum("n,nab->ab", np.pi * grains.radius**2, each)
    packing = love_weber_stress(contacts, fn, ft, state.position, 1.0, LENGTH)
    assert total == pytest.approx(0.5 * (packing + packing.T), rel=1e-9)


def test_straight_column_is_one_chain():
    found = chains_of(path([0.5, 0.3], 90, 90, 90, 90), in_file(0, 1, 2, 3, 4), idle=5)
    # The ends bear on one side only: half the stress of the others, still above the mean of 4 / 10.
    assert found.count == 1
    assert found.length.tolist() == [5]
    assert found.chain.tolist() == [0] * 5 + [-1] * 5
    assert len(found.link) == 4
    assert np.abs(found.direction[:5]) == pytest.approx(np.pi / 2)


def test_two_grains_are_no_chain():
    assert chains_of(path([0.5, 0.3], 90), in_file(0, 1), idle=4).count == 0


def test_parallel_columns_are_separate_chains():
    position = np.vstack([path([0.6, 0.3], 90, 90), path([0.3, 0.3], 90, 90, 90)])
    found = chains_of(position, in_file(0, 1, 2) | in_file(3, 4, 5, 6), idle=7)
    assert found.length.tolist() == [3, 4]
    assert found.chain[:7].tolist() == [0, 0, 0, 1, 1, 1, 1]


def test_column_below_the_mean_stress_is_no_chain():
    position = np.vstack([path([0.6, 0.3], 90, 90), path([0.3, 0.3], 90, 90, 90)])
    found = chains_of(position, in_file(0, 1, 2, force=1.0) | in_file(3, 4, 5, 6, force=10.0))
    assert found.chain.tolist() == [-1, -1, -1, 0, 0, 0, 0]


def test_chain_may_bend_but_not_by_a_right_angle():
    bent = chains_of(path([0.5, 0.3], 90, 90, 60, 60), in_file(0, 1, 2, 3, 4), idle=5)
    assert bent.length.tolist() == [5]
    # At a right angle the corner grain leans to the stronger side, 0-1-2, and the other side leaves it.
    corner = chains_of(
        path([0.5, 0.3], 90, 90, 0, 0), in_file(0, 1, 2, force=12.0) | in_file(2, 3, 4, force=10.0), idle=5
    )
    assert corner.chain[:5].tolist() == [0, 0, 0, -1, -1]


def test_zigzag_is_a_chain_only_within_the_greatest_angle():
    # Links at ± 40° and ± 50° from the vertical: by symmetry the inner grains' σ₁ is vertical, or horizontal.
    force = in_file(0, 1, 2, 3, 4, 5)
    assert chains_of(path([0.5, 0.3], 50, 130, 50, 130, 50), force, idle=6).length.tolist() == [6]
    turned = path([0.5, 0.3], 40, 140, 40, 140, 40)
    assert chains_of(turned, force, idle=6).count == 0


def test_links_on_one_side_of_a_grain_make_no_chain_through_it():
    # Two grains rest on one at ± 35° from the vertical, and nothing is below it.
    position = np.vstack([path([0.5, 0.3], 55), path([0.5, 0.3], 125)[1:]])
    assert chains_of(position, {(0, 1): 10.0, (0, 2): 10.0}, idle=5).count == 0
    # With two grains below it, the chain branches: one chain of five.
    below = path([0.5, 0.3], -90, -90)[1:]
    position = np.vstack([position, below])
    force = {(0, 1): 10.0, (0, 2): 10.0, (0, 3): 16.0, (3, 4): 16.0}
    assert chains_of(position, force, idle=9).length.tolist() == [5]


@pytest.mark.parametrize("order", [[0, 1, 2, 3, 4], [4, 3, 0, 1, 2]])
def test_link_needs_both_of_its_grains(order):
    # A column 0-1-2 ends on grain 2 of a row 3-2-4 that carries far more, so that its σ₁ lies along the row.
    position = np.vstack([path([0.5, 0.3], 90, 90), [[0.5 - 2 * R, 0.3 + 4 * R], [0.5 + 2 * R, 0.3 + 4 * R]]])
    place = np.argsort(order)  # grain k of the drawing is numbered place[k]
    force = {(0, 1): 20.0, (1, 2): 20.0, (3, 2): 50.0, (2, 4): 50.0}
    named = {(min(place[a], place[b]), max(place[a], place[b])): value for (a, b), value in force.items()}
    found = chains_of(position[order], named, idle=9)
    assert found.chain[place].tolist() == [-1, -1, 0, 0, 0]


def test_absent_grains_are_excluded_from_mean_and_chains():
    # σ₁ is as 10, 20 and 10: only the middle grain is above the mean of these three.
    position = np.vstack([path([0.5, 0.3], 90, 90), np.full((4, 2), np.nan)])
    grains, present = rods(*[R] * 7), np.arange(7) < 3
    contacts = detect_contacts(grains, position, present, WIDE, TOUCH)
    found = find_force_chains(contacts, np.full(2, 10.0), np.zeros(2), position, present, grains, LENGTH)
    assert found.count == 0
    assert not found.major[3:].any()


def test_no_forces_and_no_grains_make_no_chains():
    position = path([0.5, 0.3], 90, 90)
    assert chains_of(position, {}).count == 0
    grains, absent = rods(R, R, R), np.zeros(3, bool)
    contacts = detect_contacts(grains, position, absent, WIDE, TOUCH)
    none = find_force_chains(contacts, np.empty(0), np.empty(0), position, absent, grains, LENGTH)
    assert none.count == 0
    assert none.length.shape == (0,)


def test_by_default_a_link_lies_within_45_degrees():
    def zigzag(steep):  # [°] of the links, from the horizontal
        position = path([0.5, 0.3], *[steep, 180 - steep] * 2, steep)
        return chains_of(position, in_file(0, 1, 2, 3, 4, 5), idle=6).count

    assert zigzag(47) == 1
    assert zigzag(43) == 0

    def bent(steep):  # a column bears much, a branch of it little: σ₁ of the common grain is 84° from the horizontal
        force = in_file(0, 1, 2, force=100.0) | in_file(2, 3, 4, force=20.0)
        return chains_of(path([0.3, 0.3], 90, 90, steep, steep), force, idle=28).length.tolist()

    assert bent(42) == [5]
    assert bent(38) == [3]
