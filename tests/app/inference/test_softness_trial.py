"""Soft grains whose overlaps errors hide are recognised where their forces fit clearly better."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.inference import softness_trial as module
from rodsight.inference.inputs import Inputs
from rodsight.inference.softness_trial import FITS, SHOWN, correct_by_trial
from rodsight.synthetic.scenarios.scenario_folder import make_scenario

from .scenarios import read_inputs


@pytest.fixture
def inputs(made_tracks) -> Inputs:
    return read_inputs(load_experiment(made_tracks))


@pytest.fixture
def corrected(monkeypatch):
    """Materials with which sequences are corrected; none is, and all hide whether grains are soft."""
    stiffness = []

    def correct(inputs):
        stiffness.append(inputs.material.stiffness)
        return Sequence(softness_hidden=True)

    monkeypatch.setattr(module, "correct_sequence", correct)
    return stiffness


@dataclass(frozen=True)
class Sequence:
    softness_hidden: bool
    remark: str = "noise is larger than stated"


def solved(monkeypatch, expected: float, rise: float) -> list[tuple[object, bool]]:
    """Let trials of the given input have this expected r, and that of soft grains this rise; return what was solved."""
    tried = []

    def trial(inputs):
        tried.append((inputs.material.stiffness, inputs.settings.infer_unseen))
        return SimpleNamespace(expected=(expected, 0.0, 1.0), score=1.0)

    monkeypatch.setattr(module, "solve_trial", trial)
    monkeypatch.setattr(module, "trial_score", lambda inputs: trial(inputs).score + rise)
    return tried


def test_soft_grains_that_fit_clearly_better_are_used(inputs, corrected, monkeypatch):
    tried = solved(monkeypatch, 0.7, SHOWN + 0.01)
    used, sequence = correct_by_trial(inputs)
    assert used == replace(inputs, material=replace(inputs.material, stiffness="estimate"))
    assert corrected == [None, "estimate"]
    assert tried == [(None, False), ("estimate", False)]  # without rods that no photograph shows
    assert sequence.remark.startswith("noise is larger than stated; overlaps are read as forces of soft grains")
    assert "falls to 49 %" in sequence.remark


@pytest.mark.parametrize(("expected", "rise"), [(0.7, SHOWN - 0.01), (FITS + 0.001, 1.0)])
def test_hard_grains_stay_hard_where_that_is_no_clear_gain_or_they_fit(inputs, corrected, monkeypatch, expected, rise):
    solved(monkeypatch, expected, rise)
    used, _ = correct_by_trial(inputs)
    assert used is inputs
    assert corrected == [None]


def test_nothing_is_solved_where_gaps_hide_nothing(inputs, monkeypatch):
    tried = solved(monkeypatch, 0.1, 2.0)
    used, sequence = correct_by_trial(inputs)
    assert used is inputs
    assert not sequence.softness_hidden
    assert tried == []


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "soft"), [("softer_stretched", True), ("centres", False)])
def test_only_soft_grains_are_recognised_behind_errors(tmp_path, scenario, soft):
    inputs = read_inputs(load_experiment(make_scenario(tmp_path, scenario, 6, grains=120).folder))
    used, sequence = correct_by_trial(inputs)
    assert sequence.settings.soft is soft
    assert (used is not inputs) <= soft
