"""Local strain and D²min of grains against fields of displacement that are known."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.bodies.cell import Cell
from rodsight.solver.kinematics.local_motion import measure_local_motion

R = 0.005
SIDE = 8
CENTRE = 3 * SIDE + 4
SHEAR = np.array([[0.0, 0.02], [0.0, 0.0]])


@pytest.fixture
def lattice() -> np.ndarray:
    row, column = np.divmod(np.arange(SIDE * SIDE), SIDE)
    return 2.0 * R * np.stack([column + 0.5 * (row % 2), np.sqrt(0.75) * row], axis=1)


def test_homogeneous_shear_has_the_strain_of_its_gradient_and_no_d2min(lattice):
    motion = measure_local_motion(lattice, lattice @ (np.eye(2) + SHEAR).T, np.full(len(lattice), R))
    np.testing.assert_allclose(motion.strain[:, 0, 1], 0.01, rtol=1e-3)
    assert np.abs(motion.d2min).max() < 1e-20


def test_rotation_of_the_whole_packing_is_no_strain(lattice):
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    motion = measure_local_motion(lattice, lattice @ turn.T, np.full(len(lattice), R))
    assert np.abs(motion.strain).max() < 1e-12


def test_d2min_is_the_mean_square_that_the_least_squares_fit_leaves(lattice):
    rng = np.random.default_rng(3)
    after = lattice + rng.normal(0.0, 1e-4, lattice.shape)
    motion = measure_local_motion(lattice, after, np.full(len(lattice), R))
    distance = np.linalg.norm(lattice - lattice[CENTRE], axis=1)
    near = (distance > 0.0) & (distance < 4.0 * R)
    old, new = lattice[near] - lattice[CENTRE], after[near] - after[CENTRE]
    gradient, *_ = np.linalg.lstsq(old, new, rcond=None)
    assert motion.d2min[CENTRE] == pytest.approx(np.mean(np.sum((new - old @ gradient) ** 2, axis=1)), rel=1e-9)


def test_neighbours_across_a_periodic_edge_deform_with_the_cell(lattice):
    radius = np.full(len(lattice), R)
    old = 2.0 * R * SIDE * np.diag([1.0, np.sqrt(0.75)])
    deformed = (np.eye(2) + SHEAR).T
    cells = (Cell.at_rest(old), Cell.at_rest(old @ deformed))
    motion = measure_local_motion(lattice, lattice @ deformed, radius, cells)
    np.testing.assert_allclose(motion.strain[:, 0, 1], 0.01, rtol=1e-3)
    assert np.abs(motion.d2min).max() < 1e-20


def test_lost_grains_and_those_with_few_neighbours_have_no_value():
    row = np.column_stack([2.0 * R * np.arange(6), np.zeros(6)])
    assert np.isnan(measure_local_motion(row, row, np.full(6, R)).d2min).all()  # on a line
    row[2] = np.nan
    assert np.isnan(measure_local_motion(row, row, np.full(6, R)).strain).all()
