"""The fit of the weights of a mixture finds them, and judges the mixtures that a run makes."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.process.progress import no_progress
from rodsight.solver.assessment.mixture_trust import WEIGHT_TERMS, motion_reliability, weight_coefficients
from rodsight.solver.mixture.position_estimates import PositionEstimates
from rodsight.study.scenarios.mixture_fit import ALONE, WEIGHTS, MixtureSample, fit_weight, mixed_forces
from rodsight.study.scenarios.scenario_score import solve_scenario
from rodsight.synthetic.scenarios.scenario_folder import make_scenario
from scipy.special import expit

COUNT = 240
PRESENT = weight_coefficients(loaded=True)


def _sample(seed: int) -> tuple[MixtureSample, np.ndarray]:
    """Make frames whose best weight follows from two of the terms, and those weights."""
    rng = np.random.default_rng(seed)
    terms = rng.normal(2.0, 1.0, (COUNT, len(WEIGHT_TERMS)))
    terms[:, 0] = 1.0
    best = expit(0.5 + 1.5 * (terms[:, 1] - 2.0) - (terms[:, 3] - 2.0))
    r = 0.97 - 0.2 * (WEIGHTS - best[:, None]) ** 2
    kind, present = np.where(rng.random(COUNT) < 0.5, "shear", "biaxial"), expit(terms @ PRESENT)
    return MixtureSample(kind, terms, r, r[:, -1], present), best


@pytest.mark.slow
def test_the_fitted_weight_is_the_best_one_on_frames_that_were_not_fitted() -> None:
    coefficients = fit_weight(_sample(1)[0])
    other, best = _sample(2)
    np.testing.assert_allclose(expit(other.terms @ coefficients), best, atol=0.15)
    assert (other.r.max(axis=1) - other.reached(expit(other.terms @ coefficients))).mean() < 0.002
    assert (other.r.max(axis=1) - other.reached(np.full(COUNT, best.mean()))).mean() > 0.01


@pytest.mark.slow
def test_a_fit_takes_little_from_a_kind_that_the_present_weights_serve_best() -> None:
    rng, present = np.random.default_rng(3), PRESENT
    terms = rng.normal(0.0, 0.01, (COUNT, len(present)))
    terms[:, 0], terms[:, 1] = 1.0, terms[:, 1] - present[0] / present[1]  # present weights of about one half
    kind = np.array(["shear", "biaxial", "gravity"])[np.arange(COUNT) % 3]
    best = np.where(kind == "shear", expit(terms @ present), 1.0)
    r = 0.97 - 0.2 * (WEIGHTS - best[:, None]) ** 2
    weight = expit(terms @ fit_weight(MixtureSample(kind, terms, r, np.zeros(COUNT), expit(terms @ present))))
    assert 0.55 < weight.mean() < 0.7  # 5/6 if every kind counted the same


@pytest.mark.slow
def test_mixtures_are_those_of_a_run(tmp_path) -> None:
    made = make_scenario(tmp_path, "theta_sign", 3, grains=60)
    as_given = ("calibration.enabled=false",)  # the rotations, too: both estimates disagree
    alone = solve_scenario(load_experiment(made.folder, (*ALONE, *as_given)), no_progress)
    mixed = solve_scenario(load_experiment(made.folder, as_given), no_progress)
    sequence, compared = alone.sequence, 0
    estimates = PositionEstimates(sequence.packing, sequence.snapshots, sequence.settings.posterior, 1)
    first = 4  # those before it continue from the mixed forces of frame 0, which solving by motion alone lacks
    for frame, run, evidence in zip(
        alone.unchecked[first:], mixed.unchecked[first:], mixed.evidence[first:], strict=True
    ):
        if not evidence.position_weight > 0.0:
            continue
        positions = estimates.at(frame.frame)
        assert positions is not None
        weight = np.array([evidence.position_weight])
        (force,) = mixed_forces(sequence, frame, positions, motion_reliability(evidence), weight)
        assert np.abs(force - run.fn).max() < 1e-3 * run.fn.mean()
        compared += 1
    assert compared > 2
