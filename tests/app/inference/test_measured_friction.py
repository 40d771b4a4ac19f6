"""An unknown friction is measured by iteration, or reported as undetermined by the motion."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from rodsight.inference import infer_sequence
from rodsight.inference.corrected_sequence import CorrectedSequence
from rodsight.inference.correction import friction
from rodsight.inference.correction.friction import check_sequence_friction, measure_friction
from rodsight.inference.inputs import Inputs
from rodsight.process.errors import UndeterminedError
from rodsight.solver.assessment.intervals.statistic_intervals import FRICTION_ERROR
from rodsight.solver.bodies.rods import RodMaterial
from rodsight.solver.convex.friction_check import FrictionCheck
from rodsight.solver.detection.touch_probability import ContactProbabilitySettings
from rodsight.solver.frame_forces import FrameStatus
from rodsight.solver.statistics.frame_statistics import FrameStatistics
from rodsight.tracks import Tracks, WallTracks

from tests.app.recording.fake_results import make_results
from tests.solver.sequence.test_frames import ENSEMBLE, sheared_frames

TRUE = 0.21


@pytest.fixture
def measure(monkeypatch):
    """Measure the friction of some frames with a friction check of given results."""
    packing, snapshots = sheared_frames(6)
    trials: list[float] = []

    def by(result, material: RodMaterial | None = None) -> tuple[RodMaterial, list[float]]:
        def check(packing, snapshots, first, last, settings, workers) -> FrictionCheck:
            given = packing.material.friction
            trials.append(given)
            measured, enclosed = result(given)
            return FrictionCheck(given, measured, 0.0, 1.0, first, last, enclosed, np.ones(3), np.ones(3))

        monkeypatch.setattr(friction, "check_friction", check)
        first = RodMaterial(friction=0.3, friction_measured=True) if material is None else material
        return measure_friction(first, packing, snapshots, ContactProbabilitySettings(overlap=1e-6)), trials

    return by


def test_the_measurement_is_repeated_until_it_converges(measure) -> None:
    found, trials = measure(lambda given: (TRUE + 0.2 * (given - TRUE), True))
    assert found.friction == pytest.approx(TRUE, rel=0.02)
    assert trials[0] == 0.3
    assert trials == pytest.approx([0.3, 0.228, 0.2136])  # the last differs from the result by less than 2 %


def test_a_given_friction_at_walls_stays(measure) -> None:
    given = RodMaterial(friction=0.3, wall_friction=0.1, friction_measured=True)
    found, _ = measure(lambda given: (TRUE, True), given)
    assert found == replace(given, friction=TRUE)


@pytest.mark.parametrize(("result", "why"), [((np.nan, False), "nothing slides"), ((5.0, False), "guesses ended at 2")])
def test_an_undetermined_friction_is_refused(measure, result, why) -> None:
    with pytest.raises(UndeterminedError, match=why) as refused:
        measure(lambda given: result)
    assert refused.value.key == 'material.friction = "measured"'


def test_sequences_solved_again_use_the_measured_friction() -> None:
    tracks, walls = cast(Tracks, None), cast(WallTracks, None)
    measured = Inputs(tracks, walls, RodMaterial(friction=0.3, friction_measured=True))
    assert measured.with_friction(TRUE).material == RodMaterial(friction=TRUE)
    given = Inputs(tracks, walls, RodMaterial(friction=0.3))
    assert given.with_friction(TRUE) == given  # a stated friction of rods is never replaced


def test_statistics_are_recomputed_and_less_certain_where_the_motion_contradicts_the_friction(monkeypatch) -> None:
    results = make_results(1, 8, 7, sweeps=2)
    frame = replace(results.frames[0], status=FrameStatus.SETTLED)
    before, anew = results.statistics[0], replace(results.statistics[0], friction_angle_sd=0.01)
    monkeypatch.setattr(infer_sequence, "summarise_frame", lambda sequence, assessed: anew)

    def after(check: FrictionCheck | None, status: FrameStatus = FrameStatus.SETTLED) -> FrameStatistics:
        sequence = cast(CorrectedSequence, None)
        return infer_sequence._widen_statistics(sequence, [before], [replace(frame, status=status)], check)[0]

    def check(measured: float) -> FrictionCheck:
        return FrictionCheck(0.25, measured, measured - 0.03, measured + 0.03, 1, 3, True, np.ones(3), np.ones(3))

    assert after(None) is after(check(0.26)) is after(check(0.4), FrameStatus.FAILED) is before
    wide = after(check(0.4)).friction_angle_sd
    assert wide == pytest.approx(np.hypot(0.01, FRICTION_ERROR["friction_angle"] * np.log(1.6)))


@pytest.fixture
def check_solved(monkeypatch):
    """Check the friction of ten solved frames of 2500 contacts; return the frames that are read, and the result."""

    def check(packing, snapshots, first, last, settings, workers) -> FrictionCheck:
        sliding = slides.pop() if slides else np.nan
        return FrictionCheck(0.25, 0.3, 0.2, 0.4, first, last, True, np.ones(3), np.ones(3), sliding=sliding)

    slides: list[float] = []

    def by(
        calm: Collection[int], lost: Collection[tuple[int, int]] = (), walls: Any = None, sliding: float | None = None
    ) -> FrictionCheck | None:
        slides[:] = [] if sliding is None else [sliding]
        packing, snapshots = sheared_frames(10, lost=list(lost))
        status = [FrameStatus.SETTLED if k in calm else FrameStatus.SUSPECT for k in range(10)]
        frames = [SimpleNamespace(status=each, contacts=SimpleNamespace(count=2500)) for each in status]
        sequence = SimpleNamespace(packing=packing, snapshots=snapshots, settings=ENSEMBLE, wall_friction=walls)
        return check_sequence_friction(cast(CorrectedSequence, sequence), cast(Any, frames))

    monkeypatch.setattr(friction, "check_friction", check)
    return by


def test_the_friction_is_checked_on_the_quietest_frames(check_solved) -> None:
    assert [check_solved({5, 6, 7, 8}).first, check_solved({5, 6, 7, 8}).last] == [5, 8]
    assert check_solved({2, 3, 4, 5, 8}).first == 2
    assert check_solved(range(10), lost=[(2, 14)]).first == 3  # rods are lost from one photograph


@pytest.mark.parametrize(("sliding", "shown"), [(0.5, True), (0.14, False), (np.nan, True)])
def test_sliding_by_noise_alone_shows_no_friction(check_solved, sliding, shown) -> None:
    check = check_solved(range(10), sliding=sliding)
    assert check.enclosed is shown
    assert check.agrees


def test_the_friction_is_not_checked_where_rods_are_lost_throughout(check_solved) -> None:
    assert check_solved(range(10), lost=[(k, 14) for k in range(10)]) is None


def test_the_check_states_the_friction_measured_at_walls(check_solved) -> None:
    found = check_solved(range(10), walls=SimpleNamespace(measured=0.11, low=0.08, high=0.15))
    assert (found.wall_measured, found.wall_low, found.wall_high) == (0.11, 0.08, 0.15)
    assert np.isnan(check_solved(range(10)).wall_measured)
