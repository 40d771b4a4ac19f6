"""Colours that must be told apart are, also without red or green cones, and where two lie side by side in grey."""

from itertools import combinations

import numpy as np
import pytest
from rodsight.figures.page import COLOURS
from rodsight.recording.curve_layers.settling import STATUS_COLOURS, TRACKING_COLOURS
from rodsight.recording.look.colours import (
    ADDED,
    DIFFERENCE_RAMP,
    DOUBT_RAMP,
    FORBIDDEN,
    FORCE_RAMP,
    GAINED,
    GAP_RAMP,
    LOST,
    PROBABILITY_RAMP,
    SERIES,
)
from rodsight.recording.look.force_style import ForceRange
from rodsight.recording.packing_layers.rods_in_3d import ALUMINIUM

from solver.sequence.frame_forces import FrameStatus
from tests.app.recording.look.colour_vision import VISIONS, cie76

APART = 25.0
BESIDE_ITS_NAME = 20.0  # in grey, where a word says the same
GROUPS = {
    "curves": SERIES,
    "status": tuple(STATUS_COLOURS.values()),
    "tracking": tuple(TRACKING_COLOURS.values()),
    "changes and verdicts": (GAINED, LOST, ADDED, FORBIDDEN),
    "figures": tuple(tuple(int(text[k : k + 2], 16) for k in (1, 3, 5)) for text in COLOURS),
}


RAMPS = {
    "force": FORCE_RAMP, "gap": GAP_RAMP, "doubt": DOUBT_RAMP, "probability": PROBABILITY_RAMP,
    "difference": DIFFERENCE_RAMP,
}  # fmt: skip


@pytest.mark.parametrize("group", GROUPS)
@pytest.mark.parametrize("vision", [name for name in VISIONS if name != "grey"])
def test_colours_of_a_group_are_apart(group, vision):
    for one, other in combinations(GROUPS[group], 2):
        assert cie76(one, other, vision) >= APART, (one, other)


@pytest.mark.parametrize("ramp", RAMPS)
@pytest.mark.parametrize("vision", VISIONS)
def test_the_middle_of_a_ramp_is_apart_from_its_ends(ramp, vision):
    low, middle, high = (tuple(RAMPS[ramp][row].tolist()) for row in (0, len(RAMPS[ramp]) // 2, -1))
    assert cie76(low, middle, vision) >= APART
    assert cie76(middle, high, vision) >= APART
    assert cie76(low, high, vision) >= APART


@pytest.mark.parametrize("vision", VISIONS)
def test_forces_are_apart_from_the_rods_that_they_lie_on(vision):
    force = ForceRange(mean=1.0, top=4.0)
    weakest = FORCE_RAMP[int((1.0 - force.weak) / (force.top - force.weak) * (len(FORCE_RAMP) - 1))]
    assert cie76(ALUMINIUM, tuple(weakest.tolist()), vision) >= APART


def test_nothing_is_grey_between_less_and_more():
    middle = DIFFERENCE_RAMP[len(DIFFERENCE_RAMP) // 2 - 1 : len(DIFFERENCE_RAMP) // 2 + 1, :3].astype(int)
    assert np.ptp(middle, axis=1).max() < 12


@pytest.mark.parametrize("pair", [(SERIES[0], SERIES[1]), (SERIES[2], SERIES[3]), (GAINED, LOST)])
def test_the_commonest_pairs_are_apart_in_grey(pair):
    assert cie76(*pair, "grey") >= APART


@pytest.mark.parametrize("status", [FrameStatus.SUSPECT, FrameStatus.REARRANGING, FrameStatus.FAILED])
def test_a_settled_frame_is_told_from_a_doubtful_one_in_grey(status):
    assert cie76(STATUS_COLOURS[status], STATUS_COLOURS[FrameStatus.SETTLED], "grey") >= BESIDE_ITS_NAME


def test_the_measure_knows_black_from_white_and_what_deuteranopes_confuse():
    assert cie76((0, 0, 0), (255, 255, 255)) == pytest.approx(100.0, abs=0.1)
    assert cie76((176, 60, 60), (110, 110, 40), "deuteranopia") < 0.5 * cie76((176, 60, 60), (110, 110, 40))
