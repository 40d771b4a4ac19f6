"""Outer grains of a packing: at its free surface and at the rims of holes, not along walls."""

import numpy as np
import pytest
from rodsight.solver.bodies.grains import Array
from rodsight.solver.bodies.outer_grains import find_outer_grains
from rodsight.solver.bodies.wall_shapes import IN, OUT, circle_ends
from rodsight.solver.bodies.walls import Walls
from scipy.spatial import KDTree

R = 0.01
NO_WALLS = Walls.at_rest(np.empty((0, 2, 2)))


def hexagonal(inner: float, outer: float) -> Array:
    """Centres between two circles."""
    rows, columns = np.mgrid[-20:21, -20:21]
    position = 2.02 * R * np.stack([columns + 0.5 * (rows % 2), np.sqrt(0.75) * rows], axis=-1).reshape(-1, 2)
    position += np.random.default_rng(1).uniform(-2e-4, 2e-4, position.shape)
    return position[(np.hypot(*position.T) < outer) & (np.hypot(*position.T) > inner)]


def outer_of(position: Array, walls: Walls = NO_WALLS):
    return find_outer_grains(np.full(len(position), R), position, np.ones(len(position), bool), walls)


@pytest.mark.thorough
@pytest.mark.parametrize("inner", [-1.0, 0.08])
def test_outer_grains_are_those_with_missing_neighbours(inner: float) -> None:
    position = hexagonal(inner, 0.3)
    neighbours = np.array([len(near) - 1 for near in KDTree(position).query_ball_point(position, 2.2 * R)])
    assert outer_of(position).outer.tolist() == (neighbours < 6).tolist()


def test_missing_grain_inside_makes_no_free_surface() -> None:
    position = hexagonal(-1.0, 0.2)
    middle = int(np.argmin(np.hypot(*position.T)))
    whole = outer_of(position).outer
    assert outer_of(np.delete(position, middle, axis=0)).outer.tolist() == np.delete(whole, middle).tolist()


def test_surfaces_of_holes_are_marked_and_point_inwards() -> None:
    found = outer_of(hexagonal(0.08, 0.3))
    away = np.einsum("sk,sk->s", found.place, found.outward)
    assert found.inner.sum() > 20
    assert np.all(np.hypot(*found.place[found.inner].T) < 0.1)
    assert np.all(away[found.inner] < 0.0)
    assert np.all(away[~found.inner] > 0.0)


def test_a_crater_is_a_surface_and_no_hole() -> None:
    x, y = np.meshgrid(np.arange(11), np.arange(7))
    place = R + 2.0 * R * np.stack([x.ravel(), y.ravel()], axis=1)
    place += np.random.default_rng(2).uniform(0, 1e-5, place.shape)
    dug = place[np.hypot(place[:, 0] - 11 * R, place[:, 1] - 15 * R) > 9 * R]
    corner = np.array([[0.0, 0.6], [0.0, 0.0], [22 * R, 0.0], [22 * R, 0.6]])
    found = outer_of(dug, Walls.at_rest(np.stack([corner[:-1], corner[1:]], axis=1)))
    assert not found.inner.any()
    assert [side.name for side in found.sides(~found.inner)] == ["at the top"]


@pytest.mark.thorough
def test_grains_along_walls_are_not_outer() -> None:
    x, y = np.meshgrid(np.arange(8), np.arange(6))
    position = (
        R + 2.0 * R * np.stack([x.ravel(), y.ravel()], axis=1) + np.random.default_rng(2).uniform(0, 1e-5, (48, 2))
    )
    corner = np.array([[0.0, 0.0], [0.16, 0.0], [0.16, 0.12], [0.0, 0.12]])
    box = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
    assert not outer_of(position, Walls.at_rest(box)).outer.any()
    without_right = outer_of(position, Walls.at_rest(np.delete(box, 1, axis=0)))
    assert set(np.flatnonzero(without_right.outer)) == set(range(7, 48, 8))
    assert np.all(without_right.outward[:, 0] > 0.9)


@pytest.mark.thorough
def test_grains_along_circular_walls_are_not_outer() -> None:
    position = hexagonal(0.08, 0.3)
    distance = np.hypot(*position.T)
    rings = circle_ends(np.zeros((2, 2)), np.array([distance.max() + R, distance.min() - R]), np.zeros(2))
    side = np.array([IN, OUT], np.int8)
    assert outer_of(position, Walls.at_rest(rings, side=side)).outer.sum() < 0.5 * outer_of(position).outer.sum()
    within = outer_of(position, Walls.at_rest(rings[:1], side=side[:1]))
    assert np.all(within.inner)
