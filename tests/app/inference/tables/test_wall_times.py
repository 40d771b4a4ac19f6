"""Walls that are late or early, by the rods that touch them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.correction.tables.wall_times import correct_wall_times
from rodsight.tracks import WallTracks

from ..diagnosis.test_direct_tests import FRAMES, NOISE, RADIUS, SIDE, N, box, rolling_tracks

RISE = 1e-3  # [m] of the packing and its box from photograph to photograph


@pytest.fixture(scope="module")
def rising():
    """Rods of a packing that rises in its box; the tracks, and the box in time."""
    return raised(RISE * np.arange(FRAMES))


def raised(rise):
    """Rods and their box, both raised from photograph to photograph."""
    tracks, walls = rolling_tracks(), box()
    position, endpoints = tracks.position.copy(), walls.endpoints.copy()
    position[..., 1] += rise[:, None]
    endpoints[..., 1] += rise[:, None, None]
    return replace(tracks, position=position), replace(walls, endpoints=endpoints)


def delayed(walls, lag, chosen=(0, 1)):
    """Chosen walls late by a lag [photographs]; those before the first photograph rest."""
    endpoints = walls.endpoints.copy()
    for wall in chosen:
        endpoints[:, wall, :, 1] -= np.minimum(lag, np.arange(FRAMES))[:, None] * RISE
    return replace(walls, endpoints=endpoints)


def test_walls_in_time_give_no_finding(rising):
    tracks, walls = rising
    assert correct_wall_times(tracks, walls) == (walls, "")


@pytest.mark.parametrize(("lag", "words"), [(1.0, "late by 1.0"), (0.5, "late by 0.5"), (-0.5, "early by 0.5")])
def test_late_and_early_walls_are_moved_to_where_rods_touch_them(rising, lag, words):
    tracks, walls = rising
    corrected, done = correct_wall_times(tracks, delayed(walls, lag))
    assert f"walls 'bottom', 'top' are {words}" in done
    assert "rods touch them then" in done
    np.testing.assert_allclose(corrected.endpoints, walls.endpoints, atol=0.11 * RISE)


def test_one_late_wall_is_named_alone(rising):
    tracks, walls = rising
    _, found = correct_wall_times(tracks, delayed(walls, 0.5, [1]))
    assert found.startswith("wall 'top' is late by 0.5")


def test_fewer_rods_show_a_lag_that_another_wall_shares(rising):
    """Most rods at the bottom are apart from it, so that by itself it shows no lag."""
    tracks, walls = rising
    position = tracks.position.copy()
    position[:, :6, 1] += NOISE * np.arange(10.0, 70.0, 10.0)
    apart = replace(tracks, position=position)
    _, found = correct_wall_times(apart, delayed(walls, 1.0))
    assert found.startswith("walls 'bottom', 'top' are late by 1.0")
    for unlike in (delayed(walls, 1.0, [0]), delayed(delayed(walls, 0.5, [0]), 1.0, [1])):
        assert correct_wall_times(apart, unlike) == (unlike, "")


def test_late_walls_are_grouped_by_their_time_whatever_their_order(rising):
    tracks, walls = rising
    bottom, top = walls.endpoints[:, 0], walls.endpoints[:, 1]
    middle = bottom.mean(axis=1, keepdims=True)
    halves = [np.concatenate([bottom[:, :1], middle], axis=1), np.concatenate([middle, bottom[:, 1:]], axis=1)]
    endpoints = np.stack([halves[0], top, halves[1]], axis=1)
    three = WallTracks(("left half", "top", "right half"), endpoints, np.full(3, np.nan))
    _, found = correct_wall_times(tracks, delayed(delayed(three, 0.5, [0, 2]), 1.0, [1]))
    first, second = found.split("; ")
    assert first.startswith("walls 'left half', 'right half' are late by 0.5")
    assert second.startswith("wall 'top' is late by 1.0")


def test_a_wall_in_steady_motion_is_late_or_misplaced(rising):
    tracks, walls = rising
    endpoints = walls.endpoints.copy()
    endpoints[:, 1, :, 1] -= 0.5 * RISE
    for wrong in (replace(walls, endpoints=endpoints), delayed(walls, 0.5, [1])):
        _, found = correct_wall_times(tracks, wrong)
        assert "late by 0.5 of the time between photographs, or misplaced by up to 0.5 mm" in found


def test_an_unsteady_motion_distinguishes_a_late_wall_from_a_misplaced_one():
    step = RISE * np.where(np.arange(FRAMES) % 4 < 2, 0.5, 1.5)
    rise = np.cumsum(step) - step[0]
    tracks, walls = raised(rise)
    endpoints = walls.endpoints.copy()
    endpoints[:, 1, :, 1] -= (rise - np.interp(np.arange(FRAMES) - 1.0, np.arange(FRAMES), rise))[:, None]
    _, found = correct_wall_times(tracks, replace(walls, endpoints=endpoints))
    assert "late by 1.0" in found
    assert "misplaced" not in found


def test_wrong_radii_and_places_are_no_lag(rising):
    tracks, walls = rising
    small = replace(tracks, radius=np.full(N, RADIUS - 0.5 * RISE))
    assert correct_wall_times(small, walls)[1] == ""  # apart from both walls
    far = replace(walls, endpoints=walls.endpoints - 2.0 * RISE)
    assert correct_wall_times(tracks, far)[1] == ""  # no time helps
    rng = np.random.default_rng(3)
    rough = np.where(np.arange(N) < N - SIDE, RADIUS, RADIUS + rng.normal(0.0, 6.0 * NOISE, N))  # those at the top
    rough = replace(tracks, radius=rough)
    assert correct_wall_times(rough, delayed(walls, 0.5, [1]))[1] == ""  # too few touch at any time


def test_walls_at_rest_are_in_time():
    assert correct_wall_times(rolling_tracks(), box())[1] == ""
