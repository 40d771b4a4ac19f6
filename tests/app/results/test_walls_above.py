"""A wall above the packing, without a given load, adds a force to the weight that no input states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.cli.summary_table import weight_line
from rodsight.results.summary import press_from_above
from rodsight.tracks import WallTracks

WEIGHT = np.array([0.0, -50.0])  # [N]
BOX = np.array([[[0, 0], [1, 0]], [[1, 0], [1, 1]], [[1, 1], [0, 1]], [[0, 1], [0, 0]]], float)
# [N] of the packing on bottom, right, top and left; the right wall is dragged up, the last frame failed.
FORCE = np.array([
    [[0, -150], [30, 40], [2, 100], [-30, 5]],
    [[0, -155], [30, 40], [2, 110], [-30, 5]],
    [[0, -950], [30, 40], [2, 900], [-30, 5]],
    np.full((4, 2), np.nan),
])  # fmt: skip


@pytest.fixture
def walls() -> WallTracks:
    return WallTracks(("bottom", "right", "top", "left"), np.broadcast_to(BOX, (4, 4, 2, 2)), np.full(4, np.nan))


def test_the_median_force_of_a_wall_above_is_stated_over_the_weight(walls):
    assert press_from_above(walls, FORCE, WEIGHT) == pytest.approx({"top": 2.2})


def test_a_loaded_wall_a_light_touch_and_a_packing_without_weight_add_nothing(walls):
    loaded = replace(walls, pressure=np.array([np.nan, np.nan, 1e3, np.nan]))
    assert press_from_above(loaded, FORCE, WEIGHT) == {}
    assert press_from_above(walls, 0.01 * FORCE, WEIGHT) == {}
    assert press_from_above(walls, FORCE, np.zeros(2)) == {}
    assert press_from_above(walls, FORCE[3:], WEIGHT) == {}


def test_the_weight_alone_sets_the_scale_only_where_no_wall_adds_to_it():
    line = weight_line({"weight": 50.0, "walls_above": {}})
    assert (
        line
        == weight_line({"weight": 50.0})
        == ("No wall has a given load: the weight of the rods, 50 N, sets the scale.")
    )
    added = weight_line({"weight": 50.0, "walls_above": {"top": 2.2}})
    assert "'top' 2.2 times" in added
    assert "Give their load." in added
