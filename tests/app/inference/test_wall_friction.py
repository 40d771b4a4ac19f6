"""The friction of walls is measured where enough slides at them and nobody told it."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.experiment.walls import read_walls
from rodsight.inference.friction_and_radii import measure_friction_of_walls
from rodsight.inference.inference import Inputs, correct_sequence
from rodsight.inference.settings import material_of, settings_of
from rodsight.synthetic.worlds import making
from rodsight.synthetic.worlds.table import WORLDS
from rodsight.tracks import Tracks, WallTracks

from solver.bodies.rods import RodMaterial
from solver.convex.friction_check import FrictionCheck
from solver.detection.touch_probability import ContactProbabilitySettings
from tests.solver.sequence.test_frames import sheared_frames

SETTINGS = ContactProbabilitySettings(overlap=1e-6)


def test_a_friction_of_walls_that_was_told_is_not_measured() -> None:
    packing, snapshots = sheared_frames(8)
    assert measure_friction_of_walls(RodMaterial(wall_friction=0.1), packing, snapshots, SETTINGS) is None


def test_too_few_photographs_or_rods_at_walls_say_nothing_of_them() -> None:
    packing, snapshots = sheared_frames(8)
    assert measure_friction_of_walls(RodMaterial(), packing, snapshots[:4], SETTINGS) is None
    inside = [replace(each, endpoints=each.endpoints[:0]) for each in snapshots]
    bare = replace(packing, pressure=np.empty(0))
    assert measure_friction_of_walls(RodMaterial(), bare, inside, SETTINGS) is None


def test_sequences_solved_again_take_the_friction_of_walls_that_was_found() -> None:
    asked = Inputs(cast(Tracks, None), cast(WallTracks, None), RodMaterial(friction_measured=True))
    check = FrictionCheck(0.25, 0.25, 0.2, 0.3, 1, 8, True, np.ones(1), np.ones(1), 0.14, 0.11, 0.17)
    assert asked.with_friction(0.25, check).material == RodMaterial(friction=0.25, wall_friction=0.14)
    told = replace(asked, material=replace(asked.material, wall_friction=0.1))
    assert told.with_friction(0.25, check).material.wall_friction == 0.1
    unknown = replace(check, wall_measured=float("nan"))
    assert asked.with_friction(0.25, unknown).material.wall_friction is None


@pytest.mark.slow
def test_smooth_circles_are_found_smooth(tmp_path, monkeypatch) -> None:
    world = WORLDS["circle"]
    course = replace(world.course, settings=replace(world.course.settings, wall_friction=0.12), frames=10)
    monkeypatch.setitem(WORLDS, "circle", replace(world, course=course))
    folder = making.make_world(tmp_path / "circle", "circle", 1, grains=200).folder
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
