"""Perturbations of a test: unchanged frames, changed frames, and their comparison."""

from __future__ import annotations

from io import StringIO

import numpy as np
import pytest
from rich.console import Console
from rodsight.cli.main import main
from rodsight.study.scenarios.perturbation import (
    ADDED,
    FORCE_TOLERANCE,
    R_TOLERANCE,
    Perturbation,
    compare,
    on_given_grains,
    perturb,
    print_perturbations,
)
from rodsight.tracks import Tracks, TrackStatus, WallTracks

F, N = 6, 5


def make_tracks() -> tuple[Tracks, WallTracks]:
    rng = np.random.default_rng(0)
    tracks = Tracks(
        np.arange(N), np.full(N, 0.01), np.arange(F) * 30.0, rng.random((F, N, 2)), rng.random((F, N)),
        np.full((F, N), 1e-5), np.full((F, N), np.nan), np.full((F, N), TrackStatus.GIVEN, np.uint8),
    )  # fmt: skip
    return tracks, WallTracks(("top",), rng.random((F, 1, 2, 2)), np.array([5e4]))


TRACKS, WALLS = make_tracks()


@pytest.fixture
def cases() -> dict[str, Perturbation]:
    return {each.name: each for each in perturb(TRACKS, WALLS, np.random.default_rng(1))}


def test_remaining_photographs_are_unchanged_and_keep_their_frame_numbers(cases):
    assert cases["without the last photograph"].frame == (0, 1, 2, 3, 4)
    assert cases["without the first"].frame == (1, 2, 3, 4, 5)
    assert cases["without one in the middle"].frame == (0, 1, 2, 4, 5)
    assert cases["with one more"].frame == (0, 1, 2, 3, ADDED, 4, 5)
    for name, case in cases.items():
        assert case.tracks.frame_count == len(case.frame) == len(case.walls.endpoints)
        if "noise" in name:
            continue
        for row, k in enumerate(case.frame):
            if k != ADDED:
                assert np.array_equal(case.tracks.position[row], TRACKS.position[k])
                assert np.array_equal(case.walls.endpoints[row], WALLS.endpoints[k])
                assert case.tracks.time[row] == TRACKS.time[k]


def test_an_added_photograph_lies_midway_except_for_its_noise(cases):
    more = cases["with one more"]
    midway = 0.5 * (TRACKS.position[3] + TRACKS.position[4])
    error = more.tracks.position[4] - midway
    assert 1e-6 < np.abs(error).max() < 1e-4
    assert more.tracks.time[4] == 105.0
    assert np.array_equal(more.walls.endpoints[4], 0.5 * (WALLS.endpoints[3] + WALLS.endpoints[4]))
    assert np.all(np.diff(more.tracks.time) > 0)


def test_positions_move_by_a_tenth_of_their_noise(cases):
    moved = cases["moved by a tenth of the noise"].tracks.position - TRACKS.position
    assert 0.5e-6 < moved.std() < 1.5e-6


def test_inferred_rods_are_left_out_and_walls_keep_their_numbers():
    """Five given grains, two inferred ones and two walls: 0–1, 0–6 (inferred), 3–8 (the second wall)."""
    bodies = 9
    key = np.array([0 * bodies + 1, 0 * bodies + 6, 3 * bodies + 8])
    given, force = on_given_grains(key, np.arange(6.0).reshape(3, 2), bodies, 2, N)
    assert given.tolist() == [1, 3 * 7 + 6]
    assert force.tolist() == [[0.0, 1.0], [4.0, 5.0]]


def test_the_worst_frame_is_named_with_and_without_a_truth():
    key = np.arange(4)
    plain = [(key, np.array([[1.0, 0], [2, 0], [3, 0], [4, 0]]))] * 3
    changed = (key, np.array([[4.0, 0], [2, 0], [3, 0], [1, 0]]))
    case = Perturbation("changed", TRACKS, WALLS, (0, ADDED, 1, 2))
    other = [plain[0], changed, plain[1], changed]
    found = compare(case, plain, other, plain)
    assert (found.change_frame, found.decrease_frame) == (2, 2)
    assert found.change == pytest.approx(np.sqrt(18 / 30))
    assert found.mean_change == pytest.approx(found.change / 3)
    assert found.decrease > R_TOLERANCE
    assert np.isnan(compare(case, plain, other, None).decrease)
    text = StringIO()
    steady = compare(case, plain, [plain[0], changed, plain[1], plain[2]], plain)
    print_perturbations(Console(file=text, width=140), "test", [found, steady])
    lines = text.getvalue().splitlines()
    assert lines[2].endswith("exceeded")
    assert lines[3].rstrip().endswith("within")
    assert found.change > FORCE_TOLERANCE


def test_an_experiment_is_for_the_study_of_perturbations_only(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit, match="2"):
        main(["study", "worlds", "somewhere"])
    assert "applies to real, perturbation and paper only" in capsys.readouterr().err
