"""Numbers in sentences: one thing is singular, a sign has a word, and what is missing is not counted."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.cli.summary_table import calibration_lines
from rodsight.inference.diagnosis.direct_tests import examine_poses
from rodsight.inference.diagnosis.rivals import rivals_of

from tests.app.experiment.tables import edit
from tests.program import rodsight


def lines_of(outward: float, lens: float) -> str:
    wall = {"outward": outward, "outward_sd": 2e-6, "tilt": 0.0, "tilt_sd": 1.0}
    rms = dict.fromkeys(("centre_rms", "centre_sd", "radius_rms", "radius_sd"), 1e-6)
    gaps = dict.fromkeys(
        ("gap_rms_before", "gap_rms_after", "wall_gap_rms_before", "wall_gap_rms_after", "lens_sd"), 1e-6
    )
    facts = {"verdict": "applied", "applied": True, "wall": {"left": wall}, "lens": lens, **rms, **gaps}
    return " ".join(calibration_lines({**facts, "pixel_size": 0.0, "pixel_size_sd": 0.0}))


@pytest.mark.parametrize(("sign", "word"), [(1, "outward"), (-1, "inward")])
def test_a_direction_is_a_word_and_not_a_sign(sign, word):
    lines = lines_of(sign * 299e-6, sign * 5e-6)
    assert f"wall left 299 ± 2 µm {word}." in lines
    assert f"farthest corner by 5 ± 1 µm {word}." in lines


def test_check_counts_the_grains_that_the_tracks_hold(tracked, capsys):
    table = tracked / "tracks.csv"
    rows = table.read_text().splitlines()
    table.write_text("\n".join(row for row in rows if row.split(",")[1] not in ("3", "7")) + "\n")
    edit(tracked / "experiment.toml", 'truth = "truth_contacts.csv"\n', "")
    assert rodsight("check", tracked, "--no-budget") == 0
    assert "38 of 40 grains tracked over 5 frames" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("count", "words"),
    [
        (1, "1 pose jumps against its neighbours and back, in photograph 0"),
        (2, "2 poses jump against their neighbours and back, in photographs 0, 1"),
    ],
)
def test_poses_jump_against_their_own_neighbours(count, words):
    (found,) = examine_poses(
        SimpleNamespace(present=np.ones((3, 4))), np.eye(3, 4, dtype=bool) & (np.arange(4) < count), np.zeros((3, 4))
    )
    assert words in found.evidence


def test_wrong_radii_are_too_large_or_too_small():
    inputs = SimpleNamespace(tracks=SimpleNamespace(radius=np.array([0.007, 0.008])))
    rivals = {each.words: each for each in rivals_of(inputs) if each.cause.endswith("radii")}
    assert "all radii are stated 2 % too large" in rivals
    assert "all radii are stated 2 % too small" in rivals
    assert not any("+" in words or "-" in words for words in rivals)
