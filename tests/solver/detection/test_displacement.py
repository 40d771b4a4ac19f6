import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.detection.displacement import (
    contact_displacement,
    displacement_scale,
    find_reversals,
    member_intervals,
)

EXACT = 1e-12  # rounding of centimetres
SAMPLING = 0.1  # 400 grains, 8 neighbours each: the rms of a component is known to a few per cent


def lattice() -> np.ndarray:
    return 0.02 * np.stack(np.meshgrid(np.arange(20), np.arange(20)), axis=-1).reshape(-1, 2)


def test_scale_is_the_size_of_a_relative_displacement():
    rng = np.random.default_rng(0)
    step = rng.normal(scale=1e-4, size=(400, 2))
    # A grain against the mean of 8 others that move as much: variance 1 + 1/8.
    expected = 1e-4 * np.sqrt(1 + 1 / 8)
    assert displacement_scale(lattice(), lattice() + step, np.zeros(400)) == pytest.approx(expected, rel=SAMPLING)


def test_noise_is_subtracted_from_the_scale():
    rng = np.random.default_rng(1)
    step = rng.normal(scale=1e-4, size=(400, 2))
    exact = displacement_scale(lattice(), lattice() + step, np.zeros(400))
    noise = rng.normal(scale=5e-5, size=(2, 400, 2))
    noisy = displacement_scale(lattice() + noise[0], lattice() + step + noise[1], np.full(400, 5e-5))
    assert noisy == pytest.approx(exact, rel=SAMPLING)


def test_scale_never_falls_below_noise_nor_to_zero():
    assert displacement_scale(lattice(), lattice(), np.full(400, 3e-6)) == pytest.approx(3e-6)
    assert displacement_scale(lattice(), lattice(), np.zeros(400)) > 0


def test_common_translation_has_no_scale():
    moved = displacement_scale(lattice(), lattice() + 0.01, np.zeros(400))
    assert moved == pytest.approx(displacement_scale(lattice(), lattice(), np.zeros(400)), rel=1e-6)


def test_missing_grains_are_ignored():
    rng = np.random.default_rng(2)
    after = lattice() + rng.normal(scale=1e-4, size=(400, 2))
    whole = displacement_scale(lattice(), after, np.zeros(400))
    after[::10] = np.nan
    assert displacement_scale(lattice(), after, np.zeros(400)) == pytest.approx(whole, rel=SAMPLING)
    with pytest.raises(ValueError, match="fewer than two grains"):
        displacement_scale(lattice(), np.full((400, 2), np.nan), np.zeros(400))


def test_rolling_on_a_wall_is_no_sliding():
    grains = Grains.of_rods(np.array([0.01]), density=2700.0, length=0.06)
    walls = Walls(np.array([[[0.0, 0.0], [0.1, 0.0]]]), np.zeros((1, 2, 2)), np.full(1, np.nan))
    position = np.array([[0.05, 0.01]])
    contacts = detect_contacts(grains, position, np.ones(1, bool), walls, 1e-9)
    angle = 0.01
    rolled = position + np.array([[angle * 0.01, 0.0]])  # to the right, rotating clockwise
    both = (walls.endpoints, walls.endpoints)
    rotation = (np.zeros(1), np.full(1, -angle))
    _, ut = contact_displacement(contacts, grains.radius, (position, rolled), rotation, walls, both)
    np.testing.assert_allclose(ut, 0.0, atol=EXACT)
    # The floor moves to the right below a grain at rest: along +t, which is n = −y rotated by 90°.
    moved = (walls.endpoints, walls.endpoints + np.array([1e-4, 0.0]))
    _, ut = contact_displacement(contacts, grains.radius, (position, position), (np.zeros(1),) * 2, walls, moved)
    np.testing.assert_allclose(ut, 1e-4, atol=EXACT)


def box_motion(shear: list[float]) -> np.ndarray:
    """Four walls of a box whose top is displaced by `shear` (f, 4, 2, 2)."""
    frames = []
    for x in shear:
        corner = np.array([[0, 0], [1, 0], [1 + x, 1], [x, 1]], dtype=float)
        frames.append(np.stack([corner, np.roll(corner, -1, axis=0)], axis=1))
    return np.array(frames)


def test_reversal_of_the_walls_is_found():
    none = np.empty((6, 0, 2))
    assert np.flatnonzero(find_reversals(box_motion([0, 1, 2, 3, 2, 1]), none)).tolist() == [3]
    assert not find_reversals(box_motion([0, 1, 2, 3, 4, 5]), none).any()
    assert np.flatnonzero(find_reversals(box_motion([0, 1, 2, 2, 2, 1]), none)).tolist() == [4]


def test_reversal_is_found_from_the_grains_where_no_wall_moves():
    start = lattice()
    shear = np.array([0, 1, 2, 1, 0]) * 1e-3
    position = np.stack([start + np.outer(start[:, 1], [s, 0.0]) for s in shear])
    position[1, 5] = np.nan
    at_rest = np.repeat(box_motion([0]), 5, axis=0)
    assert np.flatnonzero(find_reversals(at_rest, position)).tolist() == [2]
    assert not find_reversals(at_rest, np.repeat(start[None], 5, axis=0)).any()


def test_no_interval_crosses_a_reversal_or_the_ends():
    reversed_at = np.zeros(12, bool)
    reversed_at[6] = True
    assert member_intervals(4, reversed_at) == ((3, 4), (4, 5), (3, 5), (2, 6))
    assert member_intervals(5, reversed_at) == ((4, 5), (5, 6), (4, 6), (3, 6))
    assert member_intervals(6, reversed_at) == ((5, 6), None, None, (4, 6))
    assert member_intervals(7, reversed_at) == ((6, 7), (7, 8), (6, 8), (6, 9))
    assert member_intervals(0, reversed_at) == (None, (0, 1), None, (0, 2))
    assert member_intervals(11, reversed_at) == ((10, 11), None, None, (9, 11))
    assert member_intervals(4, reversed_at, 3) == ((1, 4), (4, 6), (1, 6), (0, 6))
    assert member_intervals(9, reversed_at, 2) == ((7, 9), (9, 11), (7, 11), (6, 11))
    assert member_intervals(1, np.zeros(2, bool)) == ((0, 1), None, None, None)
    with pytest.raises(ValueError, match="single frame"):
        member_intervals(0, np.zeros(1, bool))
