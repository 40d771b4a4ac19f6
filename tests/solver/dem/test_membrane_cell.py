"""A membrane presses on the grains that it meets, compared with closed forms of one and two grains."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.dem.dem_truth import WALL_NAMES, DemSettings
from rodsight.solver.dem.membrane_cell import RAYS, MembraneCell, membrane_width
from rodsight.solver.dem.shear_cell import FrameSize

RADIUS = 0.008  # [m]


def test_a_membrane_meets_the_outermost_grain_and_no_grain_behind_it() -> None:
    radius = np.full(3, RADIUS)
    position = np.array([[0.0, 0.008], [0.02, 0.008], [0.0, 0.020]])
    width = membrane_width(position, radius, 0.1)
    assert width[:2] == pytest.approx([0.0, 2.0 * RADIUS], abs=RADIUS / RAYS)
    assert width[2] == pytest.approx(0.028 - 2.0 * RADIUS, abs=RADIUS / RAYS)  # the part above the second grain
    assert membrane_width(position, radius, 0.02)[2] == pytest.approx(0.02 - 2.0 * RADIUS, abs=RADIUS / RAYS)


def test_the_side_opposite_bears_the_pressure_on_a_grain() -> None:
    settings = DemSettings(pressure=5e4, normal_stiffness=1e6, friction=0.0, wall_friction=0.0)
    cell = MembraneCell(np.array([RADIUS]), np.array([[0.009, 0.03]]), FrameSize(0.1, 0.06), settings)
    cell.rest()
    frame = cell.photograph(0)
    force = {WALL_NAMES[j - 1]: fn for j, fn in zip(frame.j, frame.fn, strict=True)}
    load = settings.pressure * settings.length * 2.0 * RADIUS
    assert force == {"left": pytest.approx(load, rel=1.0 / RAYS)}
    assert frame.unbalance < settings.rest
    assert cell.position[0, 0] == pytest.approx(RADIUS - load / settings.normal_stiffness, rel=0.01)
