"""Mistyped commands, words of other programs, and help in the forms that people try."""

from __future__ import annotations

import pytest

from tests.program import rodsight


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (("runn", "x"), "runn: is not a command: did you mean `rodsight run`?"),
        (("gui",), "did you mean `rodsight open`?"),
        (("zzzz",), "is not a command: there are open, init"),
        (("help", "runn"), "did you mean `rodsight run`?"),
        (("export", "paraview", "x"), "did you mean `rodsight export vtk RESULTS`?"),
        (("export", "csv", "x"), "did you mean `rodsight export tables RESULTS`?"),
        (("export", "hdf5", "x"), "results.h5 is HDF5"),
        (("export", "tabels", "x"), "did you mean `rodsight export tables`?"),
        (("run", "x", "--worker", "2"), "rodsight run: --worker: is not an option: did you mean --workers?"),
        (("check", "--jsn", "x"), "--jsn: is not an option: did you mean --json?"),
        (("run", "x", "--sweeps", "some"), "--sweeps some: is not one of all, log, none"),
        (("run", "x", "--max-size", "big"), "--max-size big: is not a number; see rodsight run --help"),
        (
            ("run", "x", "--workers", "1.5"),
            "--workers 1.5: is not a whole number; see rodsight run --help",
        ),
        (("run", "x", "--full-frames", "a"), "--full-frames a: is not a whole number"),
        (("synth", "x", "--seed", "1.5"), "rodsight synth: --seed 1.5: is not a whole number"),
        (
            ("synth", "x", "--preset", "gravity"),
            "--preset gravity: makes tracks, not photographs: add --no-ph",
        ),
        (("study", "worlds", "--seeds", "1", "x"), "rodsight study: --seeds x: is not a whole number"),
        (("init", "x", "--photographs", "p", "--density", "2,7 g/cm3"), "is not a number: write --density 2700.0"),
        (("run", "x", "y"), "rodsight run: y: is one argument too many"),
        (("run",), "rodsight run: EXPERIMENT: is missing; see rodsight run --help"),
        (("study",), "rodsight study: KIND: is missing"),
        (("run", "x", "--frames"), "rodsight run: --frames: needs a value; see rodsight run --help"),
        (("init", "x"), "rodsight init: --photographs: is missing; see rodsight init --help"),
        (("--verson",), "rodsight: --verson: is not an option without a command: did you mean `rodsight --version`?"),
        (("sample",), "did you mean `rodsight synth my_test`?"),
    ],
)
def test_what_was_meant_is_named_in_one_line(words, hint, capsys):
    assert rodsight(*words) == 2
    error = capsys.readouterr().err
    assert hint in error
    assert error.count("rodsight:") <= 1
    assert "rodsight: rodsight" not in error
    assert len(error.splitlines()) == 1
    assert "class" not in error


def test_help_with_a_command_is_the_help_of_the_command(capsys):
    assert rodsight("help", "check") == 0
    assert "rodsight check" in capsys.readouterr().out


@pytest.mark.parametrize("words", [("view",), ("share",), ("export", "tables"), ("score",), ("export", "pictures")])
def test_the_run_of_an_experiment_is_suggested_where_the_experiment_is_given(words, tmp_path, capsys):
    (tmp_path / "test").mkdir()
    (tmp_path / "test" / "experiment.toml").write_text("")
    assert rodsight(*words, tmp_path / "test") == 2
    assert "is an experiment: give the folder of its run, such as runs/test" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "written"),
    [
        (("--pixel-size", "0.25 mm"), "write --pixel-size 0.00025"),
        (("--interval", "2 min"), "write --interval 120.0"),
        (("--density", "2,7 g/cm3"), "write --density 2700.0"),
        (("--length", "much"), "see rodsight init --help"),
        (("--pressure", "top=50kPa"), "write top=50000.0"),
        (("--pressure", "50kPa"), "such as top=50e3"),
    ],
)
def test_an_option_with_a_unit_is_named_with_the_number_to_write(flags, written, tmp_path, capsys):
    assert rodsight("init", tmp_path, "--photographs", "*.png", *flags) == 2
    message = capsys.readouterr().err
    assert written in message
    assert message.count("\n") == 1
