"""Measured friction and tuned radii of the committed sample."""

import json
from pathlib import Path

import pytest
from rodsight.cli.main import main

SAMPLE = Path(__file__).parents[2] / "sample_data" / "shear"
TRUE_FRICTION = 0.25


def summary_of(out: Path, *settings: str) -> dict:
    arguments = [part for setting in settings for part in ("--set", setting)]
    with pytest.raises(SystemExit) as stop:
        main(["solve", str(SAMPLE), "--out", str(out), "--quiet", *arguments])
    assert stop.value.code == 0
    return json.loads((out / "summary.json").read_text())


@pytest.mark.slow
@pytest.mark.parametrize("given", [0.15, 0.25, 0.40])
def test_friction_is_measured_from_the_motion_for_any_given_value(given, tmp_path):
    settings = (f"material.friction={given}", f"material.wall_friction={given}", "recording.sweeps=none")
    found = summary_of(tmp_path / "out", *settings)["friction"]
    assert found["enclosed"]
    assert found["low"] <= TRUE_FRICTION <= found["high"]
    assert found["agrees"] == (given == TRUE_FRICTION)


@pytest.mark.slow
def test_radii_are_tuned_to_a_required_coordination_number(tmp_path):
    summary = summary_of(tmp_path / "out", "contacts.coordination=3.5", "recording.sweeps=none")
    assert 0 < summary["radius_change"] < 2e-4
