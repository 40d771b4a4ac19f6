"""Errors of the input that show without forces: the order of the photographs, walls at rest, a missing load."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.correction.radii import find_oversized_rods, find_wrong_sizes
from rodsight.inference.correction.tables.outliers import find_outliers, find_repeated, without_poses
from rodsight.inference.diagnosis.direct_tests import (
    examine_inertia,
    examine_load,
    examine_order,
    examine_poses,
    examine_sizes,
    examine_wall_places,
    find_impossible_poses,
)
from rodsight.solver.bodies.rods import RodMaterial
from rodsight.tracks import Tracks, TrackStatus, WallTracks

FRAMES, SIDE, PITCH, NOISE = 8, 10, 0.016, 1e-5
N, RADIUS = SIDE * SIDE, 0.008
STEP = 6e-3  # of shear between two photographs


def rolling_tracks(step=STEP, noise=None):
    """Layers of rods that slide past one another in alternating directions, each rolling on its neighbours."""
    x, y = (each.ravel() * PITCH + RADIUS for each in np.meshgrid(np.arange(SIDE), np.arange(SIDE)))
    rng = np.random.default_rng(2)
    layer = np.cumsum(rng.normal(0.0, 1.0, SIDE))[(y // PITCH).astype(int)]
    time = np.arange(FRAMES)[:, None]
    position = np.stack([x + step * PITCH * layer * time, np.broadcast_to(y, (FRAMES, N))], axis=-1)
    position = position + (NOISE if noise is None else noise) * rng.standard_normal(position.shape)
    flat = np.full((FRAMES, N), NOISE)
    return Tracks(
        np.arange(N), np.full(N, RADIUS), 30.0 * np.arange(FRAMES), position, np.zeros((FRAMES, N)), flat,
        np.full((FRAMES, N), np.nan), np.full((FRAMES, N), TrackStatus.GIVEN, np.uint8),
    )  # fmt: skip


def box(frames=FRAMES):
    """Bottom and top of a box around the rods."""
    width = height = SIDE * PITCH
    ends = np.array([[[0.0, 0.0], [width, 0.0]], [[width, height], [0.0, height]]])
    return WallTracks(("bottom", "top"), np.repeat(ends[None], frames, axis=0), np.array([np.nan, 5e4]))


def test_photographs_in_order_give_no_finding():
    assert examine_order(rolling_tracks()) == []


def test_swapped_and_repeated_photographs_are_named():
    tracks = rolling_tracks()
    order = np.arange(FRAMES)
    order[[3, 4]] = order[[4, 3]]
    (swapped,) = examine_order(replace(tracks, position=tracks.position[order]))
    assert swapped.cause == "photographs_swapped"
    assert "3 and 4" in swapped.evidence
    again = tracks.position[[0, 1, 2, 3, 3, 4, 5, 6]]
    again[4] += 1.3 * NOISE * np.random.default_rng(3).standard_normal(again[4].shape)
    (repeated,) = examine_order(replace(tracks, position=again))
    assert repeated.cause == "photograph_repeated"
    assert "photograph 4" in repeated.evidence


def test_a_photograph_is_repeated_although_the_others_differ_by_a_common_motion_only():
    tracks = rolling_tracks(step=0.0)
    time = np.array([0, 1, 2, 3, 3, 4, 5, 6])[:, None, None]
    (repeated,) = examine_order(replace(tracks, position=tracks.position + time * [2e-3, 0.0]))
    assert repeated.cause == "photograph_repeated"
    assert "photograph 4" in repeated.evidence


def test_rests_and_uneven_steps_are_no_repetition_and_copies_are():
    tracks, rng = rolling_tracks(), np.random.default_rng(3)

    def shown(order, noise):
        position = tracks.position[order]
        return replace(tracks, position=position + noise * rng.standard_normal(position.shape))

    assert examine_order(shown([0, 1, 2, 2, 2, 3, 4, 5], NOISE)) == []  # a rest of three photographs
    assert examine_order(shown([0, 1, 2, 5, 5, 6, 7, 7], NOISE)) == []  # two of them, and a large step
    assert examine_order(shown([0, 1, 1, 2, 3, 4, 5, 7], NOISE)) == []
    (repeated,) = examine_order(shown([0, 1, 1, 2, 2, 3, 4, 5], 0.02 * NOISE))
    assert repeated.cause == "photograph_repeated"
    assert repeated.evidence.endswith("photograph 2, 4")


def test_a_few_outliers_of_a_packing_at_rest_are_no_other_order():
    tracks, rng = rolling_tracks(), np.random.default_rng(4)
    position = tracks.position[:1] + NOISE * rng.standard_normal(tracks.position.shape)
    position[[1, 3, 5], [8, 3, 7]] += 100.0 * NOISE
    assert examine_order(replace(tracks, position=position)) == []


def test_a_fraction_of_outliers_in_every_photograph_is_no_other_order():
    tracks, rng = rolling_tracks(), np.random.default_rng(0)
    position = tracks.position[:1] + NOISE * rng.standard_normal(tracks.position.shape)
    for photograph in position[1:]:
        jump = np.exp(rng.uniform(2.0, 8.0, (N // 14, 1))) * NOISE * rng.standard_normal((N // 14, 2))
        photograph[rng.choice(N, N // 14, replace=False)] += jump
    assert examine_order(replace(tracks, position=position)) == []


def test_a_return_of_the_loading_is_no_swap():
    tracks = rolling_tracks()
    assert examine_order(replace(tracks, position=tracks.position[[0, 1, 2, 3, 2, 1, 0, 1]])) == []


def test_a_photograph_of_few_rods_is_not_repeated():
    tracks = rolling_tracks()
    few = tracks.position.copy()
    few[4, 3:] = np.nan
    status = np.where(np.isnan(few[..., 0]), np.uint8(TrackStatus.LOST), tracks.status)
    few[4, :3] = few[3, :3]
    assert examine_order(replace(tracks, position=few, status=status)) == []


def test_photographs_in_random_order_are_named():
    tracks = rolling_tracks()
    order = np.array([3, 0, 6, 2, 7, 1, 5, 4])
    (found,) = examine_order(replace(tracks, position=tracks.position[order]))
    assert found.cause == "photographs_swapped"


def named_poses(tracks):
    repeated = find_repeated(tracks)
    tracks = without_poses(tracks, repeated)
    return examine_poses(tracks, find_impossible_poses(tracks), repeated)


def test_a_rod_whose_pose_is_repeated_is_named():
    tracks = rolling_tracks()
    position = tracks.position.copy()
    position[4:6, 33] = position[3, 33]
    (found,) = named_poses(replace(tracks, position=position))
    assert (found.cause, found.evidence) == (
        "outlier_tracks", "2 poses repeat the one before digit by digit while other rods move: rods 33",
    )  # fmt: skip


def test_one_displaced_photograph_is_in_the_right_order():
    tracks = rolling_tracks()
    position = tracks.position.copy()
    position[3] += [4e-3, -3e-3]
    assert examine_order(replace(tracks, position=position)) == []


def test_jumps_and_missing_poses_are_named():
    tracks = rolling_tracks()
    assert named_poses(tracks) == []
    position = tracks.position.copy()
    position[4, 44] += [1e-3, 0.0]
    (jump,) = named_poses(replace(tracks, position=position))
    assert jump.cause == "outlier_tracks"
    assert "1 pose jumps" in jump.evidence
    assert "photograph 4" in jump.evidence
    lost = np.random.default_rng(7).random((FRAMES, N)) < 0.1
    status = np.where(lost, np.uint8(TrackStatus.LOST), tracks.status)
    (missing,) = named_poses(
        replace(tracks, position=np.where(lost[..., None], np.nan, tracks.position), status=status)
    )
    assert missing.cause == "missing_poses"
    assert "photograph" not in missing.evidence
    position[:, 44] = tracks.position[:, 44]
    position[2, : N - 5], status = np.nan, tracks.status.copy()
    status[2, : N - 5] = TrackStatus.LOST
    (missing,) = named_poses(replace(tracks, position=position, status=status))
    assert missing.evidence.endswith("of the poses are missing, most of those in photograph 2")


def test_a_jump_is_no_outlier_where_all_rods_overlap_as_much():
    tracks = rolling_tracks()
    position = tracks.position.copy()
    position[4, 44] += [1e-3, 0.0]
    tracks = replace(tracks, position=position)
    assert find_impossible_poses(tracks).sum() == 1
    large = replace(tracks, radius=tracks.radius + np.where(np.arange(N) % 3 == 0, 2e-3, 0.0))
    assert find_outliers(large).any()
    assert not find_impossible_poses(large).any()
    assert [each.cause for each in named_poses(large)] == []


@pytest.mark.parametrize(
    ("factors", "named"), [((1.0, 1.02), True), ((1.0, 1.0005), False), ((1.02, 1.021), False), ((1.0, 0.98), False)]
)
def test_a_size_whose_rods_overlap_alone_is_named(factors, named):
    tracks = rolling_tracks()
    in_odd_layer = (np.arange(N) // SIDE) % 2 == 1  # touching neighbours along a layer are of one size
    found = examine_sizes(replace(tracks, radius=RADIUS * np.where(in_odd_layer, factors[1], factors[0])), box())
    assert [each.cause for each in found] == (["class_radii"] if named else [])
    if named:
        assert "rods of radius 8.16 mm overlap by 2.0 % of a diameter" in found[0].evidence


def test_small_overlaps_and_photographs_that_failed_show_no_wrong_size(monkeypatch):
    monkeypatch.setattr("tests.app.inference.diagnosis.test_direct_tests.NOISE", 1e-8)
    exact = rolling_tracks()
    in_odd_layer = (np.arange(N) // SIDE) % 2 == 1
    for factor, named in ((1.0015, False), (1.003, True)):
        tracks = replace(exact, radius=RADIUS * np.where(in_odd_layer, factor, 1.0))
        assert bool(find_wrong_sizes(tracks, box())) == named
    tracks = replace(exact, radius=RADIUS * np.where(in_odd_layer, 0.99, 1.0))
    assert find_wrong_sizes(tracks, box()) == {}
    squeezed = tracks.position.copy()
    squeezed[3, in_odd_layer, 0] *= 0.9
    tracks = replace(tracks, position=squeezed)
    assert find_wrong_sizes(tracks, box(), failed=[3]) == {}


def with_factors(tracks, factors):
    radius = tracks.radius.copy()
    radius[list(factors)] *= list(factors.values())
    return replace(tracks, radius=radius)


def test_rods_that_lie_inside_their_neighbours_are_named_and_these_are_not():
    tracks = with_factors(rolling_tracks(), {44: 1.5, 45: 1.4, 12: 1.3})
    found = find_oversized_rods(tracks)
    assert set(found) == {44, 45, 12}
    assert found[12] == pytest.approx(0.3, abs=0.06)
    (named,) = examine_sizes(tracks, box())
    assert named.cause == "oversized_rods"
    assert set(named.evidence.split("because of ")[1].split(", ")) == {"44", "45", "12"}


@pytest.mark.parametrize("factors", [{44: 1.1}, {44: 0.5}, dict.fromkeys(range(0, N, 3), 1.5)])
def test_small_overlaps_small_radii_and_radii_that_are_wrong_everywhere_show_no_single_rod(factors):
    assert find_oversized_rods(with_factors(rolling_tracks(), factors)) == {}


@pytest.mark.parametrize(("photographs", "named"), [((3,), False), ((0, 1, 2, 3), False), ((0, 1, 3, 4, 6, 7), True)])
def test_a_rod_that_overlaps_others_in_few_photographs_is_no_wrong_radius(photographs, named):
    tracks = rolling_tracks()
    position = tracks.position.copy()
    position[list(photographs), 44, 0] += 0.4 * RADIUS
    assert bool(find_oversized_rods(replace(tracks, position=position))) == named


@pytest.mark.parametrize(("shown", "named"), [(5, True), (2, False)])
def test_photographs_without_the_rod_do_not_count_but_few_with_it_show_no_radius(shown, named):
    """A disc that is found now and then, inside others, may be none: its radius is not to blame."""
    tracks = with_factors(rolling_tracks(), {44: 1.5})
    position, status = tracks.position.copy(), tracks.status.copy()
    position[shown:, 44], status[shown:, 44] = np.nan, TrackStatus.LOST
    assert bool(find_oversized_rods(replace(tracks, position=position, status=status))) == named


def test_fast_shear_is_named():
    tracks, walls = rolling_tracks(), box()
    assert examine_inertia(tracks, walls, RodMaterial()) == []
    sheared = tracks.position.copy()
    sheared[..., 0] += STEP * np.arange(FRAMES)[:, None] * sheared[..., 1]
    fast = replace(tracks, position=sheared, time=1e-3 * np.arange(FRAMES))
    (found,) = examine_inertia(fast, walls, RodMaterial())
    assert found.cause == "inertia"
    assert examine_inertia(replace(fast, time=30.0 * np.arange(FRAMES)), walls, RodMaterial()) == []


def test_rods_beyond_a_wall_are_named():
    tracks, walls = rolling_tracks(), box()
    assert examine_wall_places(tracks, walls) == []
    inside = walls.endpoints.copy()
    inside[:, 1, :, 1] -= 2e-3
    (found,) = examine_wall_places(tracks, replace(walls, endpoints=inside))
    assert found.cause == "wall_misplaced"
    assert "2 mm beyond wall 'top'" in found.evidence


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({}, True), ({"pressure": np.array([5e4, np.nan, np.nan])}, False), ({"gravity": (0.0, -9.81)}, False),
        ({"lid": True}, False), ({"bars": ["bottom"]}, False),
    ],
)  # fmt: skip
def test_an_open_side_without_any_load_is_named(change, named):
    ends = closed_box()
    bars = change.get("bars", ["bottom", "right", "left", *["top"] * change.get("lid", False)])
    rows = [("bottom", "right", "top", "left").index(bar) for bar in bars]
    pressure = change.get("pressure", np.full(len(bars), np.nan))
    walls = WallTracks(tuple(bars), np.repeat(ends[None, rows], FRAMES, axis=0), pressure)
    found = examine_load(rolling_tracks(0.0), walls, RodMaterial(gravity=change.get("gravity", (0.0, 0.0))))
    assert [each.cause for each in found] == ["load_missing"] * named
    assert all(each.evidence.endswith("open at the top") for each in found)


def closed_box():
    """Bottom, right, top and left of a box around the rods at rest."""
    width = SIDE * PITCH
    corner = np.array([[0.0, 0.0], [width, 0.0], [width, width], [0.0, width]])
    return np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
