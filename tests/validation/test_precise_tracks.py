"""Tracks so precise that the overlaps of hard rods are visible: forces stay those of the motion estimate."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.inference.corrected_sequence import CorrectedSequence
from rodsight.process.progress import no_progress
from rodsight.solver.statistics.agreement import compare_forces
from rodsight.study.scenarios.scenario_score import solve_scenario, true_forces

from tests.program import RODSIGHT

SYNTH = ("--preset", "small", "--seed", "3", "--frames", "8", "--no-photographs")  # 1 µm; rods overlap by 4 µm

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("precise") / "ex"
    subprocess.run([*RODSIGHT, "synth", str(made), *SYNTH], check=True, capture_output=True)
    return made


def score(folder: Path, positions: str) -> tuple[CorrectedSequence, np.ndarray]:
    """Sequence, and means of r of f_n, of f_t and of the scale over all frames but the first."""
    experiment = load_experiment(folder, (f"solver.positions={positions}",))
    solution = solve_scenario(experiment, no_progress)
    sequence = solution.sequence
    true, seen = true_forces(experiment, sequence), []
    for frame in solution.results.frames[1:]:
        found = compare_forces(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), *true[frame.frame])
        seen.append((found.r_fn, found.r_ft, found.scale))
    return sequence, np.mean(seen, axis=0)


def test_visible_overlaps_of_hard_rods_do_not_degrade_the_forces(folder):
    sequence, found = score(folder, "needed")
    _, motion = score(folder, "never")
    assert sequence.settings.measured_overlap
    assert found[0] > motion[0] - 0.003
    assert found[1] > motion[1] - 0.02
    assert found[2] == pytest.approx(1.0, abs=0.04)
