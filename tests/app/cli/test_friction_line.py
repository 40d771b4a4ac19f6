"""The friction that fits the motion is blamed only where nothing else is."""

from __future__ import annotations

import pytest
from rodsight.cli.summary_table import friction_line, hidden_friction_line

FOUND = {"measured": 0.11, "low": 0.08, "high": 0.13, "given": 0.25, "agrees": False}


@pytest.mark.parametrize(
    ("causes", "words"),
    [
        ([], "contradicts[/] the given 0.25"),
        (["friction"], "contradicts[/] the given 0.25"),
        (["walls_shifted"], "not that of the rods: something else is wrong"),
    ],
)
def test_another_friction_is_that_of_the_rods_unless_another_cause_is_named(causes, words) -> None:
    assert words in friction_line(FOUND, causes)
    assert "0.11 (0.08 to 0.13)" in friction_line(FOUND, causes)


def test_friction_that_agrees_is_stated_whatever_is_wrong() -> None:
    assert "agrees with the given 0.25" in friction_line(FOUND | {"agrees": True}, ["walls_shifted"])


def test_friction_that_noise_hides_is_neither_given_nor_measured() -> None:
    assert hidden_friction_line(0.196).startswith("The motion does not show the friction: 20 % of the contacts slide")
