"""Reasons of the lowest trust at the end of a run: the largest, each on its own line."""

from __future__ import annotations

from rodsight.cli.summary_table import MOST_PENALTIES, penalty_lines
from rodsight.solver.assessment.reasons import join_reasons

REASONS = [f"reason {k}: its cure; or another" for k in range(MOST_PENALTIES + 2)]


def summary(*of_frames: list[str]) -> dict:
    return {"trust": [0.9, 0.4], "trust_penalties": [join_reasons(*each) for each in of_frames]}


def test_each_reason_has_its_line() -> None:
    assert penalty_lines(summary([], REASONS[:2])) == [
        "Lowest trust 0.40 in frame 1, because", f"- {REASONS[0]}", f"- {REASONS[1]}",
    ]  # fmt: skip


def test_smaller_reasons_are_counted() -> None:
    *shown, last = penalty_lines(summary([], REASONS))
    assert shown[1:] == [f"- {each}" for each in REASONS[:MOST_PENALTIES]]
    assert last == "- 2 smaller reasons: see the tab Summary of the recording"


def test_a_frame_without_reasons_names_the_next_one() -> None:
    first, *rest = penalty_lines(summary(REASONS[:1], []))
    assert first == "Lowest trust 0.40 in frame 1; 0.90 in frame 0, because"
    assert len(rest) == 1
    assert penalty_lines(summary([], [])) == []
