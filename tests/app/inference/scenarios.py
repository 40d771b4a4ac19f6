"""Scenarios solved once for the tests of the inference."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rodsight.experiment.experiment import Experiment, load_experiment
from rodsight.inference.corrected_sequence import CorrectedSequence
from rodsight.inference.frame_store import MemoryStore
from rodsight.inference.infer_sequence import infer_sequence
from rodsight.inference.inference_settings import material_of, settings_of
from rodsight.inference.inputs import Inputs
from rodsight.inference.solve_frames import InferenceObserver
from rodsight.results.results import Results
from rodsight.solver.contacts.pairs import Keys
from rodsight.solver.frame_forces import FrameForces
from rodsight.solver.statistics.agreement import compare_forces
from rodsight.study.scenarios.scenario_score import read_scenario, true_forces
from rodsight.synthetic.scenarios.preset_names import ScenarioName
from rodsight.synthetic.scenarios.scenario_folder import make_scenario


def read_inputs(experiment: Experiment) -> Inputs:
    """Inputs of an experiment without recorded sweeps."""
    tracks, walls = read_scenario(experiment)
    assert walls is not None
    return Inputs(tracks, walls, material_of(experiment.config), settings_of(experiment.config).without_sweeps())


class SequenceKeeper(InferenceObserver):
    """Keeps the corrected sequence."""

    sequence: CorrectedSequence

    def corrected(self, sequence: CorrectedSequence) -> None:
        self.sequence = sequence


@dataclass(frozen=True)
class Solved:
    """A scenario whose frames are solved in order; the first is not yet estimated from the others."""

    inputs: Inputs
    sequence: CorrectedSequence
    store: MemoryStore
    true: tuple[tuple[Keys, np.ndarray], ...]

    @property
    def frames(self) -> list[FrameForces]:
        return [each.forces for each in self.store.frames]

    def complete(self) -> Results:
        """Results after the last step: nothing is solved again but the first frame."""
        return infer_sequence(self.inputs, store=MemoryStore(list(self.store.frames)))


def solve(folder: Path, scenario: ScenarioName, seed: int, *, grains: int, frames: int | None = None) -> Solved:
    """Solve the first frames of a scenario; None: all."""
    experiment = load_experiment(make_scenario(folder, scenario, seed, grains=grains).folder, ())
    inputs, keeper, store = read_inputs(experiment), SequenceKeeper(), MemoryStore()
    if frames is not None:
        tracks, walls = inputs.tracks.frames(0, frames), inputs.walls.frames(0, frames)
        inputs = Inputs(tracks, walls, inputs.material, inputs.settings)
    infer_sequence(inputs, keeper, store, complete=False)
    return Solved(inputs, keeper.sequence, store, true_forces(experiment, keeper.sequence))


def agreement(frame: FrameForces, true: tuple[Keys, np.ndarray]) -> float:
    """Correlation of f_n with the truth."""
    return compare_forces(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), *true).r_fn
