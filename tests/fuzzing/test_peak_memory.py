"""The greatest memory of a whole command grows little with the number of photographs, between its stages included."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from .long_runs import FEW
from .peak_memory import growth_of, peaks_of
from .table import PEAK_GROWTH, note

SHORT, LONG = 100, 1000


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists() or not hasattr(os, "wait4"), reason="memory is not reported")
def test_the_memory_of_whole_commands_grows_little_with_length(tmp_path: Path):
    peaks = peaks_of((SHORT, LONG), tmp_path, settings=FEW)
    growth = growth_of(peaks, (SHORT, LONG))
    large = {name: each for name, each in growth.items() if each > PEAK_GROWTH}
    note("peak", tried=LONG, wrong=len(large), **{name: f"{each:.3f} MB a photograph" for name, each in growth.items()})
    assert large == {}, (peaks, growth)
