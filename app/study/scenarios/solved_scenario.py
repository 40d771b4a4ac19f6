"""A scenario solved with the settings of a run, with its true forces, for comparison in studies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from ...experiment.experiment import Experiment, load_experiment
from ...inference.corrected_sequence import CorrectedSequence
from ...inference.inference_settings import material_of, settings_of
from ...inference.inputs import Inputs
from ...process.progress import Progress, no_progress
from ...robustness.ensemble_sd import calibrated_inputs, solve_members, with_ensemble_sd
from ...robustness.networks import Networks
from ...solver.bodies.grains import Array
from ...solver.contacts.pairs import Keys
from ...solver.frame_forces import FrameForces
from ...synthetic.scenarios.preset_names import ScenarioName
from .scenario_score import ScenarioSolution, StudyPlan, make_planned, solve_scenario, true_forces


@dataclass(frozen=True, slots=True)
class SolvedScenario:
    """One scenario of one seed, solved."""

    scenario: ScenarioName
    seed: int
    solution: ScenarioSolution
    true: tuple[tuple[Keys, Array], ...]  # keys (t,) and forces (t, 2) [N] of every frame
    members: tuple[Networks, ...] = ()  # solutions with resampled input, if requested

    @property
    def frames(self) -> Sequence[FrameForces]:
        """The forces as a run states them, after the friction check."""
        return self.solution.results.frames

    @property
    def widened(self) -> list[FrameForces]:
        """The forces as a run with an ensemble states them, with standard deviations from its members."""
        return with_ensemble_sd(self.frames, self.members, self.solution.sequence.settings.estimator)


def solve_one(plan: StudyPlan, scenario: ScenarioName, seed: int, *, members: int = 0) -> SolvedScenario:
    """Make and solve a scenario; members: solutions with resampled input. Raises UnbalancedError."""
    with TemporaryDirectory() as folder:
        made = make_planned(plan, Path(folder), scenario, seed)
        experiment = load_experiment(made.folder, plan.settings)
        solution = solve_scenario(experiment, no_progress)
        again = _solve_again(experiment, solution.sequence, members) if members else ()
        return SolvedScenario(scenario, seed, solution, true_forces(experiment, solution.sequence), again)


def _solve_again(experiment: Experiment, sequence: CorrectedSequence, members: int) -> tuple[Networks, ...]:
    config = experiment.config
    inputs = Inputs(
        sequence.tracks, sequence.walls, material_of(config), settings_of(config).without_sweeps(), sequence.verdicts
    )
    known = inputs.with_friction(sequence.packing.material.friction)
    return tuple(solve_members(calibrated_inputs(known), members))


def solve_scenarios(
    plan: StudyPlan,
    scenarios: Sequence[ScenarioName],
    seeds: Sequence[int],
    progress: Progress = no_progress,
    *,
    members: int = 0,
) -> Iterator[SolvedScenario]:
    """Solve every scenario of every seed; members: solutions of each with resampled input."""
    cases: list[tuple[ScenarioName, int]] = [(scenario, seed) for scenario in scenarios for seed in seeds]
    for done, (scenario, seed) in enumerate(cases):
        progress("scenarios", done, len(cases))
        yield solve_one(plan, scenario, seed, members=members)
