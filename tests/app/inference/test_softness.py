"""Grains are soft where their gaps show it, or where whoever knows them says so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.experiment.walls import read_walls
from rodsight.inference.settings import material_of, settings_of
from rodsight.inference.softness import find_softness

from solver.mixture.softness import SEEN_AT_MOST, TOLD_AT_MOST


@pytest.mark.parametrize(("stiffness", "soft"), [(None, False), ("rigid", False), ("estimate", True), (1e6, True)])
def test_hard_rods_are_taken_for_soft_only_where_it_is_told(made_tracks: Path, stiffness, soft) -> None:
    experiment = load_experiment(made_tracks)
    tracks = read_tracks(experiment)
    walls = read_walls(experiment, tracks.frame_count)
    assert walls is not None
    material = replace(material_of(experiment.config), stiffness=stiffness)
    settings = settings_of(experiment.config).sequence
    found = find_softness(material, settings, tracks, walls, ())
    assert found.soft is soft
    assert found.soft_trust == (TOLD_AT_MOST if soft else SEEN_AT_MOST)
