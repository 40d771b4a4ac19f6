"""A distorted picture of a packing with walls: removed from rods, and from walls that were measured in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.correction import boundary
from rodsight.inference.correction.boundary import correct_camera
from rodsight.inference.correction.correct_sequence import correct_sequence
from rodsight.inference.diagnosis.distortion import undistorted
from rodsight.inference.inference_settings import InferenceSettings
from rodsight.inference.inputs import Inputs
from rodsight.solver.bodies.rods import RodMaterial
from rodsight.solver.bodies.wall_shapes import circle_parameters, outward_normals
from rodsight.tracks import Tracks, TrackStatus, WallTracks

from tests.golden.forces import NOISE, STORED

MATERIAL = RodMaterial(density=2700.0, length=0.06, friction=0.25)
NEAR = 1e-4  # [m] of true distances of up to 0.13 m, by the gaps of 60 rods


@pytest.fixture(scope="module")
def given() -> tuple[Tracks, WallTracks]:
    """A simulated shear of 60 rods in 4 photographs, undistorted."""
    with np.load(STORED) as stored:
        poses = {name.removeprefix("poses/"): stored[name] for name in stored.files if name.startswith("poses/")}
    position = poses["position"]
    f, n = position.shape[:2]
    tracks = Tracks(
        np.arange(n), poses["radius"], np.arange(float(f)), position, np.zeros((f, n)), np.full((f, n), NOISE),
        np.ones((f, n)), np.full((f, n), TrackStatus.OK, np.uint8),
    )  # fmt: skip
    return tracks, WallTracks(("bottom", "right", "top", "left"), poses["endpoints"], np.full(4, np.nan))


def stretched(points: np.ndarray) -> np.ndarray:
    return points * np.array([1.01, 1.0])


def through_lens(points: np.ndarray, middle: np.ndarray, width: float) -> np.ndarray:
    offset = (points - middle) / width
    return points - 0.008 * width * np.sum(offset**2, axis=-1, keepdims=True) * offset


def distances(tracks: Tracks, walls: WallTracks) -> np.ndarray:
    """Distances of the rods of the first photograph from one another and from the walls."""
    place, (a, b) = tracks.position[0], np.moveaxis(walls.endpoints[0], 1, 0)
    along = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
    arm = place[:, None] - a
    across = along[:, 0] * arm[..., 1] - along[:, 1] * arm[..., 0]
    return np.concatenate([np.linalg.norm(place[:, None] - place, axis=-1).ravel(), across.ravel()])


def test_a_stretched_picture_is_restored_with_its_walls(given) -> None:
    tracks, walls = given
    seen = replace(tracks, position=stretched(tracks.position)), replace(walls, endpoints=stretched(walls.endpoints))
    corrected, moved, sentence, found = correct_camera(MATERIAL, *seen, (), radii_known=True)
    assert found is not None
    assert np.abs(distances(*seen) - distances(*given)).max() > 10 * NEAR
    assert np.abs(distances(corrected, moved) - distances(*given)).max() < NEAR
    assert "a stretching of 0.5" in sentence
    assert "distances were multiplied by 0.995" in sentence


def test_overlaps_of_soft_grains_are_no_error_of_the_scale(given, monkeypatch) -> None:
    tracks, walls = given
    seen = replace(tracks, position=stretched(tracks.position)), replace(walls, endpoints=stretched(walls.endpoints))
    monkeypatch.setattr(boundary, "find_soft_overlap", lambda *_: 1e-5)
    corrected, moved, sentence, found = correct_camera(MATERIAL, *seen, (), radii_known=True)
    assert found is not None
    ratio = distances(corrected, moved) / np.maximum(distances(*given), 1e-3)
    assert np.median(ratio[ratio > 0.5]) == pytest.approx(1.005, abs=1e-3)
    assert "multiplied" not in sentence


@pytest.mark.parametrize("stiffness", [None, "estimate", 1e7])
def test_overlaps_that_are_larger_along_the_greatest_stress_are_no_stretching(given, monkeypatch, stiffness) -> None:
    tracks, walls = given
    seen = replace(tracks, position=stretched(tracks.position)), replace(walls, endpoints=stretched(walls.endpoints))
    monkeypatch.setattr(boundary, "find_soft_overlap", lambda *_: 4e-4)
    corrected, moved, sentence, found = correct_camera(
        replace(MATERIAL, stiffness=stiffness), *seen, (), radii_known=True
    )
    assert corrected is seen[0]
    assert moved is seen[1]
    assert (sentence, found) == ("", None)


def test_overlaps_that_grow_with_depth_are_no_lens(given, monkeypatch) -> None:
    tracks, walls = given
    middle, width = tracks.position[0].mean(axis=0), 0.5 * float(np.ptp(tracks.position[0], axis=0).max())
    seen = replace(tracks, position=through_lens(tracks.position, middle, width))
    for overlap, removed in ((4e-4, False), (1e-5, True)):
        monkeypatch.setattr(boundary, "find_soft_overlap", lambda *_, overlap=overlap: overlap)
        _, _, sentence, found = correct_camera(MATERIAL, seen, walls, (), radii_known=True)
        assert (found is not None, "lens" in sentence or "radial" in sentence) == (removed, removed)


def test_radii_that_were_read_in_the_picture_are_adapted_instead_of_distances(given) -> None:
    tracks, walls = given
    seen = replace(tracks, position=stretched(tracks.position)), replace(walls, endpoints=stretched(walls.endpoints))
    corrected, moved, sentence, _ = correct_camera(MATERIAL, *seen, (), radii_known=False)
    np.testing.assert_allclose(corrected.radius / tracks.radius, 1.005, atol=1e-3)
    assert "radii were divided by" in sentence
    ratio = distances(corrected, moved) / np.maximum(distances(*given), 1e-3)
    assert np.median(ratio[ratio > 0.5]) == pytest.approx(1.005, abs=1e-3)


def test_walls_that_were_not_in_the_picture_stay(given) -> None:
    tracks, walls = given
    middle, width = tracks.position[0].mean(axis=0), 0.5 * float(np.ptp(tracks.position[0], axis=0).max())
    seen = replace(tracks, position=through_lens(tracks.position, middle, width))
    corrected, moved, sentence, _ = correct_camera(MATERIAL, seen, walls, (), radii_known=True)
    assert moved.endpoints is walls.endpoints
    assert "walls were not in this picture" in sentence
    before, after = (np.abs(distances(each, walls) - distances(*given)) for each in (seen, corrected))
    assert np.median(after) < 0.2 * np.median(before)


def test_walls_seen_through_the_lens_are_corrected(given) -> None:
    tracks, walls = given
    middle, width = tracks.position[0].mean(axis=0), 0.5 * float(np.ptp(tracks.position[0], axis=0).max())
    seen = (
        replace(tracks, position=through_lens(tracks.position, middle, width)),
        replace(walls, endpoints=through_lens(walls.endpoints, middle, width)),
    )
    corrected, moved, sentence, _ = correct_camera(MATERIAL, *seen, (), radii_known=True)
    assert "a radial distortion" in sentence
    before, after = (np.abs(distances(*each) - distances(*given)) for each in (seen, (corrected, moved)))
    assert np.median(after) < 0.2 * np.median(before)


def test_walls_in_a_distorted_picture_are_moved_to_the_rods_that_touch_them(given) -> None:
    tracks, walls = given
    off = walls.endpoints - 2 * NEAR * outward_normals(walls.endpoints)[:, :, None]  # a bar's line is read too far in
    seen = replace(tracks, position=stretched(tracks.position)), replace(walls, endpoints=stretched(off))
    corrected, moved, _, _ = correct_camera(MATERIAL, *seen, (), radii_known=True)
    assert np.abs(distances(corrected, moved) - distances(*given)).max() < NEAR


def test_a_circle_keeps_its_shape(given) -> None:
    tracks, walls = given
    round_wall = replace(walls, side=np.array([0, 0, 0, 1], np.int8))
    seen = (
        replace(tracks, position=stretched(tracks.position)),
        replace(round_wall, endpoints=stretched(round_wall.endpoints)),
    )
    _, moved, _, _ = correct_camera(MATERIAL, *seen, (), radii_known=True)
    before, after = (circle_parameters(each.endpoints[:, 3])[1] for each in (seen[1], moved))
    np.testing.assert_allclose(after / before, 0.995, atol=5e-4)


def test_an_undistorted_packing_stays_bit_by_bit(given) -> None:
    tracks, walls = given
    corrected, moved, sentence, found = correct_camera(MATERIAL, tracks, walls, (), radii_known=True)
    assert corrected is tracks
    assert moved is walls
    assert (sentence, found) == ("", None)


def test_the_cause_is_named_and_other_tests_see_the_restored_picture(given) -> None:
    tracks, walls = given
    seen = replace(tracks, position=stretched(tracks.position)), replace(walls, endpoints=stretched(walls.endpoints))
    inputs = Inputs(*seen, MATERIAL, InferenceSettings())
    restored, moved, (named,) = undistorted(inputs, seen[1], ())
    assert named.cause == "stretched_picture"
    assert np.abs(distances(restored, moved) - distances(*given)).max() < NEAR
    assert undistorted(Inputs(tracks, walls, MATERIAL, InferenceSettings()), walls, ())[2] == []


def test_exchanged_sizes_are_named_and_corrected_before_the_camera(given) -> None:
    tracks, walls = given
    wrong = tracks.radius.copy()
    wrong[[31, 44]] = np.unique(wrong)[-1]
    seen = replace(tracks, radius=wrong)
    restored, _, (named,) = undistorted(Inputs(seen, walls, MATERIAL, InferenceSettings()), walls, ())
    assert named.cause == "exchanged_sizes"
    assert named.evidence.startswith("2 rods touch the others only with another of the stated sizes")
    assert named.evidence.endswith("31, 44")
    assert np.array_equal(restored.radius, tracks.radius)
    corrected = correct_sequence(Inputs(seen, walls, MATERIAL, InferenceSettings()))
    assert named.evidence in corrected.remark
    assert np.abs(corrected.tracks.radius - tracks.radius).max() < NEAR
    as_given = replace(InferenceSettings(), calibration=None)
    assert undistorted(Inputs(seen, walls, MATERIAL, as_given), walls, ())[0].radius is wrong
