"""Walls stated away from the rods that touch them are moved to these."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.correction.tables.wall_places import correct_wall_places
from rodsight.tracks import WallTracks

from ..diagnosis.test_direct_tests import FRAMES, NOISE, PITCH, RADIUS, SIDE, N, box, rolling_tracks

TOP, BOTTOM = 1, 0


def misplaced(distance, wall=TOP):
    """The box with one wall moved out of it by a distance [m]."""
    walls = box()
    endpoints = walls.endpoints.copy()
    endpoints[:, wall, :, 1] += distance if wall == TOP else -distance
    return replace(walls, endpoints=endpoints)


def test_walls_that_rods_touch_stay_bit_by_bit():
    walls = box()
    assert correct_wall_places(rolling_tracks(), walls) == (walls, "")


@pytest.mark.parametrize("wall", [TOP, BOTTOM])
@pytest.mark.parametrize(("distance", "side"), [(5e-4, "outside"), (0.03, "outside"), (-3e-3, "inside")])
def test_a_wall_is_moved_to_the_rods_that_touch_it(wall, distance, side):
    corrected, done = correct_wall_places(rolling_tracks(), misplaced(distance, wall))
    name, stated, where = re.match(r"wall '(\w+)' is stated ([\d.]+) mm too far (\w+): ", done).groups()
    assert (name, where) == (box().name[wall], side)
    assert float(stated) == pytest.approx(1e3 * abs(distance), abs=0.02)
    count = int(done.split(": ")[1].split()[0])
    assert 0.95 * FRAMES * SIDE < count <= FRAMES * SIDE
    assert done.endswith(f"{count} rods touch it in its right place, 0 as stated")
    np.testing.assert_allclose(corrected.endpoints, box().endpoints, atol=2.0 * NOISE)


@pytest.mark.parametrize("turn", [0.004, -0.02])
def test_a_wall_is_turned_to_the_rods_that_touch_it(turn):
    walls = misplaced(1e-3)
    endpoints = walls.endpoints.copy()
    endpoints[:, TOP, :, 1] += turn * (endpoints[:, TOP, :, 0] - 0.5 * SIDE * PITCH)
    corrected, done = correct_wall_places(rolling_tracks(), replace(walls, endpoints=endpoints))
    assert "1 mm too far outside" in done
    assert (" and turned by 3.2 mm from end to end" in done) == (turn == -0.02)
    np.testing.assert_allclose(corrected.endpoints[..., 1], box().endpoints[..., 1], atol=6.0 * NOISE)


def test_the_place_counts_from_the_wall_as_it_moves():
    rise = 1e-3 * np.arange(FRAMES)
    tracks, walls = rolling_tracks(), misplaced(2e-3)
    position, endpoints = tracks.position.copy(), walls.endpoints.copy()
    position[..., 1] += rise[:, None]
    endpoints[..., 1] += rise[:, None, None]
    corrected, done = correct_wall_places(replace(tracks, position=position), replace(walls, endpoints=endpoints))
    assert "2 mm too far outside" in done
    np.testing.assert_allclose(corrected.endpoints[:, TOP], endpoints[:, TOP] - [0.0, 2e-3], atol=2.0 * NOISE)


def test_a_wall_is_not_moved_where_no_other_wall_is_touched():
    small = replace(rolling_tracks(), radius=np.full(N, 0.95 * RADIUS))
    assert correct_wall_places(small, box())[1] == ""
    alone = WallTracks(("top",), misplaced(5e-4).endpoints[:, 1:], np.full(1, np.nan))
    assert correct_wall_places(rolling_tracks(), alone) == (alone, "")


def test_a_rough_free_surface_is_no_wall():
    tracks = rolling_tracks()
    position = tracks.position.copy()
    position[:, N - SIDE :, 1] -= np.random.default_rng(2).uniform(0.0, 60.0 * NOISE, SIDE)
    rough, walls = replace(tracks, position=position), misplaced(5e-3)
    assert correct_wall_places(rough, walls) == (walls, "")


def test_a_wall_that_a_third_of_its_rods_touch_stays():
    tracks, walls = rolling_tracks(), box()
    radius = tracks.radius.copy()
    radius[N - 6 :] -= 5e-4  # six of ten rods seem apart from the wall
    assert correct_wall_places(replace(tracks, radius=radius), walls) == (walls, "")


def four_walls():
    """The same box with its sides."""
    width = SIDE * PITCH
    corner = np.array([[0.0, 0.0], [width, 0.0], [width, width], [0.0, width]])
    ends = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
    names = ("bottom", "right", "top", "left")
    return WallTracks(names, np.repeat(ends[None], FRAMES, axis=0), np.array([np.nan, np.nan, 5e4, np.nan]))


def turned(points, degrees, shift):
    angle, middle = np.radians(degrees), 0.5 * SIDE * PITCH
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return middle + np.asarray(shift) + (points - middle) @ turn


@pytest.mark.parametrize(("degrees", "shift"), [(0.5, 0.0), (-0.2, [1e-3, -2e-3]), (0.1, [0.0, 5e-4])])
def test_walls_are_turned_together_as_by_a_camera(degrees, shift):
    walls, tracks = four_walls(), rolling_tracks(step=0.0)
    wrong = replace(walls, endpoints=turned(walls.endpoints, degrees, shift))
    corrected, done = correct_wall_places(tracks, wrong)
    assert float(re.search(r"turned by (\S+)°", done)[1]) == pytest.approx(-degrees, abs=0.01)
    assert done.endswith("as stated")
    np.testing.assert_allclose(corrected.endpoints, walls.endpoints, atol=5.0 * NOISE)


def test_walls_that_are_not_turned_alike_are_not_moved_together():
    walls, tracks = four_walls(), rolling_tracks(step=0.0)
    wider = walls.endpoints + np.sign(walls.endpoints - 0.5 * SIDE * PITCH) * 1e-3  # apart from all rods
    assert correct_wall_places(tracks, replace(walls, endpoints=wider))[1] == ""
    apart = turned(wider, 0.5, 0.0)
    assert correct_wall_places(tracks, replace(walls, endpoints=apart))[1] == ""
    along, across = np.diff(walls.endpoints, axis=2), np.array([[0.0, 1.0], [-1.0, 0.0]])
    slope = np.array([0.004, 0.009, -0.006, -0.012])[:, None, None]  # each about its own middle
    opened = walls.endpoints + 0.5 * slope * np.array([[-1.0], [1.0]]) * (along @ across)
    assert correct_wall_places(tracks, replace(walls, endpoints=opened))[1] == ""
    two = np.array([0, 2])
    less = WallTracks(("bottom", "top"), turned(walls.endpoints[:, two], 0.5, 0.0), walls.pressure[two])
    assert correct_wall_places(tracks, less)[1] == ""


def test_a_wall_in_its_place_needs_as_many_rods_as_another():
    tracks, walls, radius = rolling_tracks(), misplaced(5e-4), rolling_tracks().radius.copy()
    radius[:5] -= 2e-4 * np.arange(1, 6)  # half of the rods at the other wall touch it
    radius[N - np.array([1, 3, 4, 6, 8, 9])] -= 2e-4 * np.array([2, 6, 3, 7, 1, 5])  # and four of ten this one
    assert "0.5 mm too far outside" in correct_wall_places(replace(tracks, radius=radius), walls)[1]
