"""Synthetic photoelastic files have the errors of real ones, and the import reads them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from rodsight.exchange.foreign.observations import Convention, make_tracks
from rodsight.exchange.foreign.pegs import read_pegs, true_contacts
from rodsight.process.errors import InputError
from rodsight.synthetic.photoelastic import pegs_files
from rodsight.synthetic.photoelastic.pegs_files import RADIUS_DEFICIT, make_photoelastic
from rodsight.synthetic.scenarios.loading_paths import simulate_loading
from rodsight.synthetic.scenarios.scenario_folder import load_or_simulate
from rodsight.synthetic.scenarios.scenario_table import SCENARIOS

COUNT = 40

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")


def test_centres_radii_and_both_readings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    truth = simulate_loading(replace(SCENARIOS["nearly_jammed"].loading, frames=2), COUNT, seed=3)
    monkeypatch.setattr(pegs_files, load_or_simulate.__name__, lambda *arguments: truth)
    made = make_photoelastic(tmp_path / "solved", 0, grains=COUNT)
    observed, readings = read_pegs(tmp_path / "solved")
    imported = make_tracks(observed, Convention(unit=made.pixel_size, y_down=True), 1e-5)
    error = (imported.tracks.position - truth.position) / made.pixel_size
    error -= error.mean(axis=(0, 1))
    assert 0.1 < error.std() < 0.8
    offset = (truth.radius - imported.tracks.radius).mean() / made.pixel_size
    assert offset == pytest.approx(RADIUS_DEFICIT, abs=0.3)
    columns = true_contacts(readings, imported)
    both = [(a, b) for a, b in zip(columns["fn_i"], columns["fn_j"], strict=True) if a != "" and b != ""]
    assert 0.0 < np.corrcoef(np.array(both, float).T)[0, 1] < 0.999
    with pytest.raises(InputError, match="not an empty folder"):
        make_photoelastic(tmp_path / "solved", 0, grains=COUNT)
