"""Grains are soft where their gaps show it, or where their stiffness is specified."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.experiment.walls import read_walls
from rodsight.inference.correction import softness
from rodsight.inference.correction.softness import find_softness
from rodsight.inference.inference_settings import material_of, settings_of
from rodsight.solver.assessment.mixture_trust import MAX_TRUST_MEASURED, MAX_TRUST_STATED
from rodsight.solver.nlgs.chain import force_scale


@pytest.mark.parametrize(("stiffness", "soft"), [(None, False), ("rigid", False), ("estimate", True), (1e6, True)])
def test_hard_rods_are_soft_only_where_their_stiffness_is_specified(made_tracks: Path, stiffness, soft) -> None:
    experiment = load_experiment(made_tracks)
    tracks = read_tracks(experiment)
    walls = read_walls(experiment, tracks.frame_count)
    assert walls is not None
    material = replace(material_of(experiment.config), stiffness=stiffness)
    settings = settings_of(experiment.config).sequence
    found = find_softness(material, settings, tracks, walls, ())
    assert found.soft is soft
    assert found.soft_trust == (MAX_TRUST_STATED if soft else MAX_TRUST_MEASURED)
    if stiffness == 1e6:
        mean_diameter = 2.0 * tracks.radius.mean()
        packing = material.pack(tracks.radius, walls.usual_pressure(material.length))
        overlap = force_scale(packing, settings.chain) / (1e6 * material.length)  # [m] of a contact with that force
        assert found.posterior.compliance == pytest.approx(overlap / mean_diameter)
        assert found.posterior.compliance_sd == pytest.approx(0.2 * overlap / mean_diameter)


def test_overlaps_that_the_gaps_show_are_trusted_more(made_tracks: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(softness, "find_soft_overlap", lambda *_: 3e-5)
    experiment = load_experiment(made_tracks)
    tracks = read_tracks(experiment)
    walls = read_walls(experiment, tracks.frame_count)
    assert walls is not None
    material = replace(material_of(experiment.config), stiffness=None)
    found = find_softness(material, settings_of(experiment.config).sequence, tracks, walls, ())
    assert found.soft
    assert found.measured_overlap == 3e-5
    assert found.soft_trust == MAX_TRUST_MEASURED
