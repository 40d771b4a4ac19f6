"""The memory of a run with 1000 photographs equals that with 50; quick form: tests/app/results/test_any_length.py."""

from __future__ import annotations

import pytest

from .long_runs import EARLY, growth, measure
from .table import FRAMES, GROWTH, note


@pytest.mark.slow
def test_a_long_run_takes_no_more_memory_than_a_short_one(originals, tmp_path):
    found = measure(originals.tracked, tmp_path, FRAMES)
    growths = {stage: growth(memory) for stage, memory in found.items() if max(memory) > EARLY}
    figures = {stage: f"{1e-6 * a:.0f} to {1e-6 * b:.0f} MB ({c:+.1%})" for stage, (a, b, c) in growths.items()}
    note("frames", tried=FRAMES, wrong=sum(fraction > GROWTH for _, _, fraction in growths.values()), **figures)
    assert {"solving", "recording", "review", "view"} <= growths.keys()
    assert [stage for stage, (_, _, fraction) in growths.items() if fraction > GROWTH] == []
