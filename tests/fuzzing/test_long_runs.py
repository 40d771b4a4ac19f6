"""A thousand photographs take the memory of fifty. The quick form is tests/app/results/test_any_length.py."""

from __future__ import annotations

import pytest

from .long_runs import EARLY, growth, measure
from .table import FRAMES, GROWTH, note


@pytest.mark.slow
def test_a_long_run_takes_no_more_memory_than_a_short_one(originals, tmp_path):
    found = measure(originals.tracked, tmp_path, FRAMES)
    grown = {stage: growth(taken) for stage, taken in found.items() if max(taken) > EARLY}
    told = {stage: f"{1e-6 * a:.0f} to {1e-6 * b:.0f} MB ({c:+.1%})" for stage, (a, b, c) in grown.items()}
    note("frames", tried=FRAMES, wrong=sum(share > GROWTH for _, _, share in grown.values()), **told)
    assert {"solving", "recording", "review", "view"} <= grown.keys()
    assert [stage for stage, (_, _, share) in grown.items() if share > GROWTH] == []
