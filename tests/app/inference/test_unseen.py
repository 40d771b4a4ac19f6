"""Rods that no photograph shows are added to the tracks."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.inference.correction.unseen import add_unseen
from rodsight.tracks import Tracks, TrackStatus, WallTracks

from tests.golden.forces import NOISE, STORED

GONE = (11, 36, 50)  # none of them a rattler


@pytest.fixture(scope="module")
def poses() -> dict[str, np.ndarray]:
    """A simulated shear of 60 rods in 4 photographs."""
    with np.load(STORED) as stored:
        return {name.removeprefix("poses/"): stored[name] for name in stored.files if name.startswith("poses/")}


def tracked(poses: dict[str, np.ndarray], gone: tuple[int, ...]) -> tuple[Tracks, WallTracks]:
    seen = np.setdiff1d(np.arange(len(poses["radius"])), gone)
    position = poses["position"][:, seen]
    here = np.isfinite(position).all(axis=2)
    f, n = here.shape
    tracks = Tracks(
        100 + seen, poses["radius"][seen], np.arange(float(f)), position, np.zeros((f, n)), np.full((f, n), NOISE),
        np.ones((f, n)), np.where(here, TrackStatus.OK, TrackStatus.LOST).astype(np.uint8),
    )  # fmt: skip
    return tracks, WallTracks(("bottom", "right", "top", "left"), poses["endpoints"], np.full(4, np.nan))


def test_unseen_rods_follow_the_seen_ones_with_names_and_states_of_their_own(poses) -> None:
    tracks, walls = tracked(poses, GONE)
    sizes = np.unique(poses["radius"])
    found = add_unseen(tracks, walls, sizes)
    n, u = tracks.grain_count, len(GONE)
    assert found.grain_count == n + u
    assert found.inferred is not None
    assert found.inferred.tolist() == [False] * n + [True] * u
    assert found.id[n:].tolist() == (tracks.id.max() + 1 + np.arange(u)).tolist()
    np.testing.assert_array_equal(found.position[:, :n], tracks.position)
    assert np.isin(found.radius[n:], sizes).all()
    known = np.isfinite(found.position[:, n:]).all(axis=2)
    np.testing.assert_array_equal(found.status[:, n:] == TrackStatus.INFERRED, known)
    assert (found.present[:, n:] == known).all()
    true = poses["position"][:, list(GONE)]
    away = np.linalg.norm(found.position[:, n:, None] - true[:, None], axis=3).max(axis=0)
    assert (away.min(axis=0) < 0.05 * poses["radius"][list(GONE)]).all()


@pytest.mark.parametrize("row", [0, -1])
def test_only_known_sizes_are_inferred(poses, row: int) -> None:
    tracks, walls = tracked(poses, GONE)
    sizes = np.unique(poses["radius"])[[row]]
    assert np.isin(add_unseen(tracks, walls, sizes).radius[tracks.grain_count :], sizes).all()


def test_a_complete_packing_keeps_its_rods(poses) -> None:
    tracks, walls = tracked(poses, ())
    found = add_unseen(tracks, walls, np.unique(poses["radius"]))
    assert found.grain_count == tracks.grain_count
    assert found.inferred is not None
    assert not found.inferred.any()


def test_without_walls_nothing_is_sought(poses) -> None:
    tracks, walls = tracked(poses, GONE)
    without = WallTracks((), walls.endpoints[:, :0], walls.pressure[:0])
    assert add_unseen(tracks, without, np.unique(poses["radius"])).inferred is None
