"""A trial solves a part of the photographs as a run does, and judges the frames that have a history."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.inference.diagnosis import trial as module
from rodsight.inference.diagnosis.trial import select_window, solve_trial, trial_score
from rodsight.inference.inputs import Inputs
from rodsight.process.errors import UndeterminedError
from rodsight.solver.assessment.evidence import Evidence
from rodsight.solver.bodies.rods import RodMaterial

from tests.app.inference.diagnosis.test_direct_tests import box, rolling_tracks

EVIDENCE = Evidence(False, 0.05, 0.1, 0.01, 0.01, 1.0, 1e-3, 4e-3, 5, agreement=0.96, overlap_agreement=0.9)


@pytest.fixture
def inputs() -> Inputs:
    return Inputs(rolling_tracks(), box(), RodMaterial())


def solve_into(monkeypatch, evidence: list[Evidence]) -> list[Inputs]:
    """Let a trial find frames with this evidence; the returned list receives what it solves."""
    solved: list[Inputs] = []
    monkeypatch.setattr(module, "correct_sequence", solved.append)

    def solve_frames(_, store, observer, beginning) -> None:
        store.frames.extend(
            SimpleNamespace(state=SimpleNamespace(evidence=each), forces=0.5 + each.correction) for each in evidence
        )

    monkeypatch.setattr(module, "most_by_intervals", lambda forces: forces)

    monkeypatch.setattr(module, "solve_frames", solve_frames)
    return solved


def test_frames_without_a_history_or_an_assessment_are_not_judged(inputs, monkeypatch) -> None:
    evidence = [replace(EVIDENCE, correction=0.1 * k) for k in range(5)]
    evidence[3] = replace(evidence[3], assessed=False)
    solve_into(monkeypatch, evidence)
    found = solve_trial(inputs)
    assert found is not None
    assert found.evidence == (evidence[2], evidence[4])
    assert found.most == pytest.approx(0.8)
    assert found.expect(contradicted=False)[:2] == pytest.approx([0.8, min(0.8, replace(found, most=1.0).expected[1])])
    solve_into(monkeypatch, evidence[:1])
    alone = solve_trial(inputs)
    assert alone is not None
    assert alone.evidence == (evidence[0],)


def test_errors_of_centres_are_found_by_forces_on_request(inputs, monkeypatch) -> None:
    solve_into(monkeypatch, [EVIDENCE])
    solved: list[tuple[object, object]] = []
    monkeypatch.setattr(module, "solve_frames", lambda sequence, _, __, beginning: solved.append((sequence, beginning)))
    monkeypatch.setattr(module, "correct_hard_grains", lambda sequence, observer: ("found", "beginning"))
    solve_trial(inputs)
    assert solved == [(None, None)]
    solve_trial(inputs, by_forces=True)
    assert solved[1] == ("found", "beginning")


def test_corrected_photographs_are_not_corrected_again(inputs, monkeypatch) -> None:
    solved: list[object] = []
    corrected = solve_into(monkeypatch, [EVIDENCE])
    monkeypatch.setattr(module, "solve_frames", lambda sequence, *_: solved.append(sequence))
    solve_trial(inputs, corrected="corrected")  # type: ignore[arg-type]
    assert (corrected, solved) == ([], ["corrected"])


def test_a_window_holds_as_many_photographs_as_requested_at_its_step(inputs, monkeypatch) -> None:
    times = inputs.tracks.time
    part, step = select_window(inputs, 3, 2)
    assert step == 1
    np.testing.assert_array_equal(part.tracks.time, times[2:5])
    monkeypatch.setattr(module, "choose_span", lambda _: (2, "noise"))
    part, step = select_window(inputs, 3, 1)
    assert step == 2
    np.testing.assert_array_equal(part.tracks.time, times[1:6:2])
    np.testing.assert_array_equal(part.walls.endpoints, inputs.walls.endpoints[1:6:2])
    part, _ = select_window(inputs, 100)
    np.testing.assert_array_equal(part.tracks.time, times[::2])


def test_one_photograph_allows_no_trial(inputs, monkeypatch) -> None:
    solved = solve_into(monkeypatch, [EVIDENCE])
    assert solve_trial(inputs, 1) is None
    assert solved == []


@pytest.mark.parametrize("error", [UndeterminedError("x"), ValueError("x"), FloatingPointError("x")])
def test_a_rival_that_cannot_be_solved_has_the_worst_score(inputs, monkeypatch, error) -> None:
    def fail(*_, **__):
        raise error

    monkeypatch.setattr(module, "correct_sequence", fail)
    assert trial_score(inputs) == -math.inf
