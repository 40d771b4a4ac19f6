"""Division of the error of a frame among its causes; frames that a step leaves out are interpolated."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.cli.summary_table import budget_lines
from rodsight.results.summary import summarize
from rodsight.robustness import error_budget
from rodsight.robustness.error_budget import ErrorBudget, divide, measure_budget
from rodsight.robustness.networks import gather
from rodsight.solver.frame_forces import ERROR_PARTS

from tests.app.recording.fake_results import make_results


@pytest.fixture(scope="module")
def results():
    return make_results(5, 6, 5, sweeps=2)


def test_fractions_add_up_to_one_and_the_rest_is_the_method():
    variance = np.array([[0.01, 0.02, 0.0, 0.0, 0.0, 0.0], [0.05, 0.05, 0.0, 0.0, 0.0, 0.0]])
    found = divide(variance, np.array([0.04, 0.04]))
    assert found.fraction.sum(axis=1) == pytest.approx([1.0, 1.0])
    assert found.fraction[0] == pytest.approx([0.25, 0.5, 0.0, 0.0, 0.0, 0.25])
    assert found.fraction[1, -1] == 0.0  # causes larger than the stated error increase it
    assert found.error == pytest.approx([0.2, np.sqrt(0.1)])
    assert np.isnan(divide(variance[:1], np.array([np.nan])).fraction).all()


def test_every_cause_is_compared_with_the_unvaried_solution(results, monkeypatch):
    """Positions change forces by a tenth, steps by a fifth, weighted by a half; the other causes change nothing."""
    frames = [replace(each, fn_sd=0.3 * each.fn, ft_sd=0.3 * np.abs(each.ft)) for each in results.frames]
    nominal = gather(np.arange(5), frames, results.statistics)

    def solve(inputs, item):
        factor = {"positions": 1.1, "steps": 1.2}.get(item[0], 1.0)
        rows = np.arange(0, 5, 2) if item[0] == "steps" else np.arange(5)
        parts = [replace(frames[k], fn=factor * frames[k].fn, ft=factor * frames[k].ft) for k in rows]
        return gather(rows, parts, [results.statistics[k] for k in rows])

    monkeypatch.setattr(error_budget, "_solve_part", solve)
    cases = dict.fromkeys(("positions", "radii", "friction", "contacts", "steps"), error_budget.Case((), 0))
    found = measure_budget(nominal, frames, cases)  # type: ignore[arg-type]
    expected = np.array([0.01, 0.0, 0.0, 0.0, 0.01, 0.07]) / 0.09
    assert found.fraction == pytest.approx(np.tile(expected, (5, 1)), abs=1e-9)
    assert found.error == pytest.approx(0.3)


def test_the_summary_reports_the_effect_of_halving_the_largest_cause(results):
    fraction = np.tile([0.5, 0.1, 0.0, 0.1, 0.0, 0.3], (5, 1))
    budget = ErrorBudget(fraction, np.full(5, 0.2))
    attributed = replace(results, frames=[budget.apply_to(each) for each in results.frames])
    summary = summarize(attributed, None, {})
    assert list(summary["error_budget"]["share"]) == list(ERROR_PARTS)
    divided, halved = budget_lines(summary)
    assert "have an error of 20 %" in divided
    assert "positions 50 %" in divided
    assert "positions and rotations would reduce it to 15.8 % from 20.0 %" in halved  # 0.2 √(1 − ¾ · ½)
    assert budget_lines(summarize(results, None, {})) == []
