"""Rods between a ring and a core, against closed forms of one rod."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.bodies.wall_shapes import circle_of
from solver.dem.ring import RingCell
from solver.dem.simulation import DemSettings

RADIUS, CORE = 0.008, 0.03  # [m]
RING = CORE + 2.0 * RADIUS
HELD = DemSettings(pressure=float("nan"), normal_stiffness=1e6)
RESTING = 2e-3  # relative: what the dashpots may still add to a force at rest
FIRST_ORDER = 1e-2  # relative: of the springs that give way first


def rods(*angle: float, settings: DemSettings = HELD, squeezed: float = 0.0) -> RingCell:
    place = (CORE + RADIUS) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return RingCell(np.full(len(angle), RADIUS), place, ring=RING - squeezed, core=CORE, settings=settings)


def test_three_rods_share_the_load_of_the_ring_and_pass_it_to_the_core() -> None:
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


def test_a_rod_rolls_between_a_ring_that_stands_and_a_core_that_turns() -> None:
    cell = rods(0.0, squeezed=2e-5)
    cell.rest()
    turn = 0.4
    cell.move_core((0.0, 0.0), turn)
    x, y = cell.position[0]
    middle = 0.5 * CORE * turn / (CORE + RADIUS)  # its centre goes half as fast as the core's face
    assert np.arctan2(y, x) == pytest.approx(middle, rel=FIRST_ORDER)
    assert circle_of(cell.endpoints)[2] == pytest.approx([0.0, turn])


def test_a_core_that_is_pushed_arrives_and_takes_the_rod_in_its_way_along() -> None:
    cell = RingCell(np.array([RADIUS]), np.array([[CORE + RADIUS, 0.0]]), ring=3.0 * RING, core=CORE, settings=HELD)
    steps = 4000
    cell.run(np.tile([2e-3, 1e-3, 0.0, 0.0], (steps, 1)) / (steps * cell.time_step))
    assert cell.core_place == pytest.approx((2e-3, 1e-3))
    assert cell.position[0, 0] > CORE + RADIUS + 1.9e-3
    assert cell.ring == 3.0 * RING


def test_circles_know_no_rolling_friction() -> None:
    with pytest.raises(ValueError, match="rolling"):
        rods(0.0, settings=replace(HELD, rolling_friction=0.1))
