"""Rods between a ring and a core, compared with closed forms of one rod."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.wall_shapes import circle_parameters
from rodsight.solver.dem.dem_truth import DemSettings
from rodsight.solver.dem.ring_cell import RingCell

RADIUS, CORE = 0.008, 0.03  # [m]
RING = CORE + 2.0 * RADIUS
HELD = DemSettings(pressure=float("nan"), normal_stiffness=1e6)
RESTING = 2e-3  # relative: what the dashpots may still add to a force at rest
FIRST_ORDER = 1e-2  # relative: of the springs that give way first


def rods(*angle: float, settings: DemSettings = HELD, squeezed: float = 0.0) -> RingCell:
    place = (CORE + RADIUS) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return RingCell(np.full(len(angle), RADIUS), place, ring=RING - squeezed, core=CORE, settings=settings)


def test_load_of_the_ring_is_carried_by_three_rods_to_the_core() -> None:
    settings = replace(HELD, pressure=2e3)
    cell = rods(0.0, 2.1, 4.2, settings=settings)
    cell.press()
    cell.rest()
    load = settings.pressure * 2.0 * np.pi * RING * settings.length
    frame = cell.photograph(0)
    assert cell.plate_unbalance < RESTING
    assert frame.j.tolist() == [3, 4] * 3
    assert frame.fn == pytest.approx(load / 3.0, rel=RESTING)
    assert cell.ring == pytest.approx(RING - 2.0 * load / 3.0 / settings.normal_stiffness, abs=1e-7)


@pytest.mark.thorough
def test_rod_rolls_between_fixed_ring_and_rotating_core() -> None:
    cell = rods(0.0, squeezed=2e-5)
    cell.rest()
    rotation = 0.2
    cell.move_core((0.0, 0.0), rotation)
    x, y = cell.position[0]
    middle = 0.5 * CORE * rotation / (CORE + RADIUS)  # its centre moves at half the speed of the core's surface
    assert np.arctan2(y, x) == pytest.approx(middle, rel=FIRST_ORDER)
    assert circle_parameters(cell.endpoints)[2] == pytest.approx([0.0, rotation])


def test_moved_core_pushes_the_rod() -> None:
    cell = RingCell(np.array([RADIUS]), np.array([[CORE + RADIUS, 0.0]]), ring=3.0 * RING, core=CORE, settings=HELD)
    steps = 4000
    cell.run(np.tile([2e-3, 1e-3, 0.0, 0.0], (steps, 1)) / (steps * cell.time_step))
    assert cell.core_place == pytest.approx((2e-3, 1e-3))
    assert cell.position[0, 0] > CORE + RADIUS + 1.9e-3
    assert cell.ring == 3.0 * RING


def test_rolling_friction_between_circles_is_refused() -> None:
    with pytest.raises(ValueError, match="rolling"):
        rods(0.0, settings=replace(HELD, rolling_friction=0.1))
