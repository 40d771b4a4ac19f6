"""What a photoelastic test leaves is written with the faults of real ones, and is read by the import."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from rodsight.errors import InputError
from rodsight.exchange.foreign.observations import Convention, arrange
from rodsight.exchange.foreign.pegs import read_pegs, true_contacts
from rodsight.synthetic import photoelastic
from rodsight.synthetic.photoelastic import TOO_SMALL, make_photoelastic
from rodsight.synthetic.worlds.courses import simulate_course
from rodsight.synthetic.worlds.making import simulate_kept
from rodsight.synthetic.worlds.table import WORLDS

COUNT = 40

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")


def test_centres_radii_and_both_readings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    truth = simulate_course(replace(WORLDS["nearly_jammed"].course, frames=2), COUNT, seed=3)
    monkeypatch.setattr(photoelastic, simulate_kept.__name__, lambda *arguments: truth)
    made = make_photoelastic(tmp_path / "solved", 0, grains=COUNT)
    seen, told = read_pegs(tmp_path / "solved")
    arranged = arrange(seen, Convention(unit=made.pixel_size, y_down=True), 1e-5)
    error = (arranged.tracks.position - truth.position) / made.pixel_size
    error -= error.mean(axis=(0, 1))
    assert 0.1 < error.std() < 0.8
    offset = (truth.radius - arranged.tracks.radius).mean() / made.pixel_size
    assert offset == pytest.approx(TOO_SMALL, abs=0.3)
    columns = true_contacts(told, arranged)
    both = [(a, b) for a, b in zip(columns["fn_i"], columns["fn_j"], strict=True) if a != "" and b != ""]
    assert 0.0 < np.corrcoef(np.array(both, float).T)[0, 1] < 0.999
    with pytest.raises(InputError, match="not an empty folder"):
        make_photoelastic(tmp_path / "solved", 0, grains=COUNT)
