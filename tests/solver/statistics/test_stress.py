import numpy as np
import pytest
from rodsight.solver.contacts.connectivity import coordination_number, rattlers
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.statistics.fabric import contact_fabric, fabric_anisotropy
from rodsight.solver.statistics.packing_area import packing_area
from rodsight.solver.statistics.stress import (
    friction_angle,
    grain_stresses,
    love_weber_stress,
    principal_stresses,
    sums_on_walls,
    wall_forces,
    wall_ratio_angle,
)

from tests.packings import LENGTH, box, rods

EXACT = 1e-12


def square_of_four(pressure_x, pressure_y):
    """Four equal grains in a box that touch each other and the walls: forces follow from the pressures."""
    r, side = 0.01, 0.04
    position = np.array([[r, r], [3 * r, r], [r, 3 * r], [3 * r, 3 * r]])
    walls = box(side, side, top_load=pressure_y * side * LENGTH)
    contacts = detect_contacts(rods(*[r] * 4), position, np.ones(4, bool), walls, 1e-9)
    along_x = np.abs(contacts.normal[:, 0]) > 0.5
    fn = np.where(along_x, pressure_x, pressure_y) * side * LENGTH / 2
    return contacts, fn, position, walls


def test_love_weber_stress_is_the_pressure_on_the_walls():
    contacts, fn, position, walls = square_of_four(2e4, 5e4)
    stress = love_weber_stress(contacts, fn, np.zeros_like(fn), position, packing_area(walls, position), LENGTH)
    assert stress == pytest.approx(np.diag([2e4, 5e4]), rel=EXACT, abs=1e-8)
    assert np.rad2deg(friction_angle(stress)) == pytest.approx(np.rad2deg(np.arcsin(3 / 7)))
    major, minor, direction = principal_stresses(stress)
    assert (major, minor) == pytest.approx((5e4, 2e4))
    assert abs(direction) == pytest.approx(np.pi / 2)


def test_stresses_of_grains_sum_to_the_stress():
    contacts, fn, position, _ = square_of_four(2e4, 5e4)
    radius, ratio = np.full(4, 0.01), 4.0 / np.pi  # a square over the circle in it
    alike = grain_stresses(contacts, fn, np.zeros_like(fn), radius, LENGTH)
    assert alike == pytest.approx(ratio * np.tile(np.diag([2e4, 5e4]), (4, 1, 1)), rel=EXACT, abs=1e-8)
    ft = np.where(contacts.with_wall, 0.0, np.linspace(-0.2, 0.2, contacts.count) * fn)
    whole = love_weber_stress(contacts, fn, ft, position, 0.04**2, LENGTH)
    assert np.mean(grain_stresses(contacts, fn, ft, radius, LENGTH), axis=0) == pytest.approx(ratio * whole, abs=1e-8)


def test_wall_ratio_is_that_of_the_loaded_plate():
    contacts, fn, _, walls = square_of_four(2e4, 5e4)
    ft = np.where(contacts.j == 4 + 2, 0.2 * fn, 0.0)
    total = wall_forces(contacts, fn, ft)
    assert total[2] @ walls.outward[2] == pytest.approx(5e4 * 0.04 * LENGTH)
    assert wall_ratio_angle(walls, sums_on_walls(contacts, fn, ft)) == pytest.approx(np.arctan(0.2))


def test_principal_direction_rotates_with_the_stress():
    angle = np.deg2rad(33.0)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    _, _, direction = principal_stresses(turn @ np.diag([3.0, 1.0]) @ turn.T)
    assert direction == pytest.approx(angle)


def test_rattlers_are_removed_until_none_is_left():
    # A chain hanging from a wall: its end has one contact, and without it the next one has one, and so on.
    r = 0.01
    position = np.array([[r, 0.5], [3 * r, 0.5], [5 * r, 0.5]])
    contacts = detect_contacts(rods(r, r, r), position, np.ones(3, bool), box(1.0, 1.0), 1e-9)
    bearing, present = np.ones(contacts.count, bool), np.ones(3, bool)
    assert rattlers(contacts, bearing, present).all()
    assert coordination_number(contacts, bearing, present) == pytest.approx((2 + 2 + 1) / 3)
    assert coordination_number(contacts, bearing, present, without_rattlers=True) == 0.0


def test_fabric_of_even_directions_is_isotropic_and_of_one_is_not():
    angle = np.linspace(0, np.pi, 12, endpoint=False)
    even = np.column_stack([np.cos(angle), np.sin(angle)])
    assert fabric_anisotropy(contact_fabric(even)) == pytest.approx(0.0, abs=EXACT)
    assert fabric_anisotropy(contact_fabric(np.tile([1.0, 0.0], (5, 1)))) == pytest.approx(2.0)
