"""Colours of a group differ in every kind of colour vision, adjacent pairs also in grey."""

from itertools import combinations

import numpy as np
import pytest
from rodsight.drawing.force_range import ForceRange
from rodsight.drawing.ramps import FORCE_RAMP, FORCE_RAMP_ON_WHITE
from rodsight.drawing.wall_marks import WALL_COLOURS, WALL_DASHES, wall_mark
from rodsight.figures.figure_style import COLOURS
from rodsight.recording.curve_layers.settling import STATUS_COLOURS, TRACKING_COLOURS
from rodsight.recording.look.colours import (
    ADDED,
    BACKGROUND,
    DIFFERENCE_RAMP,
    FORBIDDEN,
    GAP_RAMP,
    LOST,
    NEW_CONTACT,
    PROBABILITY_RAMP,
    SERIES,
    UNCERTAINTY_RAMP,
    style_of_series,
)
from rodsight.recording.packing_layers.rods_in_3d import ALUMINIUM
from rodsight.solver.frame_forces import FrameStatus

from tests.app.recording.look.colour_vision import VISIONS, cie76

MIN_DIFFERENCE = 25.0
LABELLED_DIFFERENCE = 20.0  # in grey, beside a text of the same meaning
WALL_DIFFERENCE = 23.0  # beside a name, which every wall has
STEP_IN_GREY = 12.0  # between two curves of a view
GROUPS = {
    "curves": SERIES,
    "status": tuple(STATUS_COLOURS.values()),
    "tracking": tuple(TRACKING_COLOURS.values()),
    "changes and verdicts": (NEW_CONTACT, LOST, ADDED, FORBIDDEN),
    "figures": tuple(tuple(int(text[k : k + 2], 16) for k in (1, 3, 5)) for text in COLOURS),
}


RAMPS = {
    "force": FORCE_RAMP, "force on white": FORCE_RAMP_ON_WHITE, "gap": GAP_RAMP, "uncertainty": UNCERTAINTY_RAMP,
    "probability": PROBABILITY_RAMP, "difference": DIFFERENCE_RAMP,
}  # fmt: skip


@pytest.mark.parametrize("group", GROUPS)
@pytest.mark.parametrize("vision", [name for name in VISIONS if name != "grey"])
def test_colours_of_a_group_differ(group, vision):
    for one, other in combinations(GROUPS[group], 2):
        assert cie76(one, other, vision) >= MIN_DIFFERENCE, (one, other)


@pytest.mark.parametrize("vision", [name for name in VISIONS if name != "grey"])
def test_ten_walls_differ_by_colour(vision):
    assert len(WALL_COLOURS) == 10
    for one, other in combinations(WALL_COLOURS, 2):
        assert cie76(one, other, vision) >= WALL_DIFFERENCE, (one, other)


def test_thirty_walls_have_marks_of_their_own():
    assert len({wall_mark(wall) for wall in range(30)}) == len(WALL_COLOURS) * len(WALL_DASHES) == 30


@pytest.mark.parametrize("ramp", RAMPS)
@pytest.mark.parametrize("vision", VISIONS)
def test_the_middle_of_a_ramp_differs_from_its_ends(ramp, vision):
    low, middle, high = (tuple(RAMPS[ramp][row].tolist()) for row in (0, len(RAMPS[ramp]) // 2, -1))
    assert cie76(low, middle, vision) >= MIN_DIFFERENCE
    assert cie76(middle, high, vision) >= MIN_DIFFERENCE
    assert cie76(low, high, vision) >= MIN_DIFFERENCE


@pytest.mark.parametrize("vision", VISIONS)
def test_forces_differ_from_the_rods_behind_them(vision):
    force = ForceRange(mean=1.0, top=4.0)
    weakest = FORCE_RAMP[int((1.0 - force.weak) / (force.top - force.weak) * (len(FORCE_RAMP) - 1))]
    assert cie76(ALUMINIUM, tuple(weakest.tolist()), vision) >= MIN_DIFFERENCE


def test_zero_is_grey_between_less_and_more():
    middle = DIFFERENCE_RAMP[len(DIFFERENCE_RAMP) // 2 - 1 : len(DIFFERENCE_RAMP) // 2 + 1, :3].astype(int)
    assert np.ptp(middle, axis=1).max() < 12


@pytest.mark.parametrize("pair", [(SERIES[0], SERIES[1]), (SERIES[2], SERIES[3]), (NEW_CONTACT, LOST)])
def test_the_most_frequent_pairs_differ_in_grey(pair):
    assert cie76(*pair, "grey") >= MIN_DIFFERENCE


def test_the_four_curves_of_most_views_differ_in_grey():
    assert min(cie76(*pair, "grey") for pair in combinations(SERIES[:4], 2)) >= STEP_IN_GREY


def test_at_least_eight_curves_differ_in_colour_and_all_curves_in_colour_or_marker():
    styles = [style_of_series(row) for row in range(72)]
    assert len({colour for colour, _ in styles[:8]}) == len({marker for _, marker in styles[:8]}) == 8
    assert len(set(styles)) == len(styles)


@pytest.mark.parametrize("vision", VISIONS)
def test_curves_contrast_with_the_ground(vision):
    assert min(cie76(colour, BACKGROUND, vision) for colour in SERIES) >= MIN_DIFFERENCE


@pytest.mark.parametrize("status", [FrameStatus.SUSPECT, FrameStatus.REARRANGING, FrameStatus.FAILED])
def test_a_settled_frame_differs_from_an_unreliable_one_in_grey(status):
    assert cie76(STATUS_COLOURS[status], STATUS_COLOURS[FrameStatus.SETTLED], "grey") >= LABELLED_DIFFERENCE


def test_the_distance_is_that_of_black_and_white_and_small_for_colours_that_deuteranopes_confuse():
    assert cie76((0, 0, 0), (255, 255, 255)) == pytest.approx(100.0, abs=0.1)
    assert cie76((176, 60, 60), (110, 110, 40), "deuteranopia") < 0.5 * cie76((176, 60, 60), (110, 110, 40))
