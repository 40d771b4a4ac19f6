"""Softness and stretchings that gaps do not decide are used where the forces then fit clearly better."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.inference import assumption_trials as module
from rodsight.inference.assumption_trials import (
    FITS,
    LEAST,
    OVERLAPS_FIT,
    SHOWN,
    correct_by_trial,
    inputs_as_used,
)
from rodsight.inference.corrected_sequence import CorrectedSequence
from rodsight.inference.correction import correct_sequence
from rodsight.inference.diagnosis import distortion
from rodsight.inference.diagnosis.diagnose import diagnose
from rodsight.inference.inputs import Inputs, Stretching
from rodsight.synthetic.scenarios.scenario_folder import make_scenario

from .scenarios import read_inputs

MIDDLE = np.array([0.01, -0.02])


@pytest.fixture
def inputs(made_tracks) -> Inputs:
    return read_inputs(load_experiment(made_tracks))


@dataclass(frozen=True)
class Sequence:
    softness_hidden: bool = False
    lens: SimpleNamespace | None = None
    remark: str = "noise is larger than stated"
    with_remark = CorrectedSequence.with_remark


@pytest.fixture
def corrected(monkeypatch):
    """Inputs that are corrected to a sequence which `hide` sets."""
    used, sequences = [], [Sequence()]

    def correct(inputs):
        used.append(inputs)
        return sequences[-1]

    monkeypatch.setattr(module, "correct_sequence", correct)
    return SimpleNamespace(inputs=used, hide=sequences.append)


def stretching(*value: float, applied: bool = True) -> SimpleNamespace:
    """A distortion of the camera that the gaps show."""
    return SimpleNamespace(value=np.pad(value, (0, 10 - len(value))), applied=applied, middle=MIDDLE)


def described(inputs: Inputs) -> str:
    """Name an assumption."""
    if inputs.stretching is None:
        return "as given" if inputs.material.stiffness is None else "soft"
    x, y = 100.0 * (inputs.stretching.factor - 1.0)
    if x == y == 0.0:
        return "no stretching"
    return f"x {x:+.2g} %" if y == 0.0 else f"y {y:+.2g} %"


def solved(
    monkeypatch,
    expected: float,
    rises: dict[str, float],
    *,
    loaded: bool = True,
    agreement: float = 0.69,
    overlaps: float = OVERLAPS_FIT,
) -> list[str]:
    """Let trials of the given input have this expected r, and others rise by so much; return what was solved."""
    tried = []

    def trial(inputs):
        assert not inputs.settings.infer_unseen  # rods that no photograph shows
        tried.append(described(inputs))
        soft = tried[-1] == "soft"
        return SimpleNamespace(
            expected=(expected, 0.0, 1.0), score=1.0 + rises.get(tried[-1], 0.0), loaded=loaded, soft=soft,
            agreement=agreement if soft else 0.7, overlap_agreement=overlaps,
        )  # fmt: skip

    monkeypatch.setattr(module, "solve_trial", trial)
    monkeypatch.setattr(module, "try_rival", trial)
    return tried


def test_soft_grains_that_fit_clearly_better_are_used(inputs, corrected, monkeypatch):
    corrected.hide(Sequence(softness_hidden=True))
    tried = solved(monkeypatch, 0.7, {"soft": SHOWN + 0.01})
    used, sequence = correct_by_trial(inputs)
    assert used == replace(inputs, material=replace(inputs.material, stiffness="estimate"))
    assert corrected.inputs == [inputs, used]
    assert tried == ["as given", "soft"]
    assert sequence.remark.startswith("noise is larger than stated; overlaps are read as forces of soft grains, since")
    assert "falls to 49 %" in sequence.remark
    assert "rigid" in sequence.remark


def test_hard_grains_stay_hard_where_that_is_no_clear_gain(inputs, corrected, monkeypatch):
    corrected.hide(Sequence(softness_hidden=True))
    solved(monkeypatch, 0.7, {"soft": SHOWN - 0.01})
    used, _ = correct_by_trial(inputs)
    assert used is inputs
    assert corrected.inputs == [inputs]


@pytest.mark.parametrize(
    ("rise", "agreement", "overlaps", "used"),
    [
        (SHOWN - 0.01, 0.71, OVERLAPS_FIT, False),
        (SHOWN - 0.01, 0.69, 1.0, False),
        (LEAST + 0.01, 0.71, OVERLAPS_FIT + 0.01, True),
        (LEAST - 0.01, 0.71, OVERLAPS_FIT + 0.01, False),
    ],
)
def test_less_is_needed_of_soft_grains_that_agree_with_the_motion(
    inputs, corrected, monkeypatch, rise, agreement, overlaps, used
):
    corrected.hide(Sequence(softness_hidden=True))
    solved(monkeypatch, 0.7, {"soft": rise}, agreement=agreement, overlaps=overlaps)
    found, sequence = correct_by_trial(inputs)
    assert (found is not inputs) is used
    assert ("agree with the motion by 0.71, not 0.70" in sequence.remark) is used


def test_hidden_overlaps_are_compared_whatever_is_expected(inputs, corrected, monkeypatch):
    corrected.hide(Sequence(softness_hidden=True))
    solved(monkeypatch, FITS + 0.01, {"soft": SHOWN + 0.01})
    assert correct_by_trial(inputs)[0].material.stiffness == "estimate"


def test_without_a_load_soft_grains_must_agree_with_the_motion_as_well_as_hard_ones(inputs, corrected, monkeypatch):
    corrected.hide(Sequence(softness_hidden=True))
    solved(monkeypatch, 0.7, {"soft": SHOWN + 1.0}, loaded=False, overlaps=1.0)
    assert correct_by_trial(inputs)[0] is inputs
    solved(monkeypatch, 0.7, {"soft": SHOWN + 0.01}, loaded=False, agreement=0.7)
    assert correct_by_trial(inputs)[0] is not inputs


def test_an_assumption_that_cannot_be_solved_is_not_used(inputs, corrected, monkeypatch):
    corrected.hide(Sequence(softness_hidden=True))
    solved(monkeypatch, 0.7, {})
    monkeypatch.setattr(module, "try_rival", lambda inputs: None)
    assert correct_by_trial(inputs)[0] is inputs


def test_the_axis_along_which_lengths_fit_better_is_rescaled(inputs, corrected, monkeypatch):
    corrected.hide(Sequence(lens=stretching(-0.0025, -0.001)))
    tried = solved(monkeypatch, FITS - 0.001, {"x -0.5 %": 0.4, "y +0.5 %": 0.6})
    used, sequence = correct_by_trial(inputs)
    assert tried == ["as given", "no stretching", "x -0.5 %", "y +0.5 %"]
    np.testing.assert_allclose(used.stretching.factor, [1.0, 1.005])
    moved = used.tracks.position - MIDDLE, inputs.tracks.position - MIDDLE
    np.testing.assert_allclose(moved[0], moved[1] * [1.0, 1.005])
    np.testing.assert_allclose(used.walls.endpoints, MIDDLE + (inputs.walls.endpoints - MIDDLE) * [1.0, 1.005])
    assert used.stretching.evidence.startswith("lengths along y are taken to be 0.5 % too short, since what the forces")
    assert used.stretching.evidence.endswith("then falls to 30 %")
    assert sequence.remark == f"noise is larger than stated; {used.stretching.evidence}"


def test_a_stretching_that_fits_hardly_better_is_not_removed(inputs, corrected, monkeypatch):
    corrected.hide(Sequence(lens=stretching(-0.0025, -0.001)))
    solved(monkeypatch, 0.9, {"x -0.5 %": SHOWN - 0.01})
    assert correct_by_trial(inputs)[0] is inputs


def test_gaps_that_depend_on_the_direction_may_be_forces(inputs, corrected, monkeypatch):
    corrected.hide(Sequence(lens=stretching(-0.0025, -0.001)))
    solved(monkeypatch, 0.9, {"no stretching": 0.5, "x -0.5 %": 0.4})
    used, sequence = correct_by_trial(inputs)
    np.testing.assert_allclose(used.tracks.position, inputs.tracks.position, rtol=1e-12)
    assert "are read as forces, not as a stretched picture, since" in sequence.remark
    assert diagnose(used, None, sliding=False) == diagnose(inputs, None, sliding=False)


@pytest.mark.parametrize(
    ("lens", "expected"),
    [
        (stretching(-0.0025, -0.001), FITS + 0.001),
        (stretching(0.0, 0.0), 0.5),
        (stretching(-0.0025, -0.001, applied=False), 0.5),
        (stretching(-0.0025, -0.001, 0.02), 0.5),  # a lens, too
    ],
)
def test_other_distortions_and_forces_that_fit_are_not_compared(inputs, corrected, monkeypatch, lens, expected):
    corrected.hide(Sequence(lens=lens))
    solved(monkeypatch, expected, {"x -0.5 %": 2.0})
    assert correct_by_trial(inputs)[0] is inputs


def test_nothing_is_solved_where_gaps_hide_nothing(inputs, corrected, monkeypatch):
    tried = solved(monkeypatch, 0.1, {"soft": 2.0})
    assert correct_by_trial(inputs)[0] is inputs
    assert tried == []


def test_a_trial_of_the_first_photographs_serves_all(inputs, corrected, monkeypatch):
    corrected.hide(Sequence(lens=stretching(-0.0025, -0.001)))
    solved(monkeypatch, 0.7, {"x -0.5 %": 1.0})
    used, sequence = inputs_as_used(inputs)
    assert sequence is not None
    assert used.tracks.frame_count == inputs.tracks.frame_count
    np.testing.assert_allclose(used.tracks.position - MIDDLE, (inputs.tracks.position - MIDDLE) * [0.995, 1.0])


def test_a_removed_stretching_is_named(inputs):
    removed = inputs.without(Stretching(np.array([0.999, 1.0]), MIDDLE, "lengths along x are too long"))
    found = [each for each in diagnose(removed, None, sliding=False) if each.cause == "stretched_picture"]
    assert [(each.evidence, each.corrected) for each in found] == [("lengths along x are too long", True)]


def test_no_other_distortion_is_sought_with_a_removed_stretching(inputs, monkeypatch):
    monkeypatch.setattr(correct_sequence, "correct_camera", None)  # a call fails
    monkeypatch.setattr(distortion, "correct_camera", None)
    removed = inputs.without(Stretching(np.array([0.999, 1.0]), MIDDLE, "lengths along x are too long"))
    assert correct_sequence.correct_sequence(removed).lens is None
    assert not distortion.seeks_distortion(removed, removed.walls, {})


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "soft"), [("softer_stretched", True), ("centres", False)])
def test_only_soft_grains_are_recognised_behind_errors(tmp_path, scenario, soft):
    inputs = read_inputs(load_experiment(make_scenario(tmp_path, scenario, 6, grains=120).folder))
    used, sequence = correct_by_trial(inputs)
    assert sequence.settings.soft is soft
    assert (used is not inputs) <= soft


@pytest.mark.slow
def test_a_stretching_of_soft_grains_is_removed_along_its_axis(tmp_path):
    inputs = read_inputs(load_experiment(make_scenario(tmp_path, "soft_stretched", 42, grains=200).folder))
    used, sequence = correct_by_trial(inputs)
    assert used.stretching.factor[0] == pytest.approx(1.0 / 1.003, abs=0.001)
    assert used.stretching.factor[1] == 1.0
    assert sequence.settings.soft
