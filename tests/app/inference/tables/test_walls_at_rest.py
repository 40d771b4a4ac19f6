"""Walls stated at rest: named where rods leave or penetrate them, and moved with the rods that touch them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.correction.tables.walls_at_rest import correct_walls_at_rest
from rodsight.tracks import WallTracks

from ..diagnosis.test_direct_tests import FRAMES, NOISE, PITCH, RADIUS, SIDE, N, box, rolling_tracks

TIME = np.linspace(0.0, 1.0, FRAMES)


def evidence_of(tracks, walls):
    """What is found of walls at rest."""
    return [each.evidence for each in correct_walls_at_rest(tracks, walls)[1]]


@pytest.mark.parametrize("creep", [(4e-4, -3e-4), (0.0, 8e-4)])
def test_a_camera_that_moves_against_all_walls_leaves_no_wall_at_rest(creep):
    shift = np.linspace(0.0, 1.0, FRAMES)[:, None, None] * np.array(creep)
    tracks = rolling_tracks()
    assert evidence_of(replace(tracks, position=tracks.position + shift), box()) == []


def test_a_single_wall_does_not_show_a_camera_that_moves():
    tracks = rolling_tracks()
    rise = np.linspace(0.0, 1e-3, FRAMES)[:, None, None] * np.array([0.0, 1.0])
    top = box().select(np.array([1]))
    (found,) = evidence_of(replace(tracks, position=tracks.position + rise), top)
    assert "penetrate wall 'top'" in found


def test_a_wall_that_rods_penetrate_while_it_rests_is_named():
    tracks, walls = rolling_tracks(), box()
    assert evidence_of(tracks, walls) == []
    rise = np.linspace(0.0, 1e-3, FRAMES)[:, None] * np.linspace(0.0, 1.0, N)
    moved = replace(tracks, position=tracks.position + np.stack([0.0 * rise, rise], axis=-1))
    (found,) = evidence_of(moved, walls)
    assert "penetrate wall 'top'" in found
    endpoints = walls.endpoints.copy()
    endpoints[:, 1, :, 1] += np.linspace(0.0, 1e-3, FRAMES)[:, None]
    assert evidence_of(moved, replace(walls, endpoints=endpoints)) == []
    endpoints[:, 1, :, 1] -= np.linspace(0.0, 2e-3, FRAMES)[:, None]  # it moves, but not with the rods
    assert evidence_of(moved, replace(walls, endpoints=endpoints)) == []


def test_rods_that_come_near_a_wall_do_not_penetrate_it():
    tracks = rolling_tracks()
    walls = box()
    near = tracks.position.copy()
    near[..., 1] += 2e-3 * np.linspace(1.0, 0.0, FRAMES)[:, None]  # they sink to the bottom
    opened = WallTracks(("bottom",), walls.endpoints[:, :1], np.full(1, np.nan))
    assert evidence_of(replace(tracks, position=near), opened) == []
    beyond = near - [0.0, 2e-3]
    (found,) = evidence_of(replace(tracks, position=beyond), opened)
    assert "penetrate wall 'bottom'" in found


def test_rods_in_the_half_of_a_box_that_slides_do_not_penetrate_the_other_half():
    tracks = rolling_tracks()
    side = SIDE * PITCH
    halves = np.array([[[side, 0.0], [side, 0.5 * side]], [[side, 0.5 * side], [side, side]]])
    endpoints = np.repeat(halves[None], FRAMES, axis=0)
    slide = np.linspace(0.0, 5e-3, FRAMES)
    endpoints[:, 1, :, 0] += slide[:, None]
    x, y = (each.ravel() * PITCH + RADIUS for each in np.meshgrid(np.arange(SIDE), np.arange(SIDE)))
    place = np.broadcast_to(np.stack([x, y], axis=-1), (FRAMES, N, 2)).copy()
    place[..., 0] += slide[:, None] * (y > 0.5 * side)
    split = WallTracks(("low", "high"), endpoints, np.full(2, np.nan))
    assert evidence_of(replace(tracks, position=place), split) == []


def moved_top(rise, turn, along):
    """Rods of which the upper row moves with the top of the box, and the box with its top as it moves (f, 2, 2)."""
    tracks, walls = rolling_tracks(0.0), box()
    width, position, ends = SIDE * PITCH, tracks.position.copy(), walls.endpoints[:, 1].copy()
    upper = np.arange(N) >= N - SIDE
    place = position[..., 0] / width - 0.5
    lifted = (rise + turn * place) * TIME[:, None]
    position[..., 1] += np.where(upper, lifted, 0.0)
    position[..., 0] += along * TIME[:, None] * upper
    ends[:, :, 1] += (rise + turn * np.array([0.5, -0.5])) * TIME[:, None]
    ends[:, :, 0] += along * TIME[:, None]
    return replace(tracks, position=position), walls, ends


@pytest.mark.parametrize(("rise", "turn", "along"), [(1e-3, 0.0, 0.0), (4e-4, 0.0, 3e-3), (6e-4, 8e-4, -2e-3)])
def test_a_wall_at_rest_is_moved_with_the_rods_that_touch_it(rise, turn, along):
    tracks, walls, true = moved_top(rise, turn, along)
    corrected, (found,) = correct_walls_at_rest(tracks, walls)
    assert found.corrected
    assert "rods touch it in the last photographs if it moves with them, 0 at rest" in found.evidence
    np.testing.assert_allclose(corrected.endpoints[:, 1], true, atol=5.0 * NOISE)
    np.testing.assert_array_equal(corrected.endpoints[:, 0], walls.endpoints[:, 0])
    again, found = correct_walls_at_rest(tracks, corrected)
    assert found == []
    assert again is corrected


def test_rods_that_roll_on_a_wall_do_not_move_it():
    tracks, walls, true = moved_top(4e-4, 0.0, 3e-3)
    true[:, :, 0] = walls.endpoints[:, 1, :, 0]
    rolled = np.where(np.arange(N) >= N - SIDE, 3e-3 / RADIUS * TIME[:, None], 0.0)
    corrected, (found,) = correct_walls_at_rest(replace(tracks, rotation=rolled), walls)
    assert found.corrected
    np.testing.assert_allclose(corrected.endpoints[:, 1], true, atol=5.0 * NOISE)


def test_a_wall_is_not_moved_where_no_other_wall_is_touched():
    tracks, walls, _ = moved_top(1e-3, 0.0, 0.0)
    position = tracks.position + [0.0, 2e-3] * (np.arange(N) < SIDE)[:, None]  # apart from the bottom, too
    corrected, found = correct_walls_at_rest(replace(tracks, position=position), walls)
    assert [each.corrected for each in found] == [False]
    assert corrected is walls
