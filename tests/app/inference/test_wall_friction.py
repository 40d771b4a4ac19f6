"""The friction at walls is measured where enough slides there and none is given."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.experiment.walls import read_walls
from rodsight.inference.correction.correct_sequence import correct_sequence
from rodsight.inference.correction.friction import measure_friction_of_walls
from rodsight.inference.inference_settings import material_of, settings_of
from rodsight.inference.inputs import Inputs
from rodsight.solver.bodies.rods import RodMaterial
from rodsight.solver.convex.friction_check import FrictionCheck
from rodsight.solver.detection.touch_probability import ContactProbabilitySettings
from rodsight.synthetic.scenarios import scenario_folder
from rodsight.synthetic.scenarios.scenario_table import SCENARIOS
from rodsight.tracks import Tracks, WallTracks

from tests.app.inference.scenarios import agreement, solve
from tests.solver.sequence.test_frames import sheared_frames

SETTINGS = ContactProbabilitySettings(overlap=1e-6)


def test_a_given_friction_at_walls_is_not_measured() -> None:
    packing, snapshots = sheared_frames(8)
    assert measure_friction_of_walls(RodMaterial(wall_friction=0.1), packing, snapshots, SETTINGS) is None


def test_too_few_photographs_or_rods_at_walls_give_no_estimate() -> None:
    packing, snapshots = sheared_frames(8)
    assert measure_friction_of_walls(RodMaterial(), packing, snapshots[:4], SETTINGS) is None
    inside = [replace(each, endpoints=each.endpoints[:0]) for each in snapshots]
    bare = replace(packing, pressure=np.empty(0))
    assert measure_friction_of_walls(RodMaterial(), bare, inside, SETTINGS) is None


def test_sequences_solved_again_use_the_measured_friction_at_walls() -> None:
    measured = Inputs(cast(Tracks, None), cast(WallTracks, None), RodMaterial(friction_measured=True))
    check = FrictionCheck(0.25, 0.25, 0.2, 0.3, 1, 8, True, np.ones(1), np.ones(1), 0.14, 0.11, 0.17)
    assert measured.with_friction(0.25, check).material == RodMaterial(friction=0.25, wall_friction=0.14)
    given = replace(measured, material=replace(measured.material, wall_friction=0.1))
    assert given.with_friction(0.25, check).material.wall_friction == 0.14  # the sliding contradicted the given one
    stated = replace(measured, material=RodMaterial(wall_friction=0.25))
    assert stated.with_friction(0.25, check).material == RodMaterial(wall_friction=0.14)
    unknown = replace(check, wall_measured=float("nan"))
    assert measured.with_friction(0.25, unknown).material.wall_friction is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "words", "least"),
    [
        ("smooth_walls", "rods slide on walls as with a friction of 0.01, not 0.25", 0.94),
        ("base_friction", "the base drags the rods as with a friction of 1", 0.96),
        ("sheared", "", 0.97),
    ],
)
def test_a_friction_of_walls_or_base_that_is_not_stated_is_used_where_the_sliding_shows_it(
    tmp_path, scenario, words, least
) -> None:
    solved = solve(tmp_path / scenario, scenario, 50, grains=200, frames=12)
    material = solved.sequence.packing.material
    assert material.friction == 0.25
    assert (material.wall_friction != 0.25, material.base_drag > 0.0) == (
        scenario == "smooth_walls",
        scenario == "base_friction",
    )
    assert (words in solved.sequence.remark) if words else "calibration.resistance" not in solved.sequence.remark
    r = [agreement(frame, true) for frame, true in zip(solved.frames[3:], solved.true[3:], strict=True)]
    assert np.mean(r) > least
    as_stated = replace(solved.inputs, settings=replace(solved.inputs.settings, resistance=False))
    assert correct_sequence(as_stated).packing.material == solved.inputs.material.friction_law()


@pytest.mark.slow
def test_a_low_friction_of_circular_walls_is_measured(tmp_path, monkeypatch) -> None:
    scenario = SCENARIOS["circle"]
    settings = replace(scenario.loading.settings, wall_friction=0.12)
    loading = replace(scenario.loading, settings=settings, frames=10)
    monkeypatch.setitem(SCENARIOS, "circle", replace(scenario, loading=loading))
    folder = scenario_folder.make_scenario(tmp_path / "circle", "circle", 1, grains=200).folder
    text = (folder / "experiment.toml").read_text()
    (folder / "experiment.toml").write_text(
        text.replace("wall_friction = 0.12\n", "").replace("friction = 0.25\n", 'friction = "measured"\n')
    )
    experiment = load_experiment(folder)
    tracks = read_tracks(experiment)
    walls = read_walls(experiment, tracks.frame_count)
    assert walls is not None
    config = experiment.config
    found = correct_sequence(Inputs(tracks, walls, material_of(config), settings_of(config).without_sweeps()))
    assert found.wall_friction is not None
    assert found.wall_friction.low <= 0.12 <= found.wall_friction.high
    assert found.packing.material.wall_friction == found.wall_friction.measured
    assert found.packing.material.friction > 1.4 * found.wall_friction.measured
