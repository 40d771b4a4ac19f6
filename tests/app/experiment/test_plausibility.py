"""Tracks, radii and walls that do not fit together are reported."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.config.tuning_sections import MaterialSection
from rodsight.experiment.plausibility import (
    PackingSources,
    check_inside,
    expected_rods,
    implausible_loads,
    neighbour_spacing,
    open_sides,
    rods_beyond_ends,
    rods_cut_by_walls,
)
from rodsight.process.errors import InputError
from rodsight.solver.bodies.wall_shapes import STRAIGHT
from rodsight.tracks import Tracks, TrackStatus, WallTracks

RADIUS = 0.01  # [m]
SOURCES = PackingSources(("tracks.csv", "column radius"), None, {STRAIGHT: Path("box/walls.csv")})


def row_of_rods(count: int) -> Tracks:
    """Rods side by side on the line y = 0, the first touching x = 0."""
    x = RADIUS * (1.0 + 2.0 * np.arange(count))
    return tracks_at(np.stack([x, np.full(count, RADIUS)], axis=1))


def tracks_at(place: np.ndarray) -> Tracks:
    """Rods at these centres (n, 2) in one photograph."""
    position, count = place[None], len(place)
    given = np.full((1, count), TrackStatus.GIVEN, np.uint8)
    zero = np.zeros((1, count))
    return Tracks(np.arange(count), np.full(count, RADIUS), np.zeros(1), position, zero, zero, zero * np.nan, given)


def floor(length: float) -> WallTracks:
    return WallTracks(("floor",), np.array([[[[0.0, 0.0], [length, 0.0]]]]), np.array([np.nan]))


@pytest.mark.parametrize(("missing", "expected"), [(0, []), (2, ["2 rods"])])
def test_rods_beyond_the_end_of_a_wall_are_reported(missing, expected):
    found = rods_beyond_ends(row_of_rods(6), floor(2.0 * RADIUS * (6 - missing)))
    assert [sentence[:6] for sentence in found] == expected
    assert all("'floor'" in sentence for sentence in found)


@pytest.mark.parametrize(("load", "warnings"), [(0.6, 0), (0.06, 1)])
def test_a_load_is_judged_by_the_part_of_the_wall_that_rods_touch(load, warnings):
    """The weight of the rods makes 420 Pa on the tenth of the wall beside which they are."""
    walls = replace(floor(1.2), load=np.array([[load]]))
    assert len(implausible_loads(MaterialSection(), row_of_rods(6), walls)) == warnings


def test_touching_neighbours_have_a_spacing_of_one():
    rods = row_of_rods(5)
    assert neighbour_spacing(rods.position[0], rods.radius) == pytest.approx(np.ones(5))
    assert neighbour_spacing(rods.position[0], 2.0 * rods.radius) == pytest.approx(np.full(5, 0.5))
    assert len(neighbour_spacing(rods.position[0, :1], rods.radius[:1])) == 0


def test_rods_that_fill_the_area_are_counted() -> None:
    x, y = np.meshgrid(np.arange(8.0), np.arange(8.0))
    place = 0.02 * np.column_stack([(x + 0.5 * (y % 2)).ravel(), np.sqrt(0.75) * y.ravel()])
    full = tracks_at(place)
    assert expected_rods(full) == pytest.approx(64, abs=8)
    few = tracks_at(place[np.arange(64) % 3 == 0])
    assert expected_rods(few) > 45
    assert expected_rods(tracks_at(place[:3])) == 3


def test_walls_through_rods_are_named() -> None:
    place = np.array([[0.02, 0.01], [0.05, 0.01], [0.08, 0.01]])
    assert rods_cut_by_walls(tracks_at(place), floor(0.1)) == {}
    low = place - [0.0, 0.009]
    assert rods_cut_by_walls(tracks_at(low), floor(0.06)) == {"floor": 2}


def test_rods_in_the_other_half_of_a_split_box_are_not_beyond_its_side() -> None:
    halves = np.array([[[[0.2, 0.0], [0.2, 0.1]], [[0.23, 0.1], [0.23, 0.2]]]])
    walls = WallTracks(("low", "high"), halves, np.full(2, np.nan))
    check_inside(SOURCES, tracks_at(np.array([[0.19, 0.05], [0.22, 0.15]])), walls)
    with pytest.raises(InputError, match="wall 'low': grain 1 lies 20 mm beyond it"):
        check_inside(SOURCES, tracks_at(np.array([[0.19, 0.05], [0.22, 0.05]])), walls)


def test_rods_of_the_boundary_may_lie_beyond_walls() -> None:
    """As those of a chain that is pulled out of an opening."""
    halves = np.array([[[[0.2, 0.0], [0.2, 0.1]], [[0.2, 0.12], [0.2, 0.2]]]])
    walls = WallTracks(("low", "high"), halves, np.full(2, np.nan))
    tracks = tracks_at(np.array([[0.19, 0.05], [0.22, 0.05]]))
    check_inside(SOURCES, replace(tracks, boundary=np.array([False, True])), walls)
    with pytest.raises(InputError, match="grain 1 lies 20 mm beyond it"):
        check_inside(SOURCES, replace(tracks, boundary=np.array([True, False])), walls)


def test_one_wrong_place_of_a_later_photograph_is_not_blamed_on_the_walls() -> None:
    corners = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]])
    ends = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)  # the same upside down
    walls = WallTracks(tuple("brtl"), np.repeat(ends[None], 2, axis=0), np.full(4, np.nan))
    first = tracks_at(np.array([[0.02, 0.02], [0.05, 0.08], [0.08, 0.03]]))
    place = np.concatenate([first.position, first.position])
    place[1, 1, 0] = 5.0
    given = np.repeat(first.status, 2, axis=0)
    blank = np.full(given.shape, np.nan)
    tracks = Tracks(first.id, first.radius, np.arange(2.0), place, blank, blank, blank, given)
    with pytest.raises(InputError, match="beyond it") as refused:
        check_inside(SOURCES, tracks, walls)
    assert "look" not in str(refused.value)


STEP = np.array([[0.0, 0.1], [0.0, 0.0], [0.05, 0.0], [0.05, -0.03], [0.1, -0.03], [0.1, 0.1]])
STEP_NAMES = ("left", "floor", "step", "lower floor", "right")


@pytest.mark.parametrize(
    ("gravity", "expected"),
    [
        ((0.0, 0.0), ["between wall 'right' and wall 'left'"]),  # the step faces as the left wall does, farther inside
        ((0.0, 9.81), ["between wall 'right' and wall 'left'"]),  # upwards: weight does not hold the rods
        ((0.0, -9.81), []),
    ],
)
def test_weight_closes_a_boundary_as_a_lid_would(gravity, expected) -> None:
    walls = WallTracks(STEP_NAMES, np.stack([STEP[:-1], STEP[1:]], axis=1)[None], np.full(5, np.nan))
    found = open_sides(walls, gravity)
    assert [where for where in expected if where not in found[0]] == []
    assert len(found) == len(expected)
