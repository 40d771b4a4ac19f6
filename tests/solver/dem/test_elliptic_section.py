"""Rods of elliptic section: their contacts against exact curves, conserved quantities, and truths in equilibrium."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from rodsight.solver.bodies.grains import Array
from rodsight.solver.dem.dem_truth import DemFrame, DemSettings
from rodsight.solver.dem.elliptic_section import elliptic_radius, tilted_normal
from rodsight.solver.dem.membrane_cell import MembraneCell
from rodsight.solver.dem.shear_cell import FrameSize, ShearCell, shear_photographs
from rodsight.synthetic.dense_packing import prepare_packing
from scipy.optimize import minimize

compiled = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")
RADIUS = (0.008, 0.011)  # [m]
HELD = DemSettings(pressure=float("nan"), normal_stiffness=1e6, time_step_factor=0.02, ovality=0.1)
LEAPFROG = 2e-3  # relative: the first and the last step of a collision of some hundred are cut short
ROUNDING = 1e-10  # relative, of sums over some thousand steps
SECOND_ORDER = 6.0  # greatest factor of the square of the ovality in the errors of gaps, over radius, and of normals
BALANCE = 5e-3  # worst grain over mean force; the pause ends at a mean of 2e-4


def exact_contact(axis: tuple[float, float], ovality: float, apart: Array) -> tuple[float, float]:
    """Least distance [m] of two curves r(φ), the second shifted by `apart` [m], and the direction [rad] of the line."""

    def point(k: int, phi: float) -> Array:
        return RADIUS[k] * (1.0 + ovality * np.cos(2.0 * (phi - axis[k]))) * np.array([np.cos(phi), np.sin(phi)])

    def line(phi: Array) -> Array:
        return apart + point(1, phi[1]) - point(0, phi[0])

    start = np.arctan2(apart[1], apart[0])
    options = {"xatol": 1e-9, "fatol": 1e-13}
    best = minimize(lambda phi: np.hypot(*line(phi)), (start, start + np.pi), method="Nelder-Mead", options=options)
    shortest = line(best.x)
    return float(np.hypot(*shortest)), float(np.arctan2(shortest[1], shortest[0]))


@pytest.mark.parametrize("axis", [(0.3, 1.1), (0.9, 0.7), (2.6, 0.2), (1.4, 1.4)], ids=str)
def test_gap_and_normal_err_by_the_square_of_the_ovality(axis: tuple[float, float]) -> None:
    direction, apart = 0.4, 1.1 * sum(RADIUS)
    nx, ny = np.cos(direction), np.sin(direction)
    error = []
    for ovality in (0.04, 0.02):
        (first, slope), (second, other) = (
            elliptic_radius(radius, ovality, each, nx, ny) for radius, each in zip(RADIUS, axis, strict=True)
        )
        gap, normal = exact_contact(axis, ovality, apart * np.array([nx, ny]))
        x, y, _ = tilted_normal(nx, ny, (slope + other) / apart)
        assert gap == pytest.approx(apart - first - second, abs=SECOND_ORDER * ovality**2 * RADIUS[0])
        assert np.arctan2(y, x) == pytest.approx(normal, abs=SECOND_ORDER * ovality**2)
        error.append(abs(gap - (apart - first - second)))
    assert abs(slope + other) > 0.01 * ovality * apart
    assert error[1] < 0.3 * error[0]  # a quarter, and terms of the third power


def collide(settings: DemSettings) -> tuple[ShearCell, Array, Array]:
    """Collide two rods far from any wall; return the cell, the first places and the first velocities."""
    start = np.array([[0.5, 0.5], [0.5 + np.sqrt(0.022**2 - 0.005**2), 0.505]])
    before = np.array([[0.5, 0.1, 20.0], [-0.3, -0.2, -10.0]])
    cell = ShearCell(np.array(RADIUS), start, FrameSize(1.0, 1.0), settings, velocity=before, axis=np.array([0.8, 2.9]))
    cell.run(np.zeros(6000))
    assert not cell.touching.any()
    return cell, start, before


@pytest.mark.parametrize(("friction", "damping"), [(0.0, 0.0), (0.25, 0.3)])
def test_a_collision_keeps_momenta_and_gains_no_energy(friction: float, damping: float) -> None:
    cell, start, before = collide(replace(HELD, friction=friction, damping_ratio=damping))
    mass, inertia, after = cell.grains.mass, cell.grains.inertia, cell.velocity
    np.testing.assert_allclose(mass @ after[:, :2], mass @ before[:, :2], atol=ROUNDING)

    def moment(position: Array, velocity: Array) -> float:
        arm = position - start[0]
        return float(mass @ (arm[:, 0] * velocity[:, 1] - arm[:, 1] * velocity[:, 0]) + inertia @ velocity[:, 2])

    def energy(velocity: Array) -> float:
        return float(mass @ (velocity[:, :2] ** 2).sum(axis=1) + inertia @ velocity[:, 2] ** 2)

    spun = abs(after[:, 2] - before[:, 2])
    assert spun.min() > 1.0
    if friction == 0.0:  # normal forces alone changed the spins
        assert moment(cell.position, after) == pytest.approx(moment(start, before), rel=ROUNDING)
        assert energy(after) == pytest.approx(energy(before), rel=LEAPFROG)
    else:
        # Friction acts at r, not at r − overlap / 2: a moment of the order of overlap / r is lost.
        assert moment(cell.position, after) == pytest.approx(moment(start, before), rel=3e-2)
        assert energy(after) < 0.95 * energy(before)


@compiled
def test_a_sheared_truth_is_in_equilibrium_with_the_moments_of_normal_forces() -> None:
    cell = prepare_packing(40, np.random.default_rng(3), DemSettings(inertial_number=3e-4, ovality=0.1))
    packed = cell.axis
    (frame,) = shear_photographs(cell, np.deg2rad([1.0]))
    assert np.abs(cell.axis - packed).max() > 1e-3
    assert cell.axis - packed == pytest.approx(frame.rotation)
    force, moment, from_normal = resultants(cell, frame)
    mean = frame.fn.mean()
    assert np.linalg.norm(force, axis=1).max() < BALANCE * mean
    assert (np.abs(moment) / cell.grains.radius).max() < BALANCE * mean
    assert (np.abs(from_normal) / cell.grains.radius).max() > 10.0 * BALANCE * mean


def resultants(cell: ShearCell, frame: DemFrame) -> tuple[Array, Array, Array]:
    """Force (n, 2) [N] and moment (n,) [N m] on every grain, and the part of the moment by normal forces."""
    n, axis, radius = cell.grains.count, cell.axis, cell.grains.radius
    force, moment, from_normal = np.zeros((n, 2)), np.zeros(n), np.zeros(n)
    for i, j, fn, ft in zip(frame.i, frame.j, frame.fn, frame.ft, strict=True):
        bodies = (i, j) if j < n else (i,)
        if j < n:
            branch = frame.position[j] - frame.position[i]
            phi = np.arctan2(branch[1], branch[0])
        else:
            along = frame.endpoints[j - n, 1] - frame.endpoints[j - n, 0]
            phi = np.arctan2(-along[0], along[1])
        wave = [HELD.ovality * np.exp(2j * (phi - axis[k])) for k in bodies]
        reach = [radius[k] * (1.0 + each.real) for k, each in zip(bodies, wave, strict=True)]
        slope = [-2.0 * radius[k] * each.imag for k, each in zip(bodies, wave, strict=True)]
        turn = np.arctan(sum(slope) / np.hypot(*branch)) if j < n else 0.0
        normal = np.array([np.cos(phi - turn), np.sin(phi - turn)])
        pushed = fn * normal + ft * np.array([-normal[1], normal[0]])
        for k, sign, arm, side in zip(bodies, (-1.0, 1.0), reach, slope, strict=False):
            force[k] += sign * pushed
            moment[k] += np.cos(turn) * (side * fn - arm * ft)
            from_normal[k] += np.cos(turn) * side * fn
    return force, moment, from_normal


@compiled
def test_round_rods_have_the_same_forces_whatever_their_axes() -> None:
    def photograph(axis: Array | None) -> DemFrame:
        packed = prepare_packing(40, np.random.default_rng(5), DemSettings())
        size = FrameSize(packed.width, packed.height)
        cell = ShearCell(packed.grains.radius, packed.position, size, packed.settings, axis=axis)
        return cell.photograph(cell.rest())

    first, second = photograph(None), photograph(np.zeros(40))
    np.testing.assert_array_equal(first.fn, second.fn)
    np.testing.assert_array_equal(first.rotation, second.rotation)


def test_elliptic_rods_beside_walls_that_are_not_flat_are_refused() -> None:
    radius, place = np.array([0.008]), np.array([[0.05, 0.05]])
    with pytest.raises(ValueError, match="flat walls"):
        ShearCell(radius, place, FrameSize(0.1, 0.1, corner_radius=0.01), HELD)
    with pytest.raises(ValueError, match="flat walls"):
        MembraneCell(radius, place, FrameSize(0.1, 0.1), replace(HELD, pressure=1e4))
    with pytest.raises(ValueError, match="ovality"):
        replace(HELD, ovality=0.3)
