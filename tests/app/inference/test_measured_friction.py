"""A friction that is not known is measured until it agrees with itself, or said not to be told by the motion."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from rodsight.errors import UndeterminedError
from rodsight.inference import friction_and_radii, inference
from rodsight.inference.friction_and_radii import measure_friction
from rodsight.inference.inference import CorrectedSequence, Inputs
from rodsight.tracks import Tracks, WallTracks

from solver.bodies.rods import RodMaterial
from solver.convex.friction_check import FrictionCheck
from solver.detection.touch_probability import ContactProbabilitySettings
from solver.sequence.frame_forces import FrameStatus
from solver.sequence.judging.statistic_intervals import FRICTION_ERROR
from solver.statistics.frame_statistics import FrameStatistics
from tests.app.recording.fake_results import make_results
from tests.solver.sequence.test_frames import sheared_frames

TRUE = 0.21


@pytest.fixture
def measure(monkeypatch):
    """Measure the friction of some frames with a check that says what is told."""
    packing, snapshots = sheared_frames(6)
    asked: list[float] = []

    def by(answer, material: RodMaterial | None = None) -> tuple[RodMaterial, list[float]]:
        def check(packing, snapshots, first, last, unit, settings, workers) -> FrictionCheck:
            given = packing.material.friction
            asked.append(given)
            measured, enclosed = answer(given)
            return FrictionCheck(given, measured, 0.0, 1.0, first, last, enclosed, np.ones(3), np.ones(3))

        monkeypatch.setattr(friction_and_radii, "check_friction", check)
        first = RodMaterial(friction=0.3, friction_measured=True) if material is None else material
        return measure_friction(first, packing, snapshots, ContactProbabilitySettings(overlap=1e-6)), asked

    return by


def test_it_is_found_anew_with_what_was_found_until_both_agree(measure) -> None:
    found, asked = measure(lambda given: (TRUE + 0.2 * (given - TRUE), True))
    assert found.friction == pytest.approx(TRUE, rel=0.02)
    assert asked[0] == 0.3
    assert 2 <= len(asked) <= 4


def test_a_friction_at_walls_that_was_told_stays(measure) -> None:
    told = RodMaterial(friction=0.3, wall_friction=0.1, friction_measured=True)
    found, _ = measure(lambda given: (TRUE, True), told)
    assert found == replace(told, friction=TRUE)


@pytest.mark.parametrize(("answer", "why"), [((np.nan, False), "nothing slides"), ((5.0, False), "guesses ended at 2")])
def test_where_the_motion_does_not_tell_it_a_number_is_asked_for(measure, answer, why) -> None:
    with pytest.raises(UndeterminedError, match=why) as refused:
        measure(lambda given: answer)
    assert refused.value.key == 'material.friction = "measured"'


def test_sequences_solved_again_take_the_friction_that_was_found() -> None:
    tracks, walls = cast(Tracks, None), cast(WallTracks, None)
    asked = Inputs(tracks, walls, RodMaterial(friction=0.3, friction_measured=True))
    assert asked.with_friction(TRUE).material == RodMaterial(friction=TRUE)
    told = Inputs(tracks, walls, RodMaterial(friction=0.3))
    assert told.with_friction(TRUE) is told


def test_statistics_are_told_anew_and_less_sure_where_the_motion_contradicts_the_friction(monkeypatch) -> None:
    results = make_results(1, 8, 7, sweeps=2)
    frame = replace(results.frames[0], status=FrameStatus.SETTLED)
    before, anew = results.statistics[0], replace(results.statistics[0], friction_angle_sd=0.01)
    monkeypatch.setattr(inference, "_summarize", lambda sequence, judged: anew)

    def told(check: FrictionCheck | None, status: FrameStatus = FrameStatus.SETTLED) -> FrameStatistics:
        return CorrectedSequence.restate(cast(CorrectedSequence, None), before, replace(frame, status=status), check)

    def check(measured: float) -> FrictionCheck:
        return FrictionCheck(0.25, measured, measured - 0.03, measured + 0.03, 1, 3, True, np.ones(3), np.ones(3))

    assert told(None) is told(check(0.26)) is told(check(0.4), FrameStatus.FAILED) is before
    wide = told(check(0.4)).friction_angle_sd
    assert wide == pytest.approx(np.hypot(0.01, FRICTION_ERROR["friction_angle"] * np.log(1.6)))
    assert wide > 0.04
