"""Poses that jump against their neighbours, into others or back, count as lost; real motions are kept."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.correction.tables.outliers import (
    find_misplaced,
    find_outliers,
    find_repeated,
    remove_outliers,
    restore_exchanged_ids,
)
from rodsight.solver.bodies.wall_shapes import IN, circle_ends
from rodsight.tracks import Tracks, TrackStatus, WallTracks

FRAMES, SIDE, PITCH, NOISE = 6, 7, 0.016, 1e-5
N = SIDE * SIDE
ROD = SIDE * (SIDE // 2) + SIDE // 2  # in the middle


def sheared_tracks(jumps=()):
    """Rods on a lattice in simple shear with noise; jumps: (frame, rod, displacement [m])."""
    rng = np.random.default_rng(3)
    x, y = (each.ravel() * PITCH for each in np.meshgrid(np.arange(SIDE), np.arange(SIDE)))
    shear = 4e-3 * np.arange(FRAMES)
    position = np.stack([np.column_stack([x + g * y, y]) for g in shear])
    position += NOISE * rng.standard_normal(position.shape)
    for frame, rod, move in jumps:
        position[frame, rod] += move
    flat = np.full((FRAMES, N), NOISE)
    return Tracks(
        np.arange(N), np.full(N, 0.00797), 30.0 * np.arange(FRAMES), position, np.tile(0.1 * shear[:, None], (1, N)),
        flat, np.full((FRAMES, N), np.nan), np.full((FRAMES, N), TrackStatus.GIVEN, np.uint8),
    )  # fmt: skip


def test_correct_tracks_are_returned_as_they_are():
    tracks = sheared_tracks()
    found, remark = remove_outliers(tracks)
    assert found is tracks
    assert remark == ""


@pytest.mark.parametrize("frame", [2, FRAMES - 1])
def test_a_jump_for_one_photograph_counts_as_lost(frame):
    tracks = sheared_tracks([(frame, ROD, (6e-4, -5e-4))])
    assert np.argwhere(find_outliers(tracks)).tolist() == [[frame, ROD]]
    found, remark = remove_outliers(tracks)
    assert np.argwhere(found.lost).tolist() == [[frame, ROD]]
    assert found.status[frame, ROD] == TrackStatus.LOST
    others = np.arange(N) != ROD
    assert np.array_equal(found.position[:, others], tracks.position[:, others])
    assert "1 pose in 1 photograph jumps" in remark


def test_poses_that_a_tracker_repeats_count_as_lost():
    tracks = sheared_tracks()
    position, rotation = tracks.position.copy(), tracks.rotation.copy()
    position[3:5, ROD], rotation[3:5, ROD] = position[2, ROD], rotation[2, ROD]
    repeated = replace(tracks, position=position, rotation=rotation)
    assert np.argwhere(find_repeated(repeated)).tolist() == [[3, ROD], [4, ROD]]
    found, remark = remove_outliers(repeated)
    assert found.lost[3:5, ROD].all()
    assert "2 poses in 2 photographs repeat the ones before digit by digit" in remark
    position[:, ROD], rotation[:, ROD] = position[2, ROD], rotation[2, ROD]  # it is fixed
    assert not find_repeated(replace(tracks, position=position, rotation=rotation)).any()
    position[3], rotation[3] = position[2], rotation[2]  # the photograph is a copy
    position[4, ROD] += 1e-3
    assert not find_repeated(replace(tracks, position=position, rotation=rotation)).any()


@pytest.mark.parametrize("frame", [0, 3, FRAMES - 1])
def test_a_rod_inside_another_is_an_outlier_however_far_the_packing_moves(frame):
    rng = np.random.default_rng(5)
    quiet = sheared_tracks([(frame, ROD, (8e-4, 0.0))])
    moving = quiet.position + 5e-5 * rng.standard_normal((FRAMES, N, 2))
    moving[frame] = quiet.position[frame]
    tracks = replace(quiet, position=moving, radius=np.full(N, 0.00795))
    assert np.argwhere(find_outliers(tracks)).tolist() == [[frame, ROD]]


def test_a_rod_beyond_a_wall_is_an_outlier():
    low = SIDE // 2  # in the row beside the wall
    tracks = sheared_tracks([(2, low, (0.0, -4e-4))])
    ends = np.tile(np.array([[[-1.0, -0.00798], [1.0, -0.00798]]]), (FRAMES, 1, 1, 1))
    assert not find_outliers(tracks).any()
    found = find_outliers(tracks, WallTracks(("bottom",), ends, np.array([np.nan])))
    assert np.argwhere(found).tolist() == [[2, low]]


def test_a_rod_that_jumps_in_consecutive_photographs_is_found_in_each():
    tracks = sheared_tracks([(2, ROD, (7e-4, 0.0)), (3, ROD, (-5e-4, 4e-4)), (4, ROD, (0.0, -9e-4))])
    assert np.argwhere(find_outliers(tracks)).tolist() == [[k, ROD] for k in (2, 3, 4)]


def test_overlaps_of_wrong_radii_are_no_outliers():
    tracks = sheared_tracks()
    radius = tracks.radius.copy()
    radius[::5] *= 1.05
    assert not find_outliers(replace(tracks, radius=radius)).any()


def test_a_jump_that_no_other_rod_hinders_is_real():
    tracks = sheared_tracks([(2, ROD, (6e-4, -5e-4))])
    assert find_outliers(tracks).any()
    assert not find_outliers(replace(tracks, radius=np.full(N, 0.004))).any()


def test_a_rod_that_moves_and_stays_is_no_outlier():
    moved = sheared_tracks([(k, ROD, (6e-4, 0.0)) for k in range(3, FRAMES)])
    assert not find_outliers(moved)[:-1].any()


def test_jumps_of_many_rods_are_a_rearrangement():
    some = np.random.default_rng(0).permutation(N)[: N // 4]
    tracks = sheared_tracks([(2, rod, (1e-3, 5e-4)) for rod in some])
    assert not find_outliers(tracks)[2].any()


def test_a_jump_of_the_whole_picture_is_no_outlier():
    tracks = sheared_tracks([(2, rod, (1e-3, 0.0)) for rod in range(N)])
    assert not find_outliers(tracks).any()


def test_lost_rods_and_few_frames_are_no_obstacle():
    tracks = sheared_tracks([(2, ROD, (6e-4, 6e-4))])
    position = tracks.position.copy()
    position[3, 0] = np.nan
    lost = replace(tracks, position=position)
    assert np.argwhere(find_outliers(lost)).tolist() == [[2, ROD]]
    assert np.isnan(remove_outliers(lost)[0].position[3, 0]).all()


def test_a_jump_that_is_possible_but_undone_is_an_outlier():
    tracks = sheared_tracks([(2, ROD, (1.7e-4, 0.0))])  # onto its neighbour, by less than noise allows
    tracks = replace(tracks, radius=np.full(N, 0.00794))
    assert np.argwhere(find_outliers(tracks)).tolist() == [[2, ROD]]
    assert not find_outliers(sheared_tracks([(2, ROD, (0.0, 5e-5))])).any()


def test_a_rod_that_goes_on_as_before_is_no_outlier_at_the_end():
    tracks = sheared_tracks([(k, ROD, (4e-4 * k, 0.0)) for k in range(1, FRAMES)])
    assert not find_outliers(tracks).any()


@pytest.mark.parametrize(("move", "found"), [(8e-4, True), (1e-4, False)])
def test_an_impossible_pose_overlaps_by_more_than_all_others(move, found):
    tracks = sheared_tracks([(0, ROD, (move, 0.0))])
    assert find_outliers(replace(tracks, radius=np.full(N, 0.00803)))[0, ROD] == found


def test_a_rod_inside_another_in_two_photographs_is_found_in_both():
    rng = np.random.default_rng(5)
    quiet = sheared_tracks([(2, ROD, (8e-4, 0.0)), (3, ROD, (4e-4, 0.0))])
    moving = quiet.position + 5e-5 * rng.standard_normal((FRAMES, N, 2))
    moving[2:4] = quiet.position[2:4]
    tracks = replace(quiet, position=moving, radius=np.full(N, 0.00795))
    assert np.argwhere(find_outliers(tracks)).tolist() == [[2, ROD], [3, ROD]]


def test_a_rod_beyond_a_circular_wall_is_an_outlier():
    low, large = SIDE // 2, 10.0
    tracks = sheared_tracks([(2, low, (0.0, -4e-4))])
    circle = circle_ends(np.array([[low * PITCH, large - 0.00798]]), np.array([large]), np.zeros(1))
    walls = WallTracks(("ring",), np.tile(circle, (FRAMES, 1, 1, 1)), np.array([np.nan]), side=np.full(1, IN, np.int8))
    assert np.argwhere(find_outliers(tracks, walls)).tolist() == [[2, low]]


def test_a_gap_is_not_compared_with_that_of_an_outlier_in_the_photograph_beside():
    """Both poses overlap the same rod."""
    moves = [(0, ROD, (2.65e-4, 2.08e-4)), (1, ROD, (-2.09e-4, 8.95e-4))]
    tracks = replace(sheared_tracks(moves), radius=np.full(N, 0.0079))
    assert np.argwhere(find_outliers(tracks)).tolist() == [[0, ROD], [1, ROD]]


def test_of_two_photographs_the_greater_jump_is_taken_first():
    """A correct pose beside it deviates too, because its expected position is wrong."""
    moves = [(3, ROD + 1, (3.3e-5, -8.52e-4)), (3, ROD + SIDE, (-8.49e-4, 6.59e-4)), (4, ROD, (3.8e-5, 5.17e-4))]
    tracks = replace(sheared_tracks(moves), radius=np.full(N, 0.0079))
    assert np.argwhere(find_outliers(tracks)).tolist() == [[3, ROD + 1], [3, ROD + SIDE], [4, ROD]]


def test_a_jump_in_the_last_photograph_must_be_greater_than_within_the_sequence():
    radius = np.full(N, 0.00789)
    last, greater = (sheared_tracks([(FRAMES - 1, ROD, (move, 0.0))]) for move in (2.8e-4, 3.6e-4))
    assert not find_outliers(replace(last, radius=radius)).any()
    assert np.argwhere(find_outliers(replace(greater, radius=radius))).tolist() == [[FRAMES - 1, ROD]]


def test_confused_names_are_given_back_with_all_of_their_poses():
    tracks = sheared_tracks()
    tracks = replace(tracks, zncc=np.arange(FRAMES * N, dtype=float).reshape(FRAMES, N), fringes=np.ones((FRAMES, N)))
    fields = ("position", "rotation", "sigma", "zncc", "status", "fringes")
    confused = {name: getattr(tracks, name).copy() for name in fields}
    for each in confused.values():
        each[3:, [ROD, ROD + 1]] = each[3:, [ROD + 1, ROD]]
    found, words = restore_exchanged_ids(replace(tracks, **confused))
    assert words.endswith(f"{ROD} as {ROD + 1}, {ROD + 1} as {ROD} from photograph 3 on")
    given = np.tile(tracks.id, (FRAMES, 1))
    given[3:, [ROD, ROD + 1]] = tracks.id[[ROD + 1, ROD]]
    assert found.given_id is not None
    assert np.array_equal(found.given_id, given)
    for name in (*fields, "radius", "id"):
        assert np.array_equal(getattr(found, name), getattr(tracks, name)), name


def test_a_rod_that_goes_on_under_a_new_name_is_listed_without_the_name_that_nobody_has():
    tracks = sheared_tracks()
    position = np.insert(tracks.position, N, np.nan, axis=1)
    position[4:, [ROD, N]] = position[4:, [N, ROD]]
    flat = np.full((FRAMES, N + 1), NOISE)
    renamed = Tracks(
        np.arange(N + 1), np.full(N + 1, 0.00797), tracks.time, position, np.zeros_like(flat), flat,
        np.full_like(flat, np.nan), np.where(np.isnan(position[..., 0]), TrackStatus.LOST, TrackStatus.GIVEN),
    )  # fmt: skip
    words = restore_exchanged_ids(renamed)[1]
    assert words.endswith(f": {ROD} as {N} from photograph 4 on")


def test_names_of_their_own_stay_without_a_word():
    tracks = sheared_tracks()
    found, words = restore_exchanged_ids(tracks)
    assert words == ""
    assert found is tracks
    assert found.given_id is None


def test_every_photograph_with_confused_names_is_listed_up_to_a_few():
    tracks, row = sheared_tracks(), np.tile(np.arange(N), (FRAMES, 1))
    for k in range(1, FRAMES):
        row[k:, [7 * k, 7 * k + 1]] = [7 * k + 1, 7 * k]
    words = restore_exchanged_ids(tracks.rearranged(row))[1]
    assert words.count("photograph") == 4
    assert words.endswith("; …")


def suspected(tracks: Tracks, *poses) -> Tracks:
    status = tracks.status.copy()
    for frame, rod in poses:
        status[frame, rod] = TrackStatus.SUSPECT
    return replace(tracks, status=status)


@pytest.mark.parametrize("frames", [range(2, 4), range(3, FRAMES), range(2)])
def test_suspect_poses_far_from_their_neighbours_count_as_lost(frames):
    far = [(k, ROD, (0.006, 0.004)) for k in frames]
    tracks = suspected(sheared_tracks(far), *((k, ROD) for k in frames), (4, 3))
    found, remark = remove_outliers(tracks)
    assert np.argwhere(found.lost).tolist() == [[k, ROD] for k in frames]
    assert remark.startswith(f"{len(frames)} poses in {len(frames)} photographs are suspect matches far from")
    stays = np.zeros((FRAMES, N), np.bool_)
    stays[:, ROD] = True  # placed by hand
    assert remove_outliers(tracks, placed=stays)[0] is tracks


def test_suspect_poses_stay_where_most_are_or_where_nothing_is_certain():
    far = [(k, ROD, (0.006, 0.004)) for k in range(FRAMES)]
    always = suspected(sheared_tracks(far), *((k, ROD) for k in range(FRAMES)))
    assert not find_misplaced(always).any()
    blurred = suspected(sheared_tracks(far[2:3]), *((2, rod) for rod in {ROD, *range(N // 5)}))
    assert not find_misplaced(blurred).any()
