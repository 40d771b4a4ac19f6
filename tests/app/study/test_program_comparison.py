"""The recipe of the authors' own program: its stopping, its contacts, and its row in the table."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO

import numba
import numpy as np
import pytest
from rich.console import Console
from rodsight.experiment.experiment import load_experiment
from rodsight.inference.inputs import Inputs
from rodsight.solver.bodies.motion import motion_from
from rodsight.solver.contacts.pairs import split_keys
from rodsight.solver.nlgs.interval import Interval
from rodsight.solver.nlgs.problem import ContactProblem, inertial_impedance
from rodsight.solver.nlgs.solve import NlgsSettings, solve
from rodsight.study import program_comparison as comparison
from rodsight.synthetic.synthesis import Synthesis, SynthesisSettings, synthesize

from tests.app.inference.scenarios import read_inputs

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")

RODS, FRAMES = 60, 5
TOUCHING = 1.003  # factor of the true radii at which all contacts overlap


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Synthesis:
    folder = tmp_path_factory.mktemp("programs") / "lab"
    return synthesize(
        folder, SynthesisSettings(preset="1g2e", grains=RODS, frames=FRAMES, photographs=False, noise=1e-6, seed=2)
    )


@pytest.fixture(scope="module")
def inputs(made: Synthesis) -> Inputs:
    return read_inputs(load_experiment(made.folder))


def true_fields(made: Synthesis) -> list[comparison.FrameField]:
    truth, fields = made.truth, []
    bodies = len(truth.radius) + len(truth.wall_names)
    for k in range(truth.frame_count):
        rows = slice(truth.offset[k], truth.offset[k + 1])
        key = truth.i[rows].astype(np.int64) * bodies + truth.j[rows]
        fields.append((key, np.column_stack([truth.fn[rows], truth.ft[rows]])))
    return fields


def problem_of(inputs: Inputs) -> tuple[ContactProblem, int]:
    packing = comparison._packing_of(inputs, comparison.AuthorsSettings(TOUCHING))
    snapshots = comparison.make_snapshots(inputs.tracks, inputs.walls)
    motion = motion_from(*snapshots[:2])
    impedance = inertial_impedance(packing.grains, interval=motion.interval)
    problem, contacts, _ = Interval(packing, motion, comparison._TouchingNetwork()).at(1.0, impedance)
    return problem, contacts.count


def test_sweeps_end_when_the_sum_of_normal_forces_is_steady(inputs: Inputs) -> None:
    problem, count = problem_of(inputs)
    force = comparison.sweep_until_steady(problem, np.zeros((count, 2)))
    further = solve(problem, NlgsSettings(sweeps=1), guess=force).fn.sum()
    assert abs(further - force[:, 0].sum()) < comparison.STEADY_CHANGE * further
    short = comparison.sweep_until_steady(problem, np.zeros((count, 2)), most=40)
    np.testing.assert_allclose(short, solve(problem, NlgsSettings(sweeps=40)).force)


def test_the_least_number_of_sweeps_is_that_of_steady_ones(inputs: Inputs) -> None:
    """A steady start is swept until 500 sweeps in succession changed little."""
    problem, count = problem_of(inputs)
    steady = solve(problem, NlgsSettings(sweeps=60_000), guess=np.zeros((count, 2))).force
    found = comparison.sweep_until_steady(problem, steady)
    np.testing.assert_array_equal(found, solve(problem, NlgsSettings(sweeps=500), guess=steady).force)


def test_contacts_overlap_or_are_within_two_pixels_of_a_wall(inputs: Inputs, made: Synthesis) -> None:
    (key, force), *_ = comparison.solve_as_authors(inputs, comparison.AuthorsSettings(TOUCHING, most_sweeps=300))
    walls = inputs.walls.count
    i, j = split_keys(key, RODS + walls)
    between = j < RODS
    position = inputs.tracks.position[0]
    apart = np.linalg.norm(position[j[between]] - position[i[between]], axis=1)
    assert (apart < TOUCHING * (made.truth.radius[i] + made.truth.radius[np.minimum(j, RODS - 1)])[between]).all()
    truly = int((made.truth.j[: made.truth.offset[1]] >= RODS).sum())
    assert (~between).sum() >= truly
    assert (np.abs(force[between, 1]) <= 0.3 * force[between, 0] * (1 + 1e-9) + 1e-12).all()
    assert (np.abs(force[~between, 1]) > 0.31 * force[~between, 0]).any()  # walls are rougher


def test_true_forces_have_the_best_score(inputs: Inputs, made: Synthesis) -> None:
    true = true_fields(made)
    row = comparison.score_recipe("truth", inputs, true, true)
    assert (row.r_fn, row.scale, row.friction_angle, row.direction) == pytest.approx((1.0, 1.0, 0.0, 0.0), abs=1e-6)
    assert row.frames == FRAMES - comparison.FIRST_FRAME
    halved = comparison.score_recipe("half", inputs, [(key, 0.5 * force) for key, force in true], true)
    assert (halved.r_fn, halved.scale) == pytest.approx((1.0, 0.5))
    turned = [(key, force * np.array([1.0, -1.0])) for key, force in true]
    assert comparison.score_recipe("turned", inputs, turned, true).friction_angle > 1.0
    assert comparison.score_recipe("none", inputs, [None] * FRAMES, true).frames == 0


def test_the_authors_recipe_finds_some_of_the_pattern(inputs: Inputs, made: Synthesis) -> None:
    found = list(comparison.solve_as_authors(inputs, comparison.AuthorsSettings(TOUCHING)))
    assert comparison.score_recipe("authors", inputs, found, true_fields(made)).r_fn > 0.3


def test_rows_of_several_experiments_are_averaged_and_printed() -> None:
    row = comparison.RecipeScore("one", 0.9, 0.8, 1.0, 2.0, 3.0, 27)
    (mean,) = comparison.mean_scores([[row], [replace(row, recipe="two", r_fn=0.7)]])
    assert (mean.recipe, mean.r_fn, mean.frames) == ("one / two", pytest.approx(0.8), 54)
    shown = StringIO()
    comparison.print_programs(Console(file=shown, width=120), "title", [mean])
    assert "0.800" in shown.getvalue()
