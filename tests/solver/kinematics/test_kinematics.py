"""Fluctuations, correlations, density and shear bands of displacement fields that are known."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from rodsight.solver.bodies.cell import Cell
from rodsight.solver.kinematics.local_density import local_solid_fraction, triangulate
from rodsight.solver.kinematics.local_motion import measure_local_motion
from rodsight.solver.kinematics.mean_field import (
    FLUCTUATION_EDGES,
    excess_kurtosis,
    fit_mean_field,
    fluctuation_density,
)
from rodsight.solver.kinematics.sequence_kinematics import measure_kinematics
from rodsight.solver.kinematics.shear_bands import find_shear_band, participation
from rodsight.solver.kinematics.spatial_correlation import correlate_in_space, correlation_length

pytestmark = pytest.mark.unit

R, SIDE = 5e-3, 24
GRADIENT = np.array([[0.01, 0.03], [-0.005, -0.02]])


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(11)


@pytest.fixture
def lattice() -> np.ndarray:
    """Centres of a triangular lattice of touching rods."""
    row, column = np.divmod(np.arange(SIDE * SIDE), SIDE)
    return 2.0 * R * np.stack([column + 0.5 * (row % 2), np.sqrt(0.75) * row], axis=1)


def test_mean_field_and_fluctuations_are_separated(lattice, rng):
    added = rng.normal(0.0, 1e-4, lattice.shape)
    x = np.column_stack([lattice, np.ones(len(lattice))])
    added -= x @ np.linalg.lstsq(x, added, rcond=None)[0]  # no affine part
    after = lattice @ (np.eye(2) + GRADIENT).T + np.array([0.3, -0.1]) + added
    after[5] = np.nan
    found = fit_mean_field(lattice, after)
    np.testing.assert_allclose(found.gradient, GRADIENT, atol=2e-5)
    seen = np.arange(len(lattice)) != 5
    np.testing.assert_allclose(found.fluctuation[seen], added[seen], atol=5e-6)
    assert np.isnan(found.fluctuation[5]).all()


def test_fluctuations_in_a_periodic_cell_are_those_of_the_nearest_image(lattice):
    cell = Cell.at_rest(2.0 * R * SIDE * np.diag([1.0, np.sqrt(0.75)]))
    deformed = Cell.at_rest(cell.vectors @ (np.eye(2) + GRADIENT).T)
    after = deformed.wrapped(lattice @ (np.eye(2) + GRADIENT).T + 0.4 * R)  # some leave and enter again
    found = fit_mean_field(lattice, after, (cell, deformed))
    np.testing.assert_allclose(found.gradient, GRADIENT, atol=1e-12)
    assert np.abs(found.fluctuation).max() < 1e-12


def test_density_and_kurtosis_of_gaussian_and_heavy_tails(rng):
    normal = rng.normal(0.0, 2.0, 200_000)
    density = fluctuation_density(normal, 2.0)
    middle = 0.5 * (FLUCTUATION_EDGES[1:] + FLUCTUATION_EDGES[:-1])
    assert density @ np.diff(FLUCTUATION_EDGES) == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(density, np.exp(-0.5 * middle**2) / np.sqrt(2.0 * np.pi), atol=8e-3)
    assert excess_kurtosis(normal) == pytest.approx(0.0, abs=0.05)
    assert excess_kurtosis(rng.laplace(0.0, 1.0, 200_000)) == pytest.approx(3.0, abs=0.3)


def test_correlation_of_vortices_changes_sign_and_of_noise_is_zero(lattice, rng):
    wave = 2.0 * np.pi / (16.0 * 2.0 * R)
    vortices = np.column_stack([np.sin(wave * lattice[:, 1]), np.sin(wave * lattice[:, 0])])
    vortices -= vortices.mean(axis=0)
    found = correlate_in_space(lattice, vortices, 2.0 * R)
    known = np.flatnonzero(np.isfinite(found))
    assert found[known[0]] > 0.8
    assert found[16] < 0.0  # eight diameters: half a wavelength
    assert 2.0 < correlation_length(found) < 8.0
    noise = correlate_in_space(lattice, rng.normal(size=lattice.shape), 2.0 * R)
    assert np.nanmax(np.abs(noise)) < 0.15


def test_correlation_is_the_plain_mean_over_pairs(lattice, rng):
    place, field = 1.02 * lattice[:60], rng.normal(size=(60, 2))
    found = correlate_in_space(place, field, 2.0 * R)
    i, j = np.triu_indices(60, 1)
    apart = np.linalg.norm(place[i] - place[j], axis=1) / (2.0 * R)
    near = (apart >= 1.0) & (apart < 1.5)  # bin 2: nearest neighbours
    expected = np.mean(np.sum(field[i] * field[j], axis=1)[near]) / np.mean(np.sum(field**2, axis=1))
    assert found[2] == pytest.approx(expected, rel=1e-9)


def test_triangular_lattice_of_touching_rods_has_its_solid_fraction(lattice):
    radius = np.full(len(lattice), R)
    triangle = triangulate(lattice, radius)
    found = local_solid_fraction(lattice, radius, triangle)
    edge = (lattice[:, 1] < R) | (lattice[:, 1] > lattice[:, 1].max() - R)
    assert np.isnan(found[edge]).all()  # a wall is no rod: half of what surrounds them is unknown
    inner = np.abs(lattice - lattice.mean(axis=0)).max(axis=1) < 0.6 * SIDE * R
    np.testing.assert_allclose(found[inner], np.pi / np.sqrt(12.0), rtol=1e-9)
    loose = local_solid_fraction(1.1 * lattice, radius, triangulate(1.1 * lattice, radius))
    np.testing.assert_allclose(loose[inner], np.pi / np.sqrt(12.0) / 1.21, rtol=1e-9)


def test_unseen_rods_and_rods_on_a_line_have_no_triangles():
    line = np.column_stack([2.0 * R * np.arange(8), np.zeros(8)])
    assert len(triangulate(line, np.full(8, R))) == 0
    assert np.isnan(local_solid_fraction(line, np.full(8, R), triangulate(line, np.full(8, R)))).all()


def test_band_is_found_with_its_direction_and_thickness(lattice, rng):
    radius = np.full(len(lattice), R)
    direction = np.deg2rad(30.0)
    normal = np.array([-np.sin(direction), np.cos(direction)])
    across = (lattice - lattice.mean(axis=0)) @ normal
    shear = 0.001 + 0.02 * (np.abs(across) < 4.0 * R) + 1e-4 * rng.random(len(lattice))
    band = find_shear_band(lattice, shear, triangulate(lattice, radius))
    assert np.mean(band.member == (np.abs(across) < 4.0 * R)) > 0.99
    assert np.rad2deg(band.angle) == pytest.approx(30.0, abs=4.0)
    assert band.thickness == pytest.approx(8.0 * R, rel=0.25)
    assert participation(shear) < 0.5


def test_homogeneous_or_scattered_shear_is_no_band(lattice, rng):
    triangle = triangulate(lattice, np.full(len(lattice), R))
    assert not find_shear_band(lattice, np.full(len(lattice), 0.01), triangle).member.any()
    scattered = np.where(rng.random(len(lattice)) < 0.05, 0.1, 0.01)
    assert not find_shear_band(lattice, scattered, triangle).member.any()
    assert participation(np.full(50, 0.3)) == pytest.approx(1.0)
    assert participation(np.eye(50)[0]) == pytest.approx(1.0 / 50)


def test_a_rotating_neighbourhood_has_its_rotation(lattice):
    turn = np.array([[np.cos(0.2), -np.sin(0.2)], [np.sin(0.2), np.cos(0.2)]])
    motion = measure_local_motion(lattice, lattice @ turn.T, np.full(len(lattice), R))
    np.testing.assert_allclose(motion.rotation, 0.2, atol=1e-12)


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="many seconds as plain Python")
def test_maps_read_the_motion_over_a_window_that_noise_does_not_hide(lattice, rng):
    frames, noise = 17, 1e-5
    drift = rng.normal(0.0, 8e-6, lattice.shape)  # of a photograph: less than the noise
    step = np.eye(2) + 0.001 * GRADIENT / 0.03
    position = [lattice]
    for _ in range(frames - 1):
        position.append(position[-1] @ step.T + drift)
    measured = np.array(position) + rng.normal(0.0, noise, (frames, *lattice.shape))
    radius, spin = np.full(len(lattice), R), 0.002
    rotation = spin * np.arange(frames)[:, None] * np.ones(len(lattice))
    found = measure_kinematics(measured, rotation, radius, np.full(rotation.shape, noise))
    assert found is not None
    assert found.window == 8
    np.testing.assert_allclose(found.gradient[16], 8 * (step - np.eye(2)), atol=3e-4)
    local = found.rotation[16]
    whole = 0.5 * (step[1, 0] - step[0, 1]) * 8
    assert np.nanmedian(local) == pytest.approx(8 * spin - whole, abs=2e-4)
    np.testing.assert_array_equal(found.window_frames, [1, 2, 4, 8, 16])
    np.testing.assert_allclose(found.window_rms, 8e-6 * found.window_frames, rtol=0.1)  # noise is subtracted
    np.testing.assert_allclose(found.window_strain, found.window_strain[0] * found.window_frames, rtol=0.05)
    assert np.abs(found.window_kurtosis).max() < 0.5
    assert np.isnan(found.shear_strain[0]).all()
    inner = np.abs(lattice - lattice.mean(axis=0)).max(axis=1) < 0.6 * SIDE * R
    assert np.isfinite(found.solid_fraction[:, inner]).all()


def test_one_photograph_has_no_kinematics(lattice):
    flat = np.zeros((1, len(lattice)))
    assert measure_kinematics(lattice[None], flat, np.full(len(lattice), R), flat) is None
