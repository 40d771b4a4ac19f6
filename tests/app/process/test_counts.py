"""Counts in sentences have the singular where there is one."""

from __future__ import annotations

import re
from collections import defaultdict

import pytest
from rodsight.cli.summary_table import trust_lines
from rodsight.process.counts import state_count

from tests.program import rodsight

PLURAL_OF_ONE = re.compile(r"(?<![\d.,])1 (frames|photographs|grains|rods|poses|walls|rows|contacts|runs|sweeps)\b")


@pytest.mark.parametrize(("count", "words"), [(0, "0 lost poses"), (1, "1 lost pose"), (2, "2 lost poses")])
def test_a_noun_is_in_the_plural_unless_there_is_one(count, words):
    assert state_count(count, "lost pose") == words


def test_a_single_frame_is_not_called_frames(tmp_path, capsys):
    (tmp_path / "spots.csv").write_text("frame,id,x,y,radius\n0,1,0.1,0.1,0.01\n0,2,0.12,0.1,0.01\n")
    columns = "frame=frame,id=id,x=x,y=y,radius=radius"
    assert rodsight("import", "table", tmp_path / "spots.csv", tmp_path / "out", "--columns", columns) == 0
    assert rodsight("check", tmp_path / "out", "--no-budget") == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "2 grains in 1 frame." in printed
    assert "2 grains tracked over 1 frame, " in printed
    assert not PLURAL_OF_ONE.search(printed)


def test_a_single_lost_grain_is_not_called_grains():
    summary = {
        "status_count": {}, "frame_count": 1, "settled_after": None, "grain_count": 1, "resets": [], "suspects": [],
        "rearrangements": [], "failures": {}, "lost_poses": 3, "lost_grains": 1, "suspect_poses": 1, "cut_grains": 1,
        "worst_unbalance": 0.1, "worst_unbalance_frame": 0, "trust": [], "status": [],
    }  # fmt: skip
    text = " ".join(trust_lines(defaultdict(lambda: None, summary)))
    assert "1 grain, 1 frame." in text
    assert "3 poses of 1 grain lost, 1 pose suspect, 1 rod cut by the picture's border" in text


def test_a_small_force_residual_keeps_its_digits_and_a_corrected_cause_is_called_so():
    found = {"cause": "rotation_sign", "evidence": "backwards", "effect": "none", "cure": "change its sign"}
    summary = {
        "status_count": {}, "frame_count": 1, "settled_after": None, "grain_count": 1, "resets": [], "suspects": [],
        "rearrangements": [], "failures": {}, "lost_poses": 0, "worst_unbalance": 3.2e-4, "worst_unbalance_frame": 0,
        "trust": [], "status": [], "diagnosis": [found, found | {"cause": "lens", "corrected": True}],
    }  # fmt: skip
    lines = trust_lines(defaultdict(lambda: None, summary))
    assert "Greatest force residual of a grain 0.00032 of the mean force" in " ".join(lines)
    assert "[bold red]Something is wrong:[/] Rotation sign: backwards; none. Cure: change its sign." in lines
    assert "[bold]Corrected by the run:[/] Lens: backwards; none. Cure: change its sign." in lines
