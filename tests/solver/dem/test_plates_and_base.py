"""Plates, driven walls, rolling resistance and friction of a base, compared with closed forms of one or two rods."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.dem.dem_truth import DemFrame, DemSettings, DemTruth
from rodsight.solver.dem.shear_cell import FrameSize, ShearCell

HELD = DemSettings(pressure=float("nan"), normal_stiffness=1e6)
RADIUS = 0.008
WEIGHTLESS_REST = 1e-3  # relative: what the dashpots may still add to a force at rest
FIRST_ORDER = 1e-2  # relative: of the time step, and of the springs that give way first


def rods(*place: tuple[float, float], settings: DemSettings = HELD, velocity: tuple[float, float, float] = (0, 0, 0),
         width: float = 1.0, height: float = 1.0) -> ShearCell:  # fmt: skip
    position = np.array(place)
    return ShearCell(
        np.full(len(position), RADIUS), position, FrameSize(width, height), settings,
        velocity=np.tile(velocity, (len(position), 1)).astype(float),
    )  # fmt: skip


def forces(frame: DemFrame) -> dict[tuple[int, int], float]:
    return {(int(i), int(j)): float(fn) for i, j, fn in zip(frame.i, frame.j, frame.fn, strict=True)}


def test_rod_without_contact_falls_freely() -> None:
    cell = rods((0.5, 0.5), settings=replace(HELD, gravity=(0.0, -9.81)))
    steps = 2000
    cell.run(np.zeros(steps))
    time = steps * cell.time_step
    assert cell.position[0, 1] == pytest.approx(0.5 - 0.5 * 9.81 * time**2, abs=9.81 * time * cell.time_step)


def test_load_on_the_right_side_is_carried_by_a_row_of_rods() -> None:
    """Two rods between the sides: every contact of the row carries the load, and overlaps by load / stiffness."""
    settings = replace(HELD, friction=0.0, wall_friction=0.0)
    cell = rods((RADIUS, 0.5), (3 * RADIUS, 0.5), width=4 * RADIUS - 1e-6, settings=settings)
    cell.rest()
    cell.load(side=40.0)
    cell.rest()
    assert cell.plate_unbalance < settings.rest
    found = forces(cell.photograph(0))
    assert found == pytest.approx({(0, 1): 40.0, (0, 5): 40.0, (1, 3): 40.0}, rel=WEIGHTLESS_REST)
    overlap = 40.0 / settings.normal_stiffness
    assert cell.width == pytest.approx(4 * RADIUS - 3 * overlap, abs=WEIGHTLESS_REST * overlap)
    assert cell.pressure == pytest.approx(
        40.0 * (4 * RADIUS) / (2 * cell.width * cell.height * settings.length), rel=WEIGHTLESS_REST
    )
    assert cell.time_scale == pytest.approx(np.sqrt(cell.grains.mass[0] / (cell.pressure * settings.length)))
    cell.load(side=np.nan)
    held = cell.width
    cell.run(np.zeros(500))
    assert cell.width == held


def test_load_starts_from_the_present_force() -> None:
    """A rod held between the sides by friction would fall if its force vanished for a moment."""
    settings = replace(HELD, gravity=(0.0, -9.81))
    cell = rods((RADIUS, 0.5), width=2 * RADIUS - 2e-5, settings=settings)
    squeeze = 1e-5 * settings.normal_stiffness
    assert squeeze > 4.0 * cell.grains.mass[0] * 9.81
    cell.rest()
    cell.load(side=squeeze)
    assert cell.position[0, 1] == pytest.approx(0.5, abs=1e-6)


def test_driven_walls_reach_their_targets() -> None:
    cell = rods((RADIUS, RADIUS), settings=replace(HELD, pressure=1e3))
    cell.load(top=np.nan)
    cell.move_to(width=0.98, height=0.99, shear=0.01)
    assert (cell.width, cell.height, cell.shear) == pytest.approx((0.98, 0.99, 0.01))
    length = np.linalg.norm(cell.endpoints[:, 1] - cell.endpoints[:, 0], axis=1)
    assert length == pytest.approx([1.0, 1.12, 1.0, 1.12])  # bars keep their lengths
    assert cell.endpoints[1, 0] == pytest.approx([0.98, 0.0])


def test_driven_side_compresses_a_rod_by_its_displacement() -> None:
    speed, steps = 0.2, 30
    settings = replace(HELD, friction=0.0, wall_friction=0.0)
    cell = rods((RADIUS, 0.5), width=2 * RADIUS, settings=settings)
    cell.run(np.tile([0.0, 0.0, -speed], (steps, 1)))
    cell.rest()
    squeezed = 2 * RADIUS - cell.width
    assert squeezed == pytest.approx(speed * steps * cell.time_step, rel=1e-9)
    assert forces(cell.photograph(0)) == pytest.approx(
        {(0, 2): 0.5 * squeezed * HELD.normal_stiffness, (0, 4): 0.5 * squeezed * HELD.normal_stiffness},
        rel=WEIGHTLESS_REST,
    )


@pytest.mark.parametrize(("degrees", "rolls"), [(4.0, False), (8.0, True)], ids=str)
def test_rolling_resistance_holds_a_rod_on_an_incline_up_to_its_angle(degrees: float, rolls: bool) -> None:
    slope, resistance, gravity = np.deg2rad(degrees), 0.1, 9.81
    assert rolls == (np.tan(slope) > resistance)
    settings = replace(
        HELD, rolling_friction=resistance, gravity=(gravity * np.sin(slope), -gravity * np.cos(slope)),
        damping_ratio=0.3,
    )  # fmt: skip
    weight = settings.density * settings.length * np.pi * RADIUS**2 * gravity
    cell = rods((0.1, RADIUS - weight * np.cos(slope) / settings.normal_stiffness), settings=settings)
    steps = 4000
    cell.run(np.zeros(steps))
    speed = gravity * (np.sin(slope) - resistance * np.cos(slope)) * 2.0 / 3.0 * steps * cell.time_step
    assert cell.velocity[0, 0] == pytest.approx(speed if rolls else 0.0, abs=FIRST_ORDER * max(speed, 0.1))


def test_base_stops_a_sliding_and_rotating_rod() -> None:
    deceleration, speed = 5.0, 0.1
    spin = 0.2 * speed / RADIUS
    cell = rods((0.5, 0.5), settings=replace(HELD, base_drag=deceleration), velocity=(speed, 0.0, spin))
    cell.run(np.zeros(round(2.0 * speed / deceleration / cell.time_step)))
    rotation = cell.photograph(0).rotation[0]
    assert np.linalg.norm(cell.velocity[0, :2]) < FIRST_ORDER * speed
    assert cell.position[0, 0] - 0.5 == pytest.approx(speed**2 / (2.0 * deceleration), rel=FIRST_ORDER)
    # Two thirds of the friction at the rim: ω̇ = (2/3) m a R / (½ m R²).
    assert rotation == pytest.approx(spin**2 / (2.0 * 4.0 / 3.0 * deceleration / RADIUS), rel=0.1)


def test_base_holds_a_rod_below_its_friction() -> None:
    cell = rods((0.5, 0.5), settings=replace(HELD, base_drag=5.0, gravity=(2.0, -2.0)))
    cell.run(np.zeros(3000))
    assert np.abs(cell.position[0] - 0.5).max() < 1e-6


def test_wall_without_force_can_be_removed_from_a_truth() -> None:
    settings = replace(HELD, gravity=(-1.0, -9.81))
    weight = settings.density * settings.length * np.pi * RADIUS**2 * 9.81
    sunk = RADIUS - weight / settings.normal_stiffness
    cell = rods((RADIUS - 1e-7, sunk), settings=settings)
    cell.rest()
    truth = DemTruth.of_frames(cell.grains.radius, [cell.photograph(0)], replace(settings, unbalance_limit=1.0))
    assert set(truth.j) == {1, 4}  # bottom and left
    open_box = truth.without_wall("top")
    assert open_box.wall_names == ("bottom", "right", "left")
    assert set(open_box.j) == {1, 3}
    np.testing.assert_array_equal(open_box.endpoints[:, 2], truth.endpoints[:, 3])
    with pytest.raises(ValueError, match="bottom bears force"):
        truth.without_wall("bottom")
