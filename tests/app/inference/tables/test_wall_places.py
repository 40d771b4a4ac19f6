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
