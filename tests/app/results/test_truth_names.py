"""Matching of grains with true grains: given ones by their ids, inferred ones by their positions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rodsight.process.errors import InputError
from rodsight.process.frame_range import FrameRange
from rodsight.results.results import TruthContacts
from rodsight.results.truth import names_in_table, names_of_given, read_truth, true_ids, true_names
from rodsight.tracks import Tracks, TrackStatus

RADIUS = 0.008  # [m]
TRUE = {10: (0.1, 0.1), 11: (0.2, 0.1), 12: (0.3, 0.1), 13: (0.4, 0.1)}  # [m]


@pytest.fixture
def poses(tmp_path: Path) -> Path:
    file = tmp_path / "truth_tracks.csv"
    file.write_text("frame,id,x,y,theta\n" + "".join(f"0,{k},{x},{y},0\n" for k, (x, y) in TRUE.items()))
    return file


def tracks_of(ids: list[int], place: list[tuple[float, float]], inferred: int = 0) -> Tracks:
    n = len(ids)
    return Tracks(
        np.array(ids), np.full(n, RADIUS), np.zeros(1), np.array(place)[None], np.zeros((1, n)), np.full((1, n), 1e-5),
        np.full((1, n), np.nan), np.full((1, n), TrackStatus.GIVEN, np.uint8),
        inferred=np.arange(n) >= n - inferred,
    )  # fmt: skip


def test_given_grains_keep_their_ids_at_corrected_positions(poses: Path) -> None:
    moved = [(x + 0.1, y) for x, y in list(TRUE.values())[:3]]  # each at the position of another one
    assert names_of_given(poses, tracks_of([10, 11, 12], moved), 0).tolist() == [10, 11, 12]
    assert true_names(poses, tracks_of([0, 1, 2], moved), 0).tolist() == [11, 12, 13]


def test_an_inferred_rod_gets_the_id_at_its_position(poses: Path) -> None:
    given = [TRUE[10], TRUE[11], TRUE[12]]
    inferred = [(0.403, 0.1), (0.401, 0.101), TRUE[11], (0.6, 0.1)]  # two at one position, on a given one, at no rod
    names = names_of_given(poses, tracks_of([10, 11, 12, 14, 15, 16, 17], given + inferred, inferred=4), 0)
    assert names.tolist() == [10, 11, 12, 13, -1, -1, -1]


def test_contacts_of_unseen_rods_are_ignored_and_unknown_ids_refused(poses: Path, tmp_path: Path) -> None:
    truth = tmp_path / "truth_contacts.csv"
    truth.write_text("frame,i,j,fn,ft\n0,10,11,5,1\n0,12,13,7,2\n0,13,top,3,0\n")
    names = np.array([10, 11, 12])
    found = read_truth(truth, names, ("top",), frame_count=1, unseen=true_ids(poses))
    assert found.fn.tolist() == [5.0]
    truth.write_text("frame,i,j,fn,ft\n0,10,11,5,1\n0,12,12,7,2\n")
    with pytest.raises(InputError, match=r"row 3, j = '12': is the grain itself"):
        read_truth(truth, names, ("top",), frame_count=1)
    truth.write_text("frame,i,j,fn,ft\n0,10,99,5,1\n")
    with pytest.raises(InputError, match=r"row 2, j = '99': is not the id of a grain"):
        read_truth(truth, names, ("top",), frame_count=1, unseen=true_ids(poses))


def test_frames_that_count_from_one_are_refused(tmp_path: Path) -> None:
    truth = tmp_path / "truth_contacts.csv"
    truth.write_text("frame,i,j,fn,ft\n1,10,11,5,1\n2,10,11,7,2\n")
    names = np.array([10, 11])
    with pytest.raises(InputError, match=r"row 3, frame = '2': is no photograph: .* 0 to 1, and these from 1"):
        read_truth(truth, names, ("top",), frame_count=2)
    assert read_truth(truth, names, ("top",), frame_count=3).frame.tolist() == [1, 2]
    assert read_truth(truth, names, ("top",), frame_count=2, frames=FrameRange(0, 2)).frame.tolist() == [1]


def test_names_that_a_tracker_confused_are_those_of_the_table_in_every_frame(tmp_path: Path) -> None:
    """Forces that another program lists under the names of its tracks belong to the grains that bear them."""
    truth = tmp_path / "truth_contacts.csv"
    truth.write_text("frame,i,j,fn,ft\n0,10,11,5,1\n2,12,11,7,2\n2,10,top,3,0\n7,99,11,1,0\n")
    tracks = tracks_of([10, 11, 12], [TRUE[10], TRUE[11], TRUE[12]])
    np.testing.assert_array_equal(names_in_table(tracks), tracks.id)
    names = np.array([[10, 11, 12], [12, 11, 10]])
    found = read_truth(truth, names, ("top",), frame_count=2, frames=FrameRange(0, None, 2), unseen=np.array([99]))
    assert found.frame.tolist() == [0, 1, 1]
    assert list(zip(found.i.tolist(), found.j.tolist(), strict=True)) == [(0, 1), (0, 1), (2, 3)]
    np.testing.assert_array_equal(names_in_table(replace(tracks, given_id=names[1:])), names[1:])


def test_nothing_shows_the_forces_of_boundary_grains_on_one_another_and_on_walls() -> None:
    i, j = np.array([0, 0, 1, 1, 2]), np.array([1, 2, 2, 3, 3])  # three grains, one wall
    truth = TruthContacts(np.zeros(5, np.int64), i, j, np.arange(5.0), np.zeros(5))
    assert truth.outside(None) is truth
    assert truth.outside(np.array([True, True, False])).fn.tolist() == [1.0, 2.0, 4.0]
