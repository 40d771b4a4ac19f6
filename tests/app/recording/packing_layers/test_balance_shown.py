"""A heap at rest under its weight is in equilibrium, and its recording shows zero unbalance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities
from rodsight.recording.packing_layers.residual_maps import residual_colours
from rodsight.results.results import Results
from rodsight.solver.nlgs.sweep_record import SweepHistory
from rodsight.solver.statistics.balance import grain_unbalance
from rodsight.tracks import Tracks, TrackStatus, WallTracks

from tests.app.recording.fake_results import WALL_NAMES, make_results
from tests.app.recording.rows import latest
from tests.packings import Heap, heap_at_rest

EXACT = 1e-6  # of the mean force: rounding of the forces of sweeps, stored as float32
CONFIGURATION = 'name = "heap"\n[material]\nlength = 0.06\nfriction = 0.3\ngravity = [0.0, -9.81]\n'


def results_of(heap: Heap) -> Results:
    """Return one frame, solved in two sweeps with forces in equilibrium."""
    synthetic, contacts, n = make_results(1), heap.contacts, heap.packing.grains.count
    force = np.stack([heap.fn, heap.ft]).astype(np.float32)
    measured = np.full(2, 1e-13)
    history = SweepHistory(measured, measured, measured, np.arange(2), *(np.stack([each, each]) for each in force))
    unbalance = grain_unbalance(contacts, heap.fn, heap.ft, heap.packing.weight, heap.state.present)
    some, none = np.zeros(contacts.count), np.zeros(contacts.count, np.uint8)
    forces = replace(
        synthetic.frames[0], contacts=contacts, fn=heap.fn, ft=heap.ft, nlgs_fn=heap.fn, nlgs_ft=heap.ft, un=some,
        ut=some, state=none, age=none.astype(np.int32), source=none, probability=some, fn_sd=some, ft_sd=some,
        history=history, grain_unbalance=unbalance,
    )  # fmt: skip
    tracks = Tracks(
        np.arange(n), heap.packing.grains.radius, np.zeros(1), heap.state.position[None], np.zeros((1, n)),
        np.full((1, n), 1e-5), np.full((1, n), 0.97), np.full((1, n), TrackStatus.OK, np.uint8),
    )  # fmt: skip
    walls = WallTracks(WALL_NAMES, heap.walls.endpoints[None], heap.packing.pressure)
    return replace(
        synthetic, tracks=tracks, walls=walls, grains=heap.packing.grains, frames=[forces], configuration=CONFIGURATION
    )


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(results_of(heap_at_rest()), tmp_path_factory.mktemp("heap") / "run.rrd").path


def test_the_unbalance_of_a_grain_of_a_heap_at_rest_is_zero(shown: Path) -> None:
    assert np.abs(latest(shown, entities.GRAINS, entities.FRAME, 0)["unbalance"]).max() < EXACT


def test_the_unbalance_map_of_a_heap_at_rest_is_dark_in_every_sweep_and_in_the_reported_field(shown: Path) -> None:
    dark = residual_colours(np.zeros(1)).tolist()
    for sweep in range(3):
        colours = latest(shown, entities.UNBALANCE_MAP, entities.SWEEP, sweep)["Points2D:colors"]
        assert set(colours) == set(dark)
