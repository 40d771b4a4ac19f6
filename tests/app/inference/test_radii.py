"""Radii that scatter are found before the rest is calibrated, exact ones are not looked at."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference import radii
from rodsight.inference.calibration import calibrate_tracks
from rodsight.inference.radii import calibrate_with_radii
from rodsight.tracks import Tracks, TrackStatus, WallTracks

from solver.bodies.rods import RodMaterial
from solver.calibration.settings import CalibrationSettings
from solver.posterior.radii import RadiusPosterior
from tests.solver.posterior.test_sequence_evidence import lattice_sequence

SETTINGS = CalibrationSettings()
LEFT = 5e-6  # [m] of the radii that were found


def lattice() -> tuple[Tracks, WallTracks]:
    """Equal rods packed close, as tracked."""
    packing, snapshots = lattice_sequence(1e-5)
    n, f = packing.grains.count, len(snapshots)
    tracks = Tracks(
        np.arange(n), packing.grains.radius, np.arange(float(f)), np.stack([each.position for each in snapshots]),
        np.zeros((f, n)), np.full((f, n), 1e-5), np.full((f, n), np.nan), np.full((f, n), TrackStatus.GIVEN, np.uint8),
    )  # fmt: skip
    ends = np.stack([each.endpoints for each in snapshots])
    return tracks, WallTracks(("bottom", "right", "top", "left"), ends, packing.pressure)


def test_exact_radii_are_only_calibrated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(radii, "estimate_radii", None)
    tracks, walls = lattice()
    usual, usual_walls, _ = calibrate_tracks(SETTINGS, tracks, walls, 0.0)
    found, found_walls, calibration = calibrate_with_radii(RodMaterial(), SETTINGS, tracks, walls, 0.0)
    np.testing.assert_array_equal(found.position, usual.position)
    np.testing.assert_array_equal(found.radius, usual.radius)
    np.testing.assert_array_equal(found_walls.endpoints, usual_walls.endpoints)
    assert calibration is not None
    assert not calibration.applied


def test_what_was_found_of_radii_is_in_the_tracks_and_in_the_calibration(monkeypatch: pytest.MonkeyPatch) -> None:
    exact, walls = lattice()
    error = np.random.default_rng(1).normal(0.0, 1e-4, exact.grain_count)
    left = np.random.default_rng(2).normal(0.0, 0.2 * LEFT, exact.grain_count)
    n = exact.grain_count
    monkeypatch.setattr(
        radii, "estimate_radii", lambda *_: RadiusPosterior(left - error, np.full(n, LEFT), float(error.std()), False)
    )
    monkeypatch.setattr(radii, "radii_scatter", lambda *_: True)
    told = replace(exact, radius=exact.radius + error)
    found, _, calibration = calibrate_with_radii(RodMaterial(), SETTINGS, told, walls, 0.0)
    assert calibration is not None
    assert calibration.applied
    assert "radii told are wrong by" in calibration.verdict
    np.testing.assert_allclose(found.radius, exact.radius, atol=LEFT)
    np.testing.assert_allclose(told.radius + calibration.radius, found.radius, atol=1e-12)
    np.testing.assert_allclose(found.position, exact.position, atol=2.0 * LEFT)
    np.testing.assert_allclose(calibration.radius_sd, LEFT)
    assert calibration.before.spread > 5.0 * calibration.after.spread
    assert found.centre_sigma is not None
    assert found.centre_sigma.min() >= 0.9 * LEFT
