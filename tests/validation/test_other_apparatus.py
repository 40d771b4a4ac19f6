"""Apparatus that no fit has read: a drum, a box that tilts, a footing whose edges rods stand beside."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.synthetic.scenarios.preset_names import ScenarioName

from tests.app.inference.scenarios import agreement, solve

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("scenario", "seed", "least"), [("drum", 42, 0.96), ("tilted_bed", 42, 0.955), ("footing", 43, 0.92)]
)
def test_forces_in_other_apparatus(tmp_path, scenario: ScenarioName, seed: int, least: float) -> None:
    solved = solve(tmp_path / scenario, scenario, seed, grains=200)
    r = [agreement(frame, true) for frame, true in zip(solved.frames[3:], solved.true[3:], strict=True)]
    assert np.mean(r) > least, np.round(r, 3)
