"""A world made and solved as a run would solve it, with its true forces: what studies compare."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from solver.bodies.grains import Array
from solver.contacts.pairs import Keys
from solver.sequence.frame_forces import FrameForces

from ...experiment.experiment import Experiment, load_experiment
from ...inference.inference import CorrectedSequence, Inputs, SolvedFrame
from ...inference.settings import material_of, settings_of
from ...progress import Progress, silent
from ...sensitivity.networks import Networks
from ...sensitivity.spread import calibrated_inputs, solve_members, with_spread
from ...synthetic.worlds.making import make_world
from ...synthetic.worlds.names import WorldName
from .world_score import WorldPlan, solve_world, true_forces


@dataclass(frozen=True, slots=True)
class SolvedWorld:
    """One world of one seed, solved."""

    world: WorldName
    seed: int
    sequence: CorrectedSequence
    frames: list[SolvedFrame]
    true: tuple[tuple[Keys, Array], ...]  # keys (t,) and forces (t, 2) [N] of every frame
    members: tuple[Networks, ...] = ()  # the same solved again with resampled input, where that was asked for

    @property
    def checked(self) -> list[FrameForces]:
        """The forces as a run states them, once the motion of all frames has been asked for the friction."""
        return [each.forces for each in self.stated]

    @property
    def widened(self) -> list[FrameForces]:
        """The forces as a run with an ensemble states them: deviations with the spread of its members."""
        return with_spread(self.checked, self.members, self.sequence.settings.estimator)

    @property
    def stated(self) -> list[SolvedFrame]:
        """The frames as a run states them, their statistics included."""
        judged, check = self.sequence.check_friction([each.forces for each in self.frames])
        return [
            replace(each, forces=frame, statistics=self.sequence.restate(each.statistics, frame, check))
            for each, frame in zip(self.frames, judged, strict=True)
        ]


def solve_one(
    plan: WorldPlan, world: WorldName, seed: int, progress: Progress = silent, *, members: int = 0
) -> SolvedWorld:
    """Make a world and solve it; members: how many times again. Raises UnbalancedError where it cannot be simulated."""
    with TemporaryDirectory() as folder:
        made = make_world(Path(folder), world, seed, grains=plan.grains, kept=plan.folder / "kept", progress=progress)
        experiment = load_experiment(made.folder, plan.settings)
        sequence, frames = solve_world(experiment, progress)
        again = _solve_again(experiment, sequence, members) if members else ()
        return SolvedWorld(world, seed, sequence, frames, true_forces(experiment, sequence), again)


def _solve_again(experiment: Experiment, sequence: CorrectedSequence, members: int) -> tuple[Networks, ...]:
    config = experiment.config
    inputs = Inputs(
        sequence.tracks, sequence.walls, material_of(config), settings_of(config).without_sweeps(), sequence.verdicts
    )
    known = inputs.with_friction(sequence.packing.material.friction)
    return tuple(solve_members(calibrated_inputs(known), members))


def solve_worlds(
    plan: WorldPlan,
    worlds: Sequence[WorldName],
    seeds: Sequence[int],
    progress: Progress = silent,
    *,
    members: int = 0,
) -> Iterator[SolvedWorld]:
    """Every world of every seed, one after the other; members: how many times each is solved again."""
    cases: list[tuple[WorldName, int]] = [(world, seed) for world in worlds for seed in seeds]
    for done, (world, seed) in enumerate(cases):
        progress("worlds", done, len(cases))
        yield solve_one(plan, world, seed, members=members)
