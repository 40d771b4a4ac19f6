"""Options that would have no effect are refused by name."""

from __future__ import annotations

import pytest

from tests.program import rodsight


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "EXPERIMENT", "--idle", "5"), "run: --idle: does not apply without --follow"),
        (("review", "EXPERIMENT", "--complete"), "review: --complete: does not apply without --import-csv"),
        (
            ("review", "EXPERIMENT", "--import-csv", "a.csv", "--export-csv", "b.csv"),
            "review: --export-csv: does not apply with --import-csv",
        ),
        (("share", "--repair", "broken.rrd", "--scale", "0.5"), "share: --scale: does not apply with --repair"),
        (("share", "--repair", "broken.rrd", "--html"), "share: --html: does not apply with --repair"),
        (
            ("sensitivity", "EXPERIMENT", "--budget", "--factors", "friction"),
            "sensitivity: --factors: does not apply with --budget",
        ),
        (
            ("export", "pictures", "EXPERIMENT", "--figure", "rose", "--tab", "Forces"),
            "export: --tab: does not apply with --figure",
        ),
    ],
)
def test_an_option_without_effect_is_refused(arguments, words, made_tracks, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert rodsight(*(made_tracks if each == "EXPERIMENT" else each for each in arguments)) == 2
    assert words in capsys.readouterr().err
