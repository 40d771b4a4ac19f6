"""Deviations of statistics grow with doubt, and with the value where it has a size."""

from dataclasses import replace

import numpy as np
import pytest

from solver.bodies.quantity import quantities
from solver.sequence.judging.statistic_intervals import DEVIATION, SIZED, with_deviations
from solver.statistics.frame_statistics import FrameStatistics
from tests.app.recording.fake_results import make_results


@pytest.fixture(scope="module")
def run():
    return make_results(2, 8, 7, sweeps=2)


def _told(run, trust, **how):
    frame = replace(run.frames[1], trust=trust, positions_share=how.pop("share", 0.0))
    return with_deviations(run.statistics[1], frame, **({"scale_is_known": True, "moved": True} | how))


def test_every_constant_has_a_field_and_its_unit():
    fields = {each.name: each.quantity for each in quantities(FrameStatistics)}
    for name in DEVIATION:
        assert fields[f"{name}_sd"].unit == fields[name].unit


def test_deviations_grow_with_the_root_of_the_doubt(run):
    sure, doubted = _told(run, 0.9), _told(run, 0.6)
    for name in DEVIATION:
        ratio = getattr(doubted, f"{name}_sd") / getattr(sure, f"{name}_sd")
        assert ratio == pytest.approx(2.0), name
    assert sure.pressure_sd == pytest.approx(DEVIATION["pressure"][0] * sure.pressure * np.sqrt(0.1))
    assert sure.friction_angle_sd == pytest.approx(DEVIATION["friction_angle"][0] * np.sqrt(0.1))


def test_positions_alone_are_believed_less_of_angles(run):
    assert _told(run, 0.9, share=1.0).friction_angle_sd > 5 * _told(run, 0.9).friction_angle_sd


def test_what_nothing_tells_has_no_deviation(run):
    unsized = _told(run, 0.9, scale_is_known=False)
    assert all(np.isnan(getattr(unsized, f"{name}_sd")) == (name in SIZED) for name in DEVIATION)
    for unknown in (_told(run, np.nan), _told(run, 0.9, moved=False)):
        assert np.isnan(unknown.friction_angle_sd)
