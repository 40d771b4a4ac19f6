"""Individual errors of radii are estimated before calibration; exact radii are only calibrated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.correction import radii
from rodsight.inference.correction.calibration import calibrate_tracks
from rodsight.inference.correction.radii import calibrate_with_radii, use_size_classes
from rodsight.solver.bodies.motion import Snapshot
from rodsight.solver.bodies.packing import Packing
from rodsight.solver.bodies.rods import RodMaterial
from rodsight.solver.boundary import size_classes
from rodsight.solver.part_settings import CalibrationSettings
from rodsight.solver.posterior.radius_posterior import RadiusPosterior
from rodsight.tracks import Tracks, TrackStatus, WallTracks

from tests.solver.posterior.test_sequence_evidence import lattice_sequence

SETTINGS = CalibrationSettings()
REMAINING = 5e-6  # [m] standard deviation of the estimated radii


def lattice() -> tuple[Tracks, WallTracks]:
    """Tracks of equal rods in a lattice."""
    packing, snapshots = lattice_sequence(1e-5)
    n, f = packing.grains.count, len(snapshots)
    tracks = Tracks(
        np.arange(n), packing.grains.radius, np.arange(float(f)), np.stack([each.position for each in snapshots]),
        np.zeros((f, n)), np.full((f, n), 1e-5), np.full((f, n), np.nan), np.full((f, n), TrackStatus.GIVEN, np.uint8),
    )  # fmt: skip
    ends = np.stack([each.endpoints for each in snapshots])
    return tracks, WallTracks(("bottom", "right", "top", "left"), ends, packing.pressure)


@pytest.mark.thorough
def test_exact_radii_are_only_calibrated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(radii, "estimate_radii", None)
    tracks, walls = lattice()
    expected, expected_walls, _ = calibrate_tracks(SETTINGS, tracks, walls, 0.0)
    found, found_walls, calibration = calibrate_with_radii(RodMaterial(), SETTINGS, tracks, walls, 0.0)
    np.testing.assert_array_equal(found.position, expected.position)
    np.testing.assert_array_equal(found.radius, expected.radius)
    np.testing.assert_array_equal(found_walls.endpoints, expected_walls.endpoints)
    assert calibration is not None
    assert not calibration.applied


@pytest.mark.thorough
def test_estimated_radii_enter_the_tracks_and_the_calibration(monkeypatch: pytest.MonkeyPatch) -> None:
    exact, walls = lattice()
    error = np.random.default_rng(1).normal(0.0, 1e-4, exact.grain_count)
    remaining = np.random.default_rng(2).normal(0.0, 0.2 * REMAINING, exact.grain_count)
    n = exact.grain_count
    posterior = RadiusPosterior(remaining - error, np.full(n, REMAINING), float(error.std()))
    monkeypatch.setattr(radii, "estimate_radii", lambda *_: posterior)
    monkeypatch.setattr(radii, "has_radius_errors", lambda *_: True)
    stated = replace(exact, radius=exact.radius + error)
    found, _, calibration = calibrate_with_radii(RodMaterial(), SETTINGS, stated, walls, 0.0)
    assert calibration is not None
    assert calibration.applied
    assert "given radii are wrong by" in calibration.verdict
    np.testing.assert_allclose(found.radius, exact.radius, atol=REMAINING)
    np.testing.assert_allclose(stated.radius + calibration.radius, found.radius, atol=1e-12)
    np.testing.assert_allclose(found.position, exact.position, atol=2.0 * REMAINING)
    np.testing.assert_allclose(calibration.radius_sd, REMAINING)
    assert calibration.before.spread > 5.0 * calibration.after.spread
    assert found.centre_sigma is not None
    assert found.centre_sigma.min() >= 0.9 * REMAINING


def test_radii_are_estimated_without_the_errors_that_all_grains_share(monkeypatch: pytest.MonkeyPatch) -> None:
    tracks, walls = lattice()
    n, seen = tracks.grain_count, []
    _, _, exact = calibrate_tracks(SETTINGS, tracks, walls, 0.0)
    assert exact is not None
    own = np.random.default_rng(3).normal(0.0, 1e-4, n)
    shared = replace(exact, radius_offset=3e-5, radius=3e-5 + own, offset=np.full((n, 2), 1e-4), wall=np.full(4, 2e-5))

    def estimate(packing: Packing, snapshots: list[Snapshot], _: np.random.Generator) -> RadiusPosterior:
        seen.append((packing.grains.radius, snapshots[0].position, snapshots[0].endpoints))
        return RadiusPosterior(np.zeros(n), np.full(n, REMAINING), REMAINING)

    monkeypatch.setattr(radii, "calibrate_tracks", lambda *_: (tracks, walls, shared))
    monkeypatch.setattr(radii, "has_radius_errors", lambda *_: True)
    monkeypatch.setattr(radii, "estimate_radii", estimate)
    calibrate_with_radii(RodMaterial(), SETTINGS, tracks, walls, 0.0)
    [(radius, position, endpoints)] = seen
    np.testing.assert_allclose(radius, tracks.radius + 3e-5)
    np.testing.assert_allclose(position, tracks.position[0])
    assert endpoints[:, :, 1].min() == pytest.approx(walls.endpoints[0, :, :, 1].min() - 2e-5)  # the bottom


def as_read(tracks: Tracks, error: float = 0.0) -> Tracks:
    """Tracks of grains whose radii were read with errors of .5 %, and a common relative one."""
    sign = np.tile([-1.0, 1.0], tracks.grain_count)[: tracks.grain_count]
    return replace(tracks, radius=tracks.radius * (1.0 + error + 5e-3 * sign))


def test_touching_surfaces_meet_with_the_sizes_of_hard_grains(monkeypatch: pytest.MonkeyPatch) -> None:
    tracks, _ = lattice()
    monkeypatch.setattr(size_classes, "FEWEST_PAIRS", 10)
    found, remark = use_size_classes(as_read(tracks, 0.01), soft=False)
    assert found.radius == pytest.approx(tracks.radius, rel=1e-3)
    assert "1 size" in remark
    assert use_size_classes(tracks, soft=False) == (tracks, "")


def test_readings_of_hard_grains_stay_where_gaps_leave_their_errors_open(monkeypatch: pytest.MonkeyPatch) -> None:
    tracks, _ = lattice()
    read = as_read(tracks)
    found = size_classes.SizeClasses(
        np.zeros(tracks.grain_count, int), np.ones(1), 1.0, radii.UNCERTAIN + 0.01, tracks.radius, np.zeros(1)
    )
    monkeypatch.setattr(radii, "find_size_classes", lambda *_: found)
    assert use_size_classes(read, soft=False) == (read, "")
    monkeypatch.setattr(radii, "find_size_classes", lambda *_: replace(found, error_fraction_sd=radii.UNCERTAIN))
    np.testing.assert_array_equal(use_size_classes(read, soft=False)[0].radius, tracks.radius)


def test_the_mean_overlap_of_soft_grains_stays_that_of_the_readings(monkeypatch: pytest.MonkeyPatch) -> None:
    tracks, _ = lattice()
    read = as_read(tracks, 0.01)
    monkeypatch.setattr(size_classes, "FEWEST_PAIRS", 10)
    found, remark = use_size_classes(read, soft=True)
    assert found.radius == pytest.approx(np.full(tracks.grain_count, read.radius.mean()), rel=1e-3)
    assert "1 size" in remark
    assert use_size_classes(tracks, soft=True) == (tracks, "")
