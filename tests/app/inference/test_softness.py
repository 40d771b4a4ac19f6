"""Grains are soft where their gaps show it, or where their stiffness is specified."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.experiment.walls import read_walls
from rodsight.inference.correction import softness
from rodsight.inference.correction.softness import assume_softness, find_softness
from rodsight.inference.inference_settings import material_of, settings_of
from rodsight.solver.bodies.rods import RodMaterial
from rodsight.solver.nlgs.chain import force_scale
from rodsight.solver.part_settings import MAX_TRUST_MEASURED, MAX_TRUST_STATED
from rodsight.tracks import Tracks, TrackStatus, WallTracks

from tests.solver.posterior.test_sequence_evidence import RADIUS, lattice_sequence


@pytest.mark.parametrize(("stiffness", "soft"), [(None, False), ("rigid", False), ("estimate", True), (1e6, True)])
def test_hard_rods_are_soft_only_where_their_stiffness_is_specified(made_tracks: Path, stiffness, soft) -> None:
    experiment = load_experiment(made_tracks)
    tracks = read_tracks(experiment)
    walls = read_walls(experiment, tracks.frame_count)
    assert walls is not None
    material = replace(material_of(experiment.config), stiffness=stiffness)
    settings = settings_of(experiment.config).sequence
    found, _ = find_softness(material, settings, tracks, walls, ())
    assert found.soft is soft
    assert found.soft_trust == (MAX_TRUST_STATED if soft else MAX_TRUST_MEASURED)
    if stiffness == 1e6:
        mean_diameter = 2.0 * tracks.radius.mean()
        packing = material.pack(tracks.radius, walls.usual_pressure(material.length))
        overlap = force_scale(packing, settings.chain) / (1e6 * material.length)  # [m] of a contact with that force
        assert found.posterior.compliance == pytest.approx(overlap / mean_diameter)
        assert found.posterior.compliance_sd == pytest.approx(0.2 * overlap / mean_diameter)


def test_overlaps_that_the_gaps_show_are_trusted_more(made_tracks: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(softness, "judge_gaps", lambda *_: (3e-5, False))
    experiment = load_experiment(made_tracks)
    tracks = read_tracks(experiment)
    walls = read_walls(experiment, tracks.frame_count)
    assert walls is not None
    material = replace(material_of(experiment.config), stiffness=None)
    found, _ = find_softness(material, settings_of(experiment.config).sequence, tracks, walls, ())
    assert found.soft
    assert found.measured_overlap == 3e-5
    assert found.soft_trust == MAX_TRUST_MEASURED


@pytest.mark.parametrize(("sizes", "hidden"), [({}, True), ({0.008: 0.02}, False)])
def test_errors_may_hide_overlaps_unless_wrong_sizes_explain_the_gaps(
    made_tracks: Path, monkeypatch: pytest.MonkeyPatch, sizes: dict[float, float], hidden: bool
) -> None:
    monkeypatch.setattr(softness, "judge_gaps", lambda *_: (0.0, True))
    monkeypatch.setattr(softness, "find_wrong_sizes", lambda *_: sizes)
    experiment = load_experiment(made_tracks)
    tracks = read_tracks(experiment)
    walls = read_walls(experiment, tracks.frame_count)
    assert walls is not None
    settings = settings_of(experiment.config).sequence
    unknown = replace(material_of(experiment.config), stiffness=None)
    assert find_softness(unknown, settings, tracks, walls, ()) == (settings, hidden)
    assert find_softness(replace(unknown, stiffness="rigid"), settings, tracks, walls, ()) == (settings, False)


def lattice_tracks(noise: float) -> tuple[Tracks, WallTracks]:
    """Tracks of equal rods in a lattice with noise [m], and no walls."""
    packing, snapshots = lattice_sequence(noise)
    f, n = len(snapshots), packing.grains.count
    tracks = Tracks(
        np.arange(n), packing.grains.radius, np.arange(float(f)), np.stack([each.position for each in snapshots]),
        np.zeros((f, n)), np.full((f, n), noise), np.full((f, n), np.nan), np.full((f, n), TrackStatus.GIVEN, np.uint8),
    )  # fmt: skip
    return tracks, WallTracks((), np.zeros((f, 0, 2, 2)), np.zeros(0))


def test_overlaps_are_evidence_without_walls_where_noise_hides_the_motion() -> None:
    quiet, walls = lattice_tracks(0.002 * 2.0 * RADIUS)
    assert assume_softness(RodMaterial(), quiet, walls, ()) == (RodMaterial(), "")
    noisy, walls = lattice_tracks(0.008 * 2.0 * RADIUS)
    assumed, remark = assume_softness(RodMaterial(), noisy, walls, ())
    assert assumed.stiffness == "estimate"
    assert 0.6 < float(remark.split()[3]) < 1.0  # % of a diameter
    assert "rigid" in remark
    for given in ("rigid", 1e6):
        assert assume_softness(RodMaterial(stiffness=given), noisy, walls, ()) == (RodMaterial(stiffness=given), "")
    between = WallTracks(("bottom",), np.zeros((noisy.frame_count, 1, 2, 2)), np.full(1, np.nan))
    assert assume_softness(RodMaterial(), noisy, between, ()) == (RodMaterial(), "")
