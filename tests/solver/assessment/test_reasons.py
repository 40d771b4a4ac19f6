"""Reasons in one text come back as they were."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from rodsight.solver.assessment.penalties import find_penalties
from rodsight.solver.assessment.reasons import SEPARATOR, join_reasons, split_reasons

from tests.solver.assessment.test_penalties import ASSESSED


@pytest.mark.parametrize("reasons", [[], ["noise"], ["radii: measure them; or calibrate", "noise"]])
def test_reasons_come_back(reasons: list[str]) -> None:
    assert split_reasons(join_reasons(*reasons)) == reasons


def test_empty_texts_are_no_reasons_and_texts_of_several_stay_several() -> None:
    assert split_reasons(join_reasons("", "walls", join_reasons("noise", "step"))) == ["walls", "noise", "step"]


def test_no_penalty_contains_the_separator() -> None:
    wrong = replace(
        ASSESSED, correction=0.3, disagreement=0.5, agreement=0.5, old_unbalance=0.2, power_gap=0.4, unbalance=0.1,
        shear=math.radians(0.5), load_fraction=0.6, corrected_gap=1e-4,
    )  # fmt: skip
    words = [each.words for each in find_penalties(wrong)]
    assert len(words) >= 4
    assert not any(SEPARATOR in each for each in words)
