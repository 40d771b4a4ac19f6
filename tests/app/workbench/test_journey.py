"""The whole way of somebody new: twenty photographs of a laboratory, by mouse and keyboard, to judged forces."""

import numpy as np
import pytest

from tests.app.workbench.hand import opened
from tests.app.workbench.journey import Journey, journey_r, names_of, tracks_of, travel
from tests.app.workbench.laboratory_set import HIDDEN, PIXEL, STILL, make_laboratory_set

pytestmark = [pytest.mark.screen, pytest.mark.slow]
LONGEST = 600.0  # [s]
RIGHT = 0.5  # [px] of the corrected rod from the place that its neighbours predict
WANTED = 0.97


def test_from_a_cameras_folder_to_judged_forces(page, tmp_path):
    made = make_laboratory_set(tmp_path)
    with opened(page, made.folder) as tab:
        journey = Journey(tab, made)
        travel(journey)
        assert journey.seconds < LONGEST, journey.log
        r = journey_r(journey)
        assert np.nanmean(r[5:]) >= WANTED, r
        tracks = tracks_of(journey)
        row = int(np.flatnonzero(names_of(journey) == made.hidden)[0])
        assert tracks.present[:, row].all()
        assert tracks.present[HIDDEN : HIDDEN + STILL + 1].all()
        others = np.setdiff1d(np.arange(tracks.grain_count), [row])
        off = pixels_off(journey, tracks)
        assert np.abs(off[HIDDEN:, row] - np.median(off[HIDDEN:, others], axis=1)).max() < RIGHT


def pixels_off(journey, tracks):
    """How far (f, n, 2) [px] rods are from where they truly are, but for what is common to all: scale and origin."""
    true = journey.made.poses[:, names_of(journey), :2] * [1.0, -1.0]
    found = tracks.position / PIXEL
    off = found - true
    return off - np.median(off, axis=1, keepdims=True)
