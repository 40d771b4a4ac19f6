"""Motion from measured positions, and positions within an interval."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.grains import GrainMotion, Grains
from rodsight.solver.bodies.motion import FrameMotion, LastSeen, Snapshot, motion_from, motion_to, no_motion, shear_over
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.bodies.walls import Walls

from tests.packings import LENGTH, box, rods

WALLS = box(0.1, 0.05).endpoints
START = np.array([[0.01, 0.01], [0.03, 0.01], [0.05, 0.01], [0.01, 0.03], [0.03, 0.03]])
OWN = 1e-3 * np.array([[0.0, 2.0], [3.0, 0.0], [-3.0, 1.0], [0.0, -3.0], [0.0, 0.0]])  # [m], motion that is not rigid


def snapshot(time, moved=(0.0, 0.0), turned=0.0, present=None, walls=WALLS, sigma=1e-6):
    present = np.ones(len(START), bool) if present is None else np.array(present, bool)
    return Snapshot(time, START + np.asarray(moved), np.full(len(START), turned), present, walls, sigma)


def seen(*snapshots):
    known = LastSeen.never(len(START))
    for each in snapshots:
        known = known.updated(each)
    return known


def test_velocity_is_displacement_over_interval():
    first = snapshot(10.0)
    walls = WALLS + np.array([0.004, -0.002])
    motion = motion_to(snapshot(12.0, OWN, 0.1, walls=walls), seen(first), 10.0, first.endpoints)
    assert motion.interval == 2.0
    assert motion.ends_here
    assert motion.grains.velocity == pytest.approx(0.5 * OWN)
    assert motion.grains.spin == pytest.approx(np.full(5, 0.05))
    assert motion.wall_velocity == pytest.approx(np.broadcast_to([0.002, -0.001], (4, 2, 2)))


def test_grain_seen_again_has_its_mean_velocity_since_then():
    first, lost = snapshot(0.0), snapshot(1.0, OWN, present=[1, 1, 0, 1, 1])
    motion = motion_to(snapshot(2.0, 4.0 * OWN, 0.2), seen(first, lost), 1.0, WALLS)
    assert motion.grains.velocity[2] == pytest.approx(2.0 * OWN[2])
    assert motion.grains.velocity[0] == pytest.approx(3.0 * OWN[0])
    assert motion.grains.spin[2] == pytest.approx(0.1)
    assert motion.grains.spin[0] == pytest.approx(0.2)


def test_grain_seen_for_the_first_time_has_the_mean_velocity_of_its_neighbours():
    first = snapshot(0.0, present=[1, 1, 1, 1, 0])
    moved = np.array([[0.0, 1e-3], [0.0, 2e-3], [0.0, 3e-3], [0.0, 6e-3], [0.0, 0.0]])
    motion = motion_to(replace(snapshot(1.0), position=START + moved), seen(first), 0.0, WALLS)
    assert motion.grains.velocity[4] == pytest.approx([0.0, 3e-3])
    assert motion.grains.spin[4] == 0.0


def test_between_photographs_everything_moves_evenly():
    first = snapshot(0.0)
    walls = WALLS + np.array([0.0, 8e-3])
    motion = motion_to(snapshot(4.0, OWN, walls=walls), seen(first), 0.0, WALLS)
    for fraction in (0.25, 1.0):
        grains, there = motion.at(fraction, np.full(4, np.nan))
        assert grains.position == pytest.approx(START + fraction * OWN)
        assert there.endpoints == pytest.approx(WALLS + np.array([0.0, 8e-3 * fraction]))
        assert there.velocity == pytest.approx(np.broadcast_to([0.0, 2e-3], (4, 2, 2)))


def test_first_frame_has_the_following_motion_and_no_earlier_instants():
    following = snapshot(2.0, OWN, 0.4, present=[1, 1, 1, 0, 1], walls=WALLS + 2e-3)
    motion = motion_from(snapshot(0.0), following)
    assert not motion.ends_here
    assert motion.grains.velocity[:3] == pytest.approx(0.5 * OWN[:3])
    assert motion.grains.velocity[3].tolist() == [0.0, 0.0]  # it is lost afterwards
    assert motion.grains.spin.tolist() == pytest.approx([0.2, 0.2, 0.2, 0.0, 0.2])
    assert motion.wall_velocity == pytest.approx(np.full((4, 2, 2), 1e-3))
    grains, walls = motion.at(0.3, np.full(4, np.nan))
    assert np.array_equal(grains.position, START)
    assert np.array_equal(walls.endpoints, WALLS)


def test_grain_seen_only_in_the_second_frame_has_zero_velocity_in_the_first():
    motion = motion_from(snapshot(0.0, present=[1, 1, 1, 1, 0]), snapshot(1.0, (1e-3, 0.0)))
    assert motion.grains.velocity[4].tolist() == [0.0, 0.0]


def frame_motion(velocity, sigma, present=None):
    n = len(velocity)
    present = np.ones(n, bool) if present is None else present
    return FrameMotion(
        2.0, GrainMotion(START[:n], np.asarray(velocity, float), np.zeros(n), present), WALLS, 0 * WALLS, True, sigma
    )


def test_velocity_rms_is_over_present_grains():
    motion = frame_motion([[3.0, 4.0], [0.0, 0.0], [70.0, 0.0]], 1e-6, np.array([True, True, False]))
    assert motion.velocity_rms == pytest.approx(np.sqrt(12.5))


def test_velocity_rms_is_at_least_that_of_the_noise():
    assert frame_motion([[1e-9, 0.0]], 1e-6).velocity_rms == pytest.approx(5e-7)
    assert no_motion(snapshot(0.0, sigma=0.0)).velocity_rms > 0.0


@pytest.mark.parametrize("wrong", [0.0, -1.0])
def test_times_must_increase(wrong):
    with pytest.raises(ValueError, match="not after"):
        motion_to(snapshot(wrong), seen(snapshot(0.0)), 0.0, WALLS)
    with pytest.raises(ValueError, match="not after"):
        motion_from(snapshot(0.0), snapshot(wrong))


def test_shear_is_the_difference_of_the_principal_strains():
    gradient = np.array([[1e-3, 4e-3], [0.0, -1e-3]])
    motion = frame_motion(START @ gradient.T / 2.0, 0.0)
    assert shear_over(motion) == pytest.approx(2.0 * np.hypot(1e-3, 2e-3))
    turn = frame_motion(START @ np.array([[0.0, -1e-3], [1e-3, 0.0]]).T, 0.0)
    assert shear_over(turn) == pytest.approx(0.0, abs=1e-12)


def test_mass_is_density_times_section_times_length():
    grains = Grains.of_rods(np.array([0.01, 0.02]), density=1000.0, length=0.5)
    assert grains.mass == pytest.approx([0.05 * np.pi, 0.2 * np.pi])
    assert grains.inertia == pytest.approx(0.5 * grains.mass * np.array([1e-4, 4e-4]))
    assert grains.weight((1.0, -9.81)) == pytest.approx(np.outer([0.05 * np.pi, 0.2 * np.pi], [1.0, -9.81]))


def test_outward_normal_points_away_from_the_packing():
    walls = box(0.1, 0.05)
    assert walls.outward == pytest.approx(np.array([[0, -1], [1, 0], [0, 1], [-1, 0]]))
    assert walls.length == pytest.approx([0.1, 0.05, 0.1, 0.05])


def test_velocity_of_a_rotating_wall_is_linear_along_it():
    velocity = np.zeros((4, 2, 2))
    velocity[0] = [[0.0, 1.0], [0.5, 3.0]]
    walls = Walls(WALLS, velocity, np.full(4, np.nan))
    at = walls.velocity_at(np.zeros(3, np.int32), np.array([[0.0, 0.01], [0.025, 0.0], [0.1, 0.0]]))
    assert at == pytest.approx(np.array([[0.0, 1.0], [0.125, 1.5], [0.5, 3.0]]))


def test_load_is_pressure_times_face():
    packing = Packing(rods(0.01), LENGTH, Material(0.3, 0.3), np.array([np.nan, np.nan, 5e4, np.nan]))
    assert packing.load(WALLS) == pytest.approx([np.nan, np.nan, 5e4 * 0.1 * LENGTH, np.nan], nan_ok=True)
    walls = packing.walls(WALLS)
    assert np.all(walls.velocity == 0.0)
    assert walls.loaded.tolist() == [False, False, True, False]


def test_grains_of_the_boundary_bear_the_load_on_their_width():
    radius = np.array([0.01, 0.01, 0.01, 0.005])
    grains = Grains.of_rods(radius, density=2700.0, length=LENGTH, boundary=np.array([False, True, False, True]))
    packing = Packing(grains, LENGTH, Material(0.3, 0.3), np.array([np.nan, np.nan, 5e4, np.nan]))
    at_top = 0.05 - radius
    position = np.column_stack([[0.02, 0.04, 0.06, 0.08], at_top])
    whole, seen = packing.load(WALLS)[2], np.ones(4, np.bool_)
    assert packing.load(WALLS, placed=(position, seen))[2] == pytest.approx(20.0 / 35.0 * whole)
    away = position - [[0.0, 0.0], [0.0, 2e-3], [0.0, 0.0], [0.0, 0.0]]  # a boundary grain that touches no plate
    assert packing.load(WALLS, placed=(away, seen))[2] == pytest.approx(20.0 / 25.0 * whole)
    assert packing.load(WALLS, placed=(position, seen & grains.boundary))[2] == whole  # nothing else would set a scale
    snapshot = Snapshot(0.0, position, np.zeros(4), seen, WALLS, 1e-5)
    assert packing.walls_of(snapshot).load[2] == pytest.approx(20.0 / 35.0 * whole)
    measured = replace(snapshot, load=np.array([np.nan, np.nan, 70.0, np.nan]))
    assert packing.walls_of(measured).load[2] == pytest.approx(40.0)
    assert packing.mean_pressure(measured) == pytest.approx(70.0 / (0.1 * LENGTH))


@pytest.mark.parametrize(
    "wrong", [{"friction": -0.1}, {"wall_friction": -0.1}, {"formal_weight": 0.6}, {"formal_weight": -0.1}]
)
def test_impossible_materials_are_refused(wrong):
    with pytest.raises(ValueError, match=r"friction|weight"):
        Material(**{"friction": 0.3, "wall_friction": 0.3, **wrong})
