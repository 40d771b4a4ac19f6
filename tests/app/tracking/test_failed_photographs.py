"""Photographs that show less than their neighbours fail alone; a lasting change of the light is none."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.tracking.follow import MOST_UNRELIABLE, describe_failure
from rodsight.tracking.registration.poses import FramePoses, no_poses
from rodsight.tracks import TrackStatus

COUNT = 20


def poses(*, unreliable=0, lost=0):
    """Poses of rods of which the first are unreliable, and the last lost."""
    place, status = np.zeros(COUNT), np.full(COUNT, TrackStatus.OK, np.uint8)
    status[:unreliable] = TrackStatus.SUSPECT
    place[COUNT - lost :], status[COUNT - lost :] = np.nan, TrackStatus.LOST
    return FramePoses(place, place, place, place, place, place, status, np.zeros(COUNT, np.int32))


FAILED = no_poses(np.zeros(COUNT, np.int32), "blurred")


def test_a_photograph_with_few_reliable_poses_fails():
    words = describe_failure(poses(unreliable=13, lost=2), [poses(), poses(lost=1)], "0002.jpg")
    assert words.startswith("5 of 20 grains are found reliably in 0002.jpg, 19 in the photograph before")
    assert describe_failure(poses(unreliable=12), [poses()], "0001.jpg") == ""


def test_poses_that_were_unreliable_before_are_used():
    assert describe_failure(poses(unreliable=13), [poses(unreliable=5)], "0001.jpg") == ""
    assert describe_failure(poses(unreliable=20), [poses(), poses(unreliable=20)], "0002.jpg") == ""


@pytest.mark.parametrize("failed", range(MOST_UNRELIABLE + 1))
def test_a_lasting_change_is_no_failure(failed):
    words = describe_failure(poses(unreliable=20), [poses(), *[FAILED] * failed], "0003.jpg")
    assert bool(words) == (failed < MOST_UNRELIABLE)


def test_a_photograph_without_rods_fails_however_often():
    before = [poses(), *[FAILED] * (MOST_UNRELIABLE + 1)]
    assert describe_failure(poses(lost=19), before, "0004.jpg") == "1 of 20 grains are found in 0004.jpg"
