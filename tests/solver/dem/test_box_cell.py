"""A box whose upper half slides, and a tool in it, compared with closed forms of one rod."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.wall_shapes import circle_parameters
from rodsight.solver.dem.box_cell import BOX_NAMES, BoxCell, BoxSize, Tool
from rodsight.solver.dem.dem_truth import DemFrame, DemSettings

RADIUS = 0.008  # [m]
HELD = DemSettings(pressure=float("nan"), normal_stiffness=1e6, friction=0.0, wall_friction=0.0)
WIDE = BoxSize(0.1, 0.1)
SPLIT = BoxSize(0.1, 0.1, 0.05)


def at(x: float, y: float, size: BoxSize = SPLIT, tool: Tool | None = None) -> BoxCell:
    return BoxCell(np.array([RADIUS]), np.array([[x, y]]), size, HELD, tool=tool)


def drive(cell: BoxCell, *, slide: float = 0.0, push: float = 0.0) -> None:
    steps = 20_000
    cell.run(np.tile([slide, 0.0, push, 0.0], (steps, 1)) / (steps * cell.time_step))


def forces(frame: DemFrame) -> dict[str, float]:
    return {BOX_NAMES[j - 1]: float(fn) for j, fn in zip(frame.j, frame.fn, strict=True)}


def pressed(x: float, y: float, size: BoxSize = SPLIT, tool: Tool | None = None) -> dict[str, float]:
    """Overlap [m] with every wall that a rod touches, after one step."""
    cell = at(x, y, size, tool)
    cell.run(np.zeros((1, 4)))
    return {name: fn / HELD.normal_stiffness for name, fn in forces(cell.photograph(0)).items()}


def test_a_rod_touches_the_half_that_it_is_beside() -> None:
    deep = 1e-5
    assert pressed(0.1 - RADIUS + deep, 0.03) == pytest.approx({"right": deep}, rel=1e-3)
    assert pressed(0.1 - RADIUS + deep, 0.07) == pytest.approx({"upper-right": deep}, rel=1e-3)
    assert pressed(RADIUS - deep, 0.03) == pytest.approx({"left": deep}, rel=1e-3)
    assert pressed(RADIUS - deep, 0.07) == pytest.approx({"upper-left": deep}, rel=1e-3)
    assert pressed(0.1 - RADIUS + deep, 0.07, WIDE) == pytest.approx({"right": deep}, rel=1e-3)


def test_a_slid_half_bears_with_its_edge() -> None:
    cell = at(0.02, 0.044)
    drive(cell, slide=0.016)
    edge = cell.endpoints[BOX_NAMES.index("upper-left")][1]
    assert edge == pytest.approx([0.016, 0.05])
    assert cell.shear == pytest.approx(0.16)
    frame = cell.photograph(0)
    gap = float(np.hypot(*(edge - frame.position[0]))) - RADIUS
    assert gap > -1e-4  # pushed away, or beside it
    assert frame.position[0, 0] > 0.02 + 1e-5


def test_the_plate_follows_its_load() -> None:
    settings = replace(HELD, pressure=1e3)
    cell = BoxCell(np.array([RADIUS]), np.array([[0.05, RADIUS]]), BoxSize(0.1, 2.0 * RADIUS), settings)
    cell.rest()
    load = settings.pressure * 0.1 * settings.length
    assert cell.plate_unbalance < 2e-3
    assert forces(cell.photograph(0)) == pytest.approx({"bottom": load, "top": load}, rel=2e-3)


def test_a_bar_touches_rods_below_it_and_those_at_its_edge() -> None:
    bar = Tool(0.05, 0.06, width=0.03)
    deep = 1e-5
    assert pressed(0.05, 0.06 - RADIUS + deep, WIDE, bar) == pytest.approx({"tool": deep}, rel=1e-3)
    slanted = (RADIUS - deep) / np.sqrt(2.0)
    assert pressed(0.065 + slanted, 0.06 - slanted, WIDE, bar) == pytest.approx({"tool": deep}, rel=1e-3)
    assert pressed(0.065 + RADIUS + deep, 0.06, WIDE, bar) == {}


def test_a_disc_pushes_a_rod_ahead() -> None:
    disc = Tool(0.03, 0.05, radius=0.01)
    cell = at(0.03 + 0.01 + RADIUS, 0.05, WIDE, disc)
    drive(cell, push=8e-3)
    centre, radius, _ = circle_parameters(cell.endpoints)
    assert centre[-1] == pytest.approx([0.038, 0.05])
    assert radius[-1] == pytest.approx(0.01)
    assert cell.sides.tolist() == [0] * 6 + [-1]
    assert cell.position[0, 0] > 0.048 + RADIUS - 1e-4
