"""Discs in the corners of a shear frame, compared with closed forms of one rod between four of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.dem.boundaries import HEIGHT_RATE, WIDTH_RATE, linkage_motion, move_boundary, wall_surface
from rodsight.solver.dem.dem_truth import DemSettings
from rodsight.solver.dem.shear_cell import FrameSize, ShearCell

SMOOTH = DemSettings(pressure=float("nan"), normal_stiffness=1e6, friction=0.0, wall_friction=0.0)
RADIUS, DISC = 0.008, 0.05
SINE = 0.8  # of the line from the rod to a disc
OVERLAP = 5e-6
DISCS = (4, 5, 6, 7)  # rows of the walls
STIFF = 1e-3  # relative: what the dashpots may still add to a force at rest


def rod_between_discs(settings: DemSettings, shift: float = 0.0, spin: float = 0.0) -> ShearCell:
    """One rod in the middle of a frame so small that it touches all four discs, and no bar.

    shift [m] to the right, spin [rad/s]: of the rod.
    """
    diagonal = 2.0 * (RADIUS + DISC - OVERLAP)
    width, height = np.sqrt(1.0 - SINE**2) * diagonal, SINE * diagonal
    return ShearCell(
        np.array([RADIUS]), np.array([[width / 2 + shift, height / 2]]), FrameSize(width, height, corner_radius=DISC),
        settings, velocity=np.array([[0.0, 0.0, spin]]),
    )  # fmt: skip


def test_discs_touch_a_rod_at_their_rims() -> None:
    cell = rod_between_discs(SMOOTH)
    cell.run(np.zeros(1))
    frame = cell.photograph(0)
    assert frame.endpoints.shape == (8, 2, 2)
    assert (frame.j - 1).tolist() == list(DISCS)
    np.testing.assert_allclose(frame.fn, SMOOTH.normal_stiffness * OVERLAP, rtol=STIFF)
    assert cell.area == pytest.approx(cell.width * cell.height - np.pi * DISC**2)


def test_discs_of_the_plate_carry_its_load() -> None:
    cell = rod_between_discs(SMOOTH)
    cell.rest()
    cell.load(top=60.0)
    cell.rest()
    frame = cell.photograph(0)
    assert cell.plate_force == pytest.approx(60.0, rel=STIFF)
    assert cell.plate_unbalance < SMOOTH.rest
    steep = cell.height / 2 / np.hypot(cell.width / 2, cell.height / 2)
    np.testing.assert_allclose(frame.fn, 60.0 / 2 / steep, rtol=STIFF)


def test_friction_at_discs_is_part_of_the_force_on_the_plate() -> None:
    """A rod that spins and is not in the middle slides on all discs, with unequal forces."""
    cell = rod_between_discs(replace(SMOOTH, wall_friction=0.5), shift=0.4 * OVERLAP, spin=50.0)
    cell.run(np.zeros(3))
    frame = cell.photograph(0)
    np.testing.assert_allclose(abs(frame.ft), 0.5 * frame.fn)
    centre = frame.endpoints[4:].mean(axis=1)
    normal = (centre - frame.position) / np.linalg.norm(centre - frame.position, axis=1)[:, None]
    tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    force = frame.fn[:, None] * normal + frame.ft[:, None] * tangent
    assert cell.plate_force == pytest.approx(force[2:, 1].sum(), rel=1e-9)
    assert abs(frame.ft[2:] @ normal[2:, 0]) > 0.01 * cell.plate_force


@pytest.mark.parametrize("disc", DISCS)
def test_the_surface_of_a_disc_moves_as_its_centre(disc: int) -> None:
    cell, step = rod_between_discs(SMOOTH), 1e-6
    cell.run(np.full(40, 3.0))
    boundary = cell._boundary
    boundary.state[[HEIGHT_RATE, WIDTH_RATE]] = -0.2, 0.1
    drive, before = np.array([0.7, 0.0, 0.0]), cell.endpoints[disc].mean(axis=0)
    place = before + np.array([0.06, -0.08])
    distance, nx, ny, vx, vy, spin = wall_surface(boundary, drive, linkage_motion(boundary, drive), disc, *place)
    assert distance == pytest.approx(0.1 - DISC)
    assert (nx, ny) == pytest.approx((-0.6, 0.8))
    assert spin == 0.0
    move_boundary(boundary, drive, step, 0.0, 0.0)
    assert np.array([vx, vy]) == pytest.approx((cell.endpoints[disc].mean(axis=0) - before) / step, abs=1e-6)
