"""Fits of the trust: the effect of closed gaps, and measures that most frames have at their least value."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console
from rodsight.solver.assessment.expected_correlation import CLOSED, MEASURES
from rodsight.study.fitting.additive_fit import fit_additive
from rodsight.study.scenarios.scenario_score import ScenarioScore
from rodsight.study.scenarios.trust_study import (
    CLOSED_KINDS,
    CLOSED_STEPS,
    TrustSample,
    describe_closed_fit,
    describe_fits,
    fit_by_title,
    fit_closed,
    print_trust,
)

ALONE = 0.9  # trust by all other evidence


def still(closed: float, r: float, scenario=CLOSED_KINDS[0]) -> ScenarioScore:
    """Ten frames of one closed overlap and one r, the trust as a run states it."""
    trust = ALONE * CLOSED / (CLOSED + closed)
    return ScenarioScore(scenario, 1, "", r=(r,) * 10, trust=(trust,) * 10, closed_overlap=(closed,) * 10)


@pytest.mark.parametrize("step", CLOSED_STEPS)
def test_the_greatest_step_with_a_sufficient_trust_is_found(step):
    closed = 0.004
    limit = ALONE * step / (step + closed)
    assert fit_closed([still(closed, limit - 0.02)]) == step
    assert describe_closed_fit([still(closed, limit - 0.02)]).endswith(f"closed_overlap = {step:g}")


def test_kinds_that_slide_are_not_read():
    assert math.isnan(fit_closed([still(0.004, 0.5, "shear")]))
    assert fit_closed([still(0.004, 0.99), still(0.004, 0.99, "shear")]) == CLOSED_STEPS[0]


def test_values_above_the_usual_one_have_knots_of_their_own():
    rng = np.random.default_rng(3)
    x = np.where(rng.random(4000) < 0.9, 0.0, rng.uniform(0.5, 4.0, 4000))
    fit = fit_additive({"x": x}, {}, ["x"], 2.0 - 0.4 * x, np.ones(len(x)) / len(x))
    assert len(fit.terms["x"][0]) > 6
    shown = np.array([0.0, 1.0, 2.0, 3.0])
    assert fit.score({"x": shown}, {}) == pytest.approx(2.0 - 0.4 * shown, abs=0.25)


def unloaded(scenario, seed: int, overlaps: bool = False) -> ScenarioScore:
    """Eleven frames without a known load; r falls with the first measure."""
    rng = np.random.default_rng(seed)
    measures = np.exp(rng.uniform(np.log(0.03), np.log(0.3), (11, len(MEASURES))))
    r = 0.97 - 0.5 * measures[:, 0]
    unknown = [None] * len(MEASURES)
    return ScenarioScore(
        scenario, seed, "", r=tuple(r), trust=(0.8,) * 11, expected=(0.9,) * 11, status=("settled",) * 11,
        measures=tuple(unknown if overlaps else row for row in measures.tolist()), overlaps=(overlaps,) * 11,
        loaded=False,
    )  # fmt: skip


def test_only_tables_are_fitted_of_which_enough_kinds_are_read():
    kinds = ["outer", "outer_biaxial", "outer_isotropic", "isotropic", "periodic", "unknown_load"]
    scores = [unloaded(kind, seed) for kind in kinds for seed in (1, 2)]
    scores += [unloaded("nearly_jammed", seed, overlaps=True) for seed in (1, 2)]  # nothing else is known of them
    fits = fit_by_title(scores)
    assert list(fits) == ["unloaded"]
    tables = describe_fits(fits, scores, [], 5)
    assert [each.split("\n")[0] for each in tables] == [
        "[expected_correlation.unloaded]", "[expected_correlation.unloaded_prediction]"
    ]  # fmt: skip
    assert list(fit_by_title(scores[:4])) == []


def test_frames_are_counted_by_group_and_by_status():
    rising = tuple(0.001 * k for k in range(11))
    known = replace(unloaded("outer", 1), trust=tuple(0.5 + each for each in rising))
    wrong = replace(
        known, scenario="shear", r=tuple(0.6 + each for each in rising), trust=tuple(0.95 + each for each in rising),
        status=("suspect",) * 11,
    )  # fmt: skip
    console = Console(width=300, record=True, file=io.StringIO())
    print_trust(console, "all kinds", TrustSample.of([known, wrong]))
    lines = {line.partition(":")[0]: line for line in console.export_text().splitlines()}
    assert "10 frames, T > r + .03 in 0.0 %" in lines["settled"]
    assert "0 have T ≥ 0.9" in lines["settled"]
    assert "10 frames, T > r + .03 in 100.0 %" in lines["suspect"]
    assert "10 have T ≥ 0.9, and a tenth of these r < 0.60" in lines["suspect"]
    assert "20 frames" in lines["all"]
