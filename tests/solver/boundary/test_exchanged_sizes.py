"""Grains stated to be of another size are found by the neighbours that they penetrate or do not touch."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.boundary.exchanged_sizes import find_exchanged_sizes

from tests.golden.forces import STORED

pytestmark = pytest.mark.unit


@pytest.fixture(scope="module")
def packing() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions (f, n, 2) of a simulated shear of 60 rods, their radii and sizes."""
    with np.load(STORED) as stored:
        position, radius = stored["poses/position"], stored["poses/radius"]
    return position, radius, np.unique(radius, return_inverse=True)[1]


def exchanged(radius: np.ndarray, rows: list[int], step: int) -> tuple[np.ndarray, np.ndarray]:
    """Radii of which some are stated as the next size (step 1) or the one before (−1)."""
    sizes = np.unique(radius)
    stated = radius.copy()
    stated[rows] = sizes[np.clip(np.searchsorted(sizes, radius[rows]) + step, 0, len(sizes) - 1)]
    return stated, np.unique(stated, return_inverse=True)[1]


def test_right_sizes_stay_bit_by_bit(packing) -> None:
    position, radius, classes = packing
    assert np.array_equal(find_exchanged_sizes(position, radius, classes), radius)
    one = np.zeros(len(radius), np.int64)
    assert find_exchanged_sizes(position, np.full_like(radius, radius[0]), one).tolist() == [radius[0]] * len(radius)


@pytest.mark.parametrize("step", [1, -1])
def test_exchanged_sizes_are_found(packing, step) -> None:
    position, radius, _ = packing
    rows = [22, 31, 40, 44]  # none at a wall, whose contacts do not count
    stated, classes = exchanged(radius, rows, step)
    wrong = np.flatnonzero(stated != radius)
    assert len(wrong) >= 2
    found = find_exchanged_sizes(position, stated, classes)
    assert np.array_equal(found, radius)


def test_a_lost_grain_keeps_its_size(packing) -> None:
    position, radius, classes = packing
    seen = position.copy()
    seen[:, 12] = np.nan
    assert np.array_equal(find_exchanged_sizes(seen, radius, classes), radius)
    assert np.array_equal(find_exchanged_sizes(np.full_like(seen, np.nan), radius, classes), radius)


def test_overlaps_of_soft_grains_show_no_size(packing) -> None:
    position, radius, _ = packing
    stated, classes = exchanged(radius, [7, 22, 31, 44], 1)
    middle = position.mean(axis=1, keepdims=True)
    soft = middle + 0.97 * (position - middle)
    assert np.array_equal(find_exchanged_sizes(soft, stated, classes), stated)
    less, right = middle + 0.98 * (position - middle), np.unique(radius, return_inverse=True)[1]
    assert np.array_equal(find_exchanged_sizes(less, radius, right), radius)


def test_noise_is_no_overlap(packing) -> None:
    position, radius, _ = packing
    stated, classes = exchanged(radius, [22, 31, 40, 44], 1)
    noisy = position + np.random.default_rng(1).normal(0.0, 5e-5, position.shape)  # the limit is 125 µm
    assert np.array_equal(find_exchanged_sizes(noisy, stated, classes), radius)


def test_nothing_is_exchanged_where_most_would_be(packing) -> None:
    position, radius, _ = packing
    stated, classes = exchanged(radius, list(range(0, len(radius), 2)), 1)
    assert np.array_equal(find_exchanged_sizes(position, stated, classes), stated)


def test_neighbours_of_an_exchanged_grain_keep_their_sizes(packing) -> None:
    position, radius, _ = packing
    stated, classes = exchanged(radius, [40, 13, 47, 15, 41, 6], 1)
    assert np.array_equal(find_exchanged_sizes(position, stated, classes), radius)


# (neighbours, how much too small the hole is for the greater size [m], whether the grain is of that size)
@pytest.mark.parametrize(("neighbours", "narrow", "grows"), [(2, 0.0, False), (3, 0.0, True), (3, 3e-4, False)])
def test_a_loose_grain_in_a_hole_is_greater_only_if_it_touches_three_and_fits(neighbours, narrow, grows) -> None:
    small, large = 0.007, 0.011
    angle = 2.0 * np.pi * np.arange(neighbours) / neighbours
    around = (2.0 * large - narrow) * np.column_stack([np.cos(angle), np.sin(angle)])
    elsewhere = np.column_stack([np.linspace(0.2, 0.5, 4), np.zeros(4)])
    position = np.concatenate([[[0.0, 0.0]], around, elsewhere])[None]
    radius = np.append(small, np.full(neighbours + 4, large))
    found = find_exchanged_sizes(position, radius, np.append(0, np.ones(neighbours + 4, np.int64)))
    assert (found[0] == large) == grows
    assert (found[1:] == large).all()


def row_in_box(stated: list[float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres (f, n, 2) of a row of grains of radius 8 mm that touch a floor, their stated radii, heights (f, n, 1)."""
    x = 0.016 * np.arange(len(stated))
    position = np.repeat(np.stack([x, np.full(len(x), 0.008)], axis=1)[None], 2, axis=0)
    return position, np.array(stated), position[..., 1:].copy()


def test_a_wall_shows_a_grain_that_is_too_large_if_most_others_touch_it() -> None:
    stated = [0.008] * 4 + [0.00816] + [0.008] * 4 + [0.0079] * 30
    position, radius, height = row_in_box(stated)
    classes = np.unique(radius, return_inverse=True)[1]
    position[:, 4, 0] += 0.5  # far from the others: the wall alone shows its size
    position[:, 9:, 1] += 0.5 * np.arange(1, 31)
    height[:, 9:] += 0.5
    assert np.array_equal(find_exchanged_sizes(position, radius, classes), radius)
    found = find_exchanged_sizes(position, radius, classes, height)
    assert found.tolist() == [0.008] * 9 + [0.0079] * 30
    assert np.array_equal(find_exchanged_sizes(position, radius, classes, height - 1e-4), radius)  # a displaced wall


def test_of_sizes_that_are_as_good_the_nearest_one_is_used() -> None:
    """A loose grain inside its neighbours: all lesser sizes touch nothing."""
    angle = np.arange(6) * np.pi / 3.0
    ring = 0.0195 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    position = np.repeat(np.concatenate([[[0.0, 0.0]], ring, ring + 0.3, ring + 0.6])[None], 2, axis=0)
    radius = np.array([0.0122] + [0.008] * 6 + [0.0116] * 3 + [0.007] * 9)
    classes = np.unique(radius, return_inverse=True)[1]
    assert find_exchanged_sizes(position, radius, classes)[0] == 0.0116


def test_a_loose_grain_gets_its_size_back_once_its_neighbours_have_theirs() -> None:
    """A grain of 11 mm, stated 2 % larger, in a hole of six of 8 mm that are stated 2 % larger, too."""
    angle = np.arange(6) * np.pi / 3.0
    out, across = np.stack([np.cos(angle), np.sin(angle)], axis=1), np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    ring = 0.01906 * out
    anchors = [ring + 0.016 * (np.cos(0.6) * out + sign * np.sin(0.6) * across) for sign in (-1.0, 1.0)]
    loose = np.stack([np.arange(30) * 0.1, np.full(30, 1.0)], axis=1)
    position = np.repeat(np.concatenate([[[0.0, 0.0]], ring, *anchors, loose])[None], 2, axis=0)
    radius = np.array([0.01122] + [0.00816] * 6 + [0.008] * 12 + [0.007] * 15 + [0.011] * 15)
    found = find_exchanged_sizes(position, radius, np.unique(radius, return_inverse=True)[1])
    assert found[:7].tolist() == [0.011] + [0.008] * 6
    assert np.array_equal(found[7:], radius[7:])


def test_rods_glued_side_by_side_show_no_sizes(packing) -> None:
    """Rods of the boundary overlap each other, as in a chain for a smooth wall, and keep their stated sizes."""
    position, radius, classes = packing
    chain = np.column_stack([position[..., 0].max() + 0.1 + np.unique(radius)[1:].sum() * np.arange(5), np.zeros(5)])
    glued = np.concatenate([position, np.broadcast_to(chain, (len(position), 5, 2))], axis=1)
    stated = np.append(radius, np.full(5, radius.max()))
    sizes = np.append(classes, np.full(5, classes[radius.argmax()]))
    assert not np.array_equal(find_exchanged_sizes(glued, stated, sizes), stated)
    boundary = np.arange(len(stated)) >= len(radius)
    assert np.array_equal(find_exchanged_sizes(glued, stated, sizes, boundary=boundary), stated)


def test_grains_of_a_class_that_is_stated_too_large_keep_their_sizes() -> None:
    """Groups of three inside each other: smaller, the middle one would lie inside none, but be far from all."""
    x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    lattice = np.stack([x.ravel(), y.ravel()], axis=1)
    groups = [0.012 * lattice[[0, 1, 20]] + [0.1 * number, 1.0] for number in range(10)]
    position = np.repeat(np.concatenate([0.011 * lattice, *groups])[None], 3, axis=0)
    stated = np.concatenate([np.full(400, 0.0055), np.full(30, 1.02 * 0.006)])
    assert np.array_equal(find_exchanged_sizes(position, stated, (stated > 0.0055).astype(np.int64)), stated)
