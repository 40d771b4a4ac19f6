"""A stated precision that the gaps contradict is measured before calibration; the first frame reports it."""

from __future__ import annotations

from dataclasses import replace

import numba
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.inference.frame_store import MemoryStore
from rodsight.inference.infer_sequence import infer_sequence
from rodsight.inference.inputs import Inputs
from rodsight.synthetic.scenarios.scenario_folder import make_scenario

from tests.app.inference.scenarios import SequenceKeeper, read_inputs

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    folder = make_scenario(tmp_path_factory.mktemp("scenario"), "shear", 6, grains=100).folder
    return read_inputs(load_experiment(folder, ()))


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "contradicted"), [(1.0, False), (0.3, True)])
def test_a_precision_that_the_gaps_contradict_is_reported(inputs, factor, contradicted):
    stated = replace(inputs, tracks=replace(inputs.tracks, sigma=factor * inputs.tracks.sigma))
    keeper, store = SequenceKeeper(), MemoryStore()
    infer_sequence(stated, keeper, store, complete=False)
    assert ("times the stated precision" in store.frames[0].forces.reason) == contradicted
    assert keeper.sequence.snapshots[0].sigma == pytest.approx(inputs.tracks.sigma[0, 0], rel=0.25)
