"""The motion of a packing as one body is found, removed where it dominates, and changes no force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.motion import FrameMotion, LastSeen, Snapshot, motion_from, motion_to
from rodsight.solver.bodies.strain import RigidMotion, find_dominant_rigid_motion
from rodsight.solver.detection.displacement import displacement_scale

from tests.packings import box

START = np.random.default_rng(0).uniform(0.0, 0.2, (60, 2))
MIDDLE = START - START.mean(axis=0)
ROUND = np.column_stack([-MIDDLE[:, 1], MIDDLE[:, 0]])
OWN = 1e-5 * np.random.default_rng(1).standard_normal((60, 2))  # [m], without a rigid part
OWN -= OWN.mean(axis=0)
OWN -= np.sum(OWN * ROUND) / np.sum(ROUND**2) * ROUND
TURN = RigidMotion(0.01, np.array([3e-3, -1e-3]))
ALL = np.ones(60, bool)
WALLS = box(0.2, 0.2).endpoints
SECOND_ORDER = 1e-3  # relative: of own motion that turns with the packing


def snapshot(time: float, position: np.ndarray, turned: float = 0.0, walls: np.ndarray = WALLS) -> Snapshot:
    return Snapshot(time, position, np.full(60, turned), ALL, walls, 1e-6)


def motion_over(first: Snapshot, last: Snapshot) -> FrameMotion:
    return motion_to(last, LastSeen.never(60).updated(first), first.time, first.endpoints)


def test_the_rigid_motion_is_found_where_it_dominates() -> None:
    found = find_dominant_rigid_motion(START, TURN.moved(START), ALL)
    assert found is not None
    assert found.angle == pytest.approx(TURN.angle)
    assert found.displacement == pytest.approx(TURN.displacement)
    assert find_dominant_rigid_motion(START, START + OWN, ALL) is None
    sheared = START + 0.01 * np.column_stack([START[:, 1], np.zeros(60)])
    assert find_dominant_rigid_motion(START, sheared, ALL) is None
    assert find_dominant_rigid_motion(START, TURN.moved(START), np.arange(60) < 2) is None


def test_a_turned_packing_moves_as_one_that_is_not_turned() -> None:
    plain = motion_over(snapshot(0.0, START), snapshot(2.0, START + OWN))
    turned = motion_over(
        snapshot(0.0, START), snapshot(2.0, TURN.moved(START + OWN), TURN.angle, TURN.moved(WALLS))
    )  # fmt: skip
    back = RigidMotion(-TURN.angle, np.zeros(2))
    assert back.moved(turned.grains.velocity) == pytest.approx(plain.grains.velocity, abs=1e-9)
    assert np.abs(turned.grains.spin).max() < SECOND_ORDER * TURN.angle
    assert np.abs(turned.wall_velocity).max() < 1e-5
    assert turned.velocity_rms == pytest.approx(plain.velocity_rms, rel=0.1)


def test_the_first_motion_is_without_it_too() -> None:
    motion = motion_from(
        snapshot(0.0, START), snapshot(2.0, TURN.moved(START + OWN), TURN.angle, TURN.moved(WALLS))
    )  # fmt: skip
    assert motion.velocity_rms < 1e-5
    assert np.abs(motion.wall_velocity).max() < 1e-5


def test_a_grain_that_was_lost_is_moved_for_every_interval_since_then() -> None:
    lost = replace(snapshot(1.0, TURN.moved(START), TURN.angle), present=np.arange(60) != 7)
    seen = LastSeen.never(60).updated(snapshot(0.0, START)).updated(lost)
    twice = snapshot(2.0, TURN.moved(TURN.moved(START)) + OWN, 2.0 * TURN.angle, TURN.moved(TURN.moved(WALLS)))
    motion = motion_to(twice, seen, 1.0, TURN.moved(WALLS))
    assert np.hypot(*motion.grains.velocity[7]) < 1e-4
    assert abs(motion.grains.spin[7]) < SECOND_ORDER


def test_the_displacement_between_neighbours_does_not_depend_on_it() -> None:
    sigma = np.full(60, 1e-6)
    plain = displacement_scale(START, START + OWN, sigma)
    assert displacement_scale(START, TURN.moved(START + OWN), sigma) == pytest.approx(plain, rel=0.1)
