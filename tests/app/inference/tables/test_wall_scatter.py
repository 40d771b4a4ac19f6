"""Walls whose places scatter against the rods that stay at them: they move with these rods."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.correction.tables.wall_scatter import correct_wall_scatter

from ..diagnosis.test_direct_tests import FRAMES, NOISE, PITCH, SIDE, N, box, rolling_tracks
from .test_wall_places import four_walls

SCATTER = 10.0 * NOISE
TOP = 2


def scattering(walls, chosen, *, size=SCATTER):
    """Walls of which some ends have an error that is another in every photograph."""
    endpoints = walls.endpoints.copy()
    endpoints[:, chosen] += size * np.random.default_rng(5).standard_normal(endpoints[:, chosen].shape)
    return replace(walls, endpoints=endpoints)


def scatter_of(walls, direction):
    """Standard deviation in time of the ends (f, 2, 2) of wall 2, or of all walls, in some direction."""
    return walls.endpoints.std(axis=0)[..., direction]


@pytest.mark.parametrize("chosen", [[0, 1, 2, 3], [TOP], [0, TOP]])
def test_walls_that_scatter_move_with_the_rods_that_stay_at_them(chosen):
    tracks, walls = rolling_tracks(step=0.0), four_walls()
    corrected, done = correct_wall_scatter(tracks, scattering(walls, chosen))
    assert [name for name in walls.name if f"'{name}'" in done] == [walls.name[w] for w in chosen]
    assert "if it moves with them" in done
    others = [w for w in range(4) if w not in chosen]
    np.testing.assert_array_equal(corrected.endpoints[:, others], walls.endpoints[:, others])
    for w in chosen:
        across = 1 if w in (0, TOP) else 0
        assert (scatter_of(corrected, across)[w] < 1.5 * NOISE).all()
    given = scattering(walls, chosen).endpoints.mean(axis=0)
    np.testing.assert_allclose(corrected.endpoints.mean(axis=0), given, atol=2.0 * NOISE)


def test_rods_that_photographs_lack_are_left_out():
    tracks, walls = rolling_tracks(step=0.0), scattering(four_walls(), [TOP])
    position, lost = tracks.position.copy(), N - SIDE + np.arange(FRAMES)
    position[np.arange(FRAMES), lost] = np.nan  # another one in each photograph
    corrected, done = correct_wall_scatter(replace(tracks, position=position), walls)
    assert "'top'" in done
    assert (scatter_of(corrected, 1)[TOP] < 1.5 * NOISE).all()


def test_walls_in_their_places_stay():
    tracks, walls = rolling_tracks(step=0.0), four_walls()
    assert correct_wall_scatter(tracks, walls) == (walls, "")
    slight = scattering(walls, [0, 1, 2, 3], size=0.5 * NOISE)
    assert correct_wall_scatter(tracks, slight) == (slight, "")


def test_walls_that_move_steadily_against_their_rods_stay():
    tracks, walls = rolling_tracks(step=0.0), four_walls()
    endpoints = walls.endpoints.copy()
    endpoints[:, TOP, :, 1] += np.linspace(0.0, 1e-3, FRAMES)[:, None]
    retreating = replace(walls, endpoints=endpoints)
    assert correct_wall_scatter(tracks, retreating) == (retreating, "")


def test_a_camera_that_trembles_makes_no_wall_scatter():
    walls, tracks = four_walls(), rolling_tracks(step=0.0)
    rng, middle = np.random.default_rng(4), 0.5 * SIDE * PITCH
    shift, angle = SCATTER * rng.standard_normal((FRAMES, 1, 2)), SCATTER / middle * rng.standard_normal((FRAMES, 1, 1))
    turn = (tracks.position - middle)[..., ::-1] * np.array([-1.0, 1.0])
    trembling = replace(tracks, position=tracks.position + shift + angle * turn)
    assert correct_wall_scatter(trembling, walls) == (walls, "")
    alone = scattering(walls, [TOP]).select(np.array([TOP]))  # one wall shows no difference
    assert correct_wall_scatter(tracks, alone) == (alone, "")


def test_rods_that_scatter_as_much_show_nothing():
    tracks, walls = rolling_tracks(step=0.0, noise=0.7 * SCATTER), scattering(four_walls(), [TOP])
    assert correct_wall_scatter(tracks, walls) == (walls, "")


def test_rods_that_leave_a_wall_do_not_show_its_places():
    tracks, walls = rolling_tracks(step=0.0), scattering(four_walls(), [TOP])
    away = tracks.position.copy()
    away[:, N - SIDE :, 1] -= 4.0 * SCATTER * np.random.default_rng(1).random((FRAMES, SIDE))
    loose = replace(tracks, position=away)
    assert correct_wall_scatter(loose, walls) == (walls, "")


def test_a_wall_keeps_its_sliding_past_the_rods():
    tracks, walls = rolling_tracks(step=0.0), box()
    slid = 3.0 * SCATTER * np.arange(FRAMES)[:, None]
    endpoints = walls.endpoints.copy()
    endpoints[:, 1, :, 0] += slid
    given = scattering(replace(walls, endpoints=endpoints), [1])
    corrected, _ = correct_wall_scatter(tracks, given)
    middle = np.diff([each.endpoints[:, 1, :, 0].mean(axis=1) for each in (given, corrected)], axis=1)
    assert middle[1].mean() == pytest.approx(3.0 * SCATTER, rel=0.15)
    assert middle[1].std() < 0.6 * middle[0].std()


def trembling(walls, w, size):
    """Walls one of which moves to and fro in both directions."""
    endpoints = walls.endpoints.copy()
    endpoints[:, w] += size * (-1.0) ** np.arange(FRAMES)[:, None, None]
    return replace(walls, endpoints=endpoints)


@pytest.mark.parametrize(("w", "rows"), [(0, slice(0, SIDE)), (1, slice(SIDE - 1, N, SIDE))])
def test_rods_that_roll_on_a_wall_do_not_slide_past_it(w, rows):
    tracks, walls = rolling_tracks(step=0.0), trembling(four_walls(), w, SCATTER)
    rolled, turned = tracks.position.copy(), tracks.rotation.copy()
    path = np.linspace(0.0, 20.0 * SCATTER, FRAMES)[:, None] ** 2 / (20.0 * SCATTER)
    rolled[:, rows, w] += path  # along the wall, counter-clockwise around the box
    turned[:, rows] -= path / tracks.radius[rows]
    rolling = replace(tracks, position=rolled, rotation=turned)
    (resting, _), (corrected, _) = (correct_wall_scatter(each, walls) for each in (tracks, rolling))
    np.testing.assert_allclose(corrected.endpoints, resting.endpoints, atol=NOISE)


def test_few_rods_or_photographs_show_nothing():
    tracks, walls = rolling_tracks(step=0.0), trembling(four_walls(), TOP, SCATTER)
    assert correct_wall_scatter(tracks, walls)[1]
    assert correct_wall_scatter(tracks.frames(0, 6), walls.frames(0, 6))[1]
    few = tracks.frames(0, 5), walls.frames(0, 5)
    assert correct_wall_scatter(*few) == (few[1], "")
    for away in (5e-4, PITCH):  # beside the wall, or not near it
        position = tracks.position.copy()
        position[:, N - SIDE + 3 :, 1] -= away  # three rods are left at the wall
        assert correct_wall_scatter(replace(tracks, position=position), walls) == (walls, "")
        position[:, N - SIDE + 3, 1] += away
        assert correct_wall_scatter(replace(tracks, position=position), walls)[1]


def test_rods_that_move_at_a_wall_do_not_touch_it():
    tracks, walls = rolling_tracks(step=0.0), trembling(four_walls(), TOP, 40.0 * NOISE)
    assert correct_wall_scatter(tracks, walls)[1]
    position = tracks.position.copy()
    position[:, N - SIDE :, 1] += 6.0 * NOISE * np.random.default_rng(1).standard_normal((FRAMES, SIDE))
    assert correct_wall_scatter(replace(tracks, position=position), walls) == (walls, "")
