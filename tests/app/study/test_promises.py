"""What is promised of a test is set beside what came out of it, and its constants are fitted to that."""

import io
import math
from dataclasses import replace

import pytest
from rich.console import Console
from rodsight.errors import InputError
from rodsight.inference.data_budget import EXPECTED, REFERENCE_STEP, DataBudget
from rodsight.study.worlds.promises import KeptPromise, fit_promise, print_promises
from rodsight.study.worlds.world_score import WorldScore

GOOD = DataBudget(3, 1e-5, 1e-5, 1.2e-4, REFERENCE_STEP, 0.2, 0.1, -5e-6, 1.4e-5, 0.016)
BUDGETS = [
    replace(GOOD, noise=noise, shear=step * REFERENCE_STEP) for noise in (1e-5, 2e-5, 5e-5) for step in (1.0, 2.0, 4.0)
]


def kept(budget: DataBudget | None, r: float | None) -> KeptPromise:
    return KeptPromise(WorldScore("shear", 2, "", r=(None, None, None, r)), budget)


def test_the_fit_finds_what_led_to_r():
    def error(budget: DataBudget, sign: int) -> float:
        noise, step = budget.witnesses
        return math.exp(-3.0 + 0.3 * noise + 0.5 * step + 0.2 * sign)

    found = fit_promise([kept(each, 1.0 - error(each, sign)) for each in BUDGETS for sign in (-1, 1)])
    assert (found.a, found.b, found.c) == pytest.approx((-3.0, 0.3, 0.5))
    assert found.sd == pytest.approx(0.2 * math.sqrt(18 / 15))


def test_tests_of_which_nothing_is_known_do_not_fit():
    with pytest.raises(InputError, match="needs 4"):
        fit_promise([kept(BUDGETS[0], 0.9), kept(None, 0.9), kept(BUDGETS[1], None), kept(BUDGETS[2], 0.9)])


def test_a_promise_that_is_not_kept_is_told():
    r, low, high = GOOD.expected
    cases = [kept(GOOD, r), kept(GOOD, low - 0.01), kept(GOOD, high + 1e-3), kept(None, 0.5), kept(GOOD, None)]
    assert [each.inside for each in cases] == [True, False, False, None, None]
    told = io.StringIO()
    print_promises(Console(file=told, width=200), cases)
    assert told.getvalue().count("outside") == 2
    assert "1 of 3 lie in their interval" in told.getvalue()
    assert "nothing is promised" in told.getvalue()


def test_the_constants_in_use_say_what_more_noise_and_larger_steps_cost():
    assert EXPECTED.b > 0.0
    assert EXPECTED.c > 0.0
    assert 0.1 < EXPECTED.sd < 1.0
