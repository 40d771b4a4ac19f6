"""Tracks so precise that the overlaps of hard rods show: stress and sliding are those that motion tells."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.inference.inference import CorrectedSequence
from rodsight.progress import silent
from rodsight.study.worlds.world_score import solve_world, true_forces

from solver.statistics.agreement import compare_forces
from tests.program import RODSIGHT

SYNTH = ("--preset", "small", "--seed", "3", "--frames", "8", "--no-photographs")  # 1 µm; rods overlap by 4 µm

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("precise") / "ex"
    subprocess.run([*RODSIGHT, "synth", str(made), *SYNTH], check=True, capture_output=True)
    return made


def score(folder: Path, positions: str) -> tuple[CorrectedSequence, np.ndarray]:
    """r of f_n and of f_t, and the scale, on average over the frames that a motion leads to."""
    experiment = load_experiment(folder, (f"solver.positions={positions}",))
    sequence, solved = solve_world(experiment, silent)
    true, seen = true_forces(experiment, sequence), []
    for frame in [each.forces for each in solved][1:]:
        found = compare_forces(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), *true[frame.frame])
        seen.append((found.r_fn, found.r_ft, found.scale))
    return sequence, np.mean(seen, axis=0)


def test_visible_overlaps_of_hard_rods_take_nothing_from_what_motion_tells(folder):
    sequence, found = score(folder, "needed")
    _, motion = score(folder, "never")
    assert sequence.settings.overlap_seen
    assert found[0] > motion[0] - 0.003
    assert found[1] > motion[1] - 0.02
    assert found[2] == pytest.approx(1.0, abs=0.04)
