"""Wrong radii of soft rods are corrected by their forces; exact radii stay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.inference.corrected_sequence import CorrectedSequence
from rodsight.inference.correction import correct_sequence as correct_module
from rodsight.inference.correction import errors_by_forces, soft_grain_errors
from rodsight.inference.correction.soft_grain_errors import correct_grain_errors, correct_soft_grains
from rodsight.solver.assessment.mixture_trust import MAX_TRUST_CORRECTED
from rodsight.solver.calibration.grain_errors import GrainErrors
from rodsight.solver.sequence.frames import solve_sequence
from rodsight.study.scenarios.scenario_score import correct_scenario
from rodsight.synthetic.scenarios.preset_names import ScenarioName
from rodsight.synthetic.scenarios.scenario_folder import make_scenario

from tests.app.inference.scenarios import agreement, solve

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")


def corrected(
    folder: Path, scenario: ScenarioName, seed: int, rods: int
) -> tuple[CorrectedSequence, np.ndarray, np.ndarray]:
    """Corrected sequence of a scenario, its stated and its true radii (n,) [m]."""
    made = make_scenario(folder, scenario, seed, grains=rods)
    experiment = load_experiment(made.folder, ())
    return correct_scenario(experiment), read_tracks(experiment).radius, made.truth.radius


@pytest.mark.slow
def test_wrong_radii_are_corrected_by_forces(tmp_path, monkeypatch):
    before = []

    def correct(tracks, *given):
        before.append(tracks.radius)
        return correct_grain_errors(tracks, *given)

    monkeypatch.setattr(soft_grain_errors, "correct_grain_errors", correct)
    monkeypatch.setattr(correct_module, "use_size_classes", lambda tracks, *, soft: (tracks, ""))  # it removes them
    sequence, stated, true = corrected(tmp_path, "soft_radii_03", 9, 80)
    assert len(before) > 1
    for each in before:  # every pass finds the whole error, not what the former has left
        np.testing.assert_array_equal(each, stated)
    assert sequence.settings.soft
    assert np.std(sequence.tracks.radius - true) < 0.8 * np.std(stated - true)
    assert sequence.settings.soft_trust == MAX_TRUST_CORRECTED
    np.testing.assert_array_equal(sequence.packing.grains.radius, sequence.tracks.radius)


@pytest.mark.parametrize(("offset", "radius"), [(3.0, 0.5), (0.5, 3.0), (0.5, 0.5)])
def test_errors_of_centres_and_of_radii_are_compared_with_their_own_deviations(offset, radius):
    """offset, radius: their sizes over their standard deviations, of which that of the centres is much the greater."""
    rng = np.random.default_rng(2)
    n, sd = 500, np.array([1e-5, 1e-5, 1e-7])
    unit = rng.standard_normal((3, n))
    draws = (sd[:, None] * rng.standard_normal((200, 3, n))).reshape(200, 3 * n)
    found = GrainErrors(offset * sd[0] * unit[:2].T, radius * sd[2] * unit[2] + 3e-5, 1e-7, draws)
    assert soft_grain_errors._is_significant(found, 1.0) == (max(offset, radius) > 1.0)


@pytest.mark.thorough
def test_exact_radii_stay_as_stated(tmp_path):
    sequence, stated, _ = corrected(tmp_path, "soft", 9, 80)
    assert sequence.settings.soft
    np.testing.assert_array_equal(sequence.tracks.radius, stated)
    assert sequence.settings.soft_trust > MAX_TRUST_CORRECTED
    hard = replace(sequence, settings=replace(sequence.settings, soft=False))
    assert correct_soft_grains(hard) is hard


@pytest.mark.slow
def test_the_preliminary_solution_stops_where_the_first_frames_show_no_errors(tmp_path, monkeypatch):
    solved = []

    def counted(*args, **options):
        for each in solve_sequence(*args, **options):
            solved.append(each[0].frame)
            yield each

    monkeypatch.setattr(errors_by_forces, "solve_sequence", counted)
    sequence, stated, _ = corrected(tmp_path, "soft", 1, 150)
    assert solved == list(range(soft_grain_errors.PRELIMINARY_FRAMES))
    np.testing.assert_array_equal(sequence.tracks.radius, stated)


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "least"), [("soft_radii_03", 0.95), ("soft_unseen", 0.95)])
def test_forces_of_soft_rods_are_accurate_despite_wrong_input(tmp_path, scenario, least):
    solved = solve(tmp_path, scenario, 8, grains=300)
    found = []
    for frame in solved.frames[3:]:
        found.append(agreement(frame, solved.true[frame.frame]))
        assert frame.trust < found[-1] + 0.03
    assert np.mean(found) > least
