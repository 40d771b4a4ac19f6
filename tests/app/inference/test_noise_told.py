"""A stated precision that the gaps contradict is measured before anything is calibrated; the first frame says so."""

from __future__ import annotations

from dataclasses import replace

import numba
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.inference.inference import Inputs, correct_sequence, solve_frames
from rodsight.inference.settings import material_of, settings_of
from rodsight.study.worlds.world_score import read_world
from rodsight.synthetic.worlds.making import make_world

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    experiment = load_experiment(make_world(tmp_path_factory.mktemp("world"), "shear", 6, grains=100).folder, ())
    tracks, walls = read_world(experiment)
    assert walls is not None
    return Inputs(tracks, walls, material_of(experiment.config), settings_of(experiment.config).without_sweeps())


@pytest.mark.parametrize(("claimed", "contradicted"), [(1.0, False), (0.3, True)])
def test_a_claim_that_the_gaps_contradict_is_told(inputs, claimed, contradicted):
    told = replace(inputs, tracks=replace(inputs.tracks, sigma=claimed * inputs.tracks.sigma))
    sequence = correct_sequence(told)
    first = next(solve_frames(sequence)).forces
    assert ("times the stated precision" in first.reason) == contradicted
    assert sequence.snapshots[0].sigma == pytest.approx(inputs.tracks.sigma[0, 0], rel=0.25)
