"""Failures found earlier: each input is refused with one line that names it."""

from __future__ import annotations

import json
import os
import shutil

import cv2
import numpy as np
import pytest

from .attempt import attempt, find_problem
from .cases import FEW
from .foreign_files import FORMS

pytestmark = pytest.mark.thorough


def first_lines(file, **replaced: str) -> None:
    lines = file.read_text().splitlines()
    head = lines[0].split(",")
    cells = lines[1].split(",")
    for name, value in replaced.items():
        cells[head.index(name)] = value
    file.write_text("\n".join([lines[0], ",".join(cells), *lines[2:]]) + "\n")


@pytest.mark.parametrize(
    ("file", "cell", "message"),
    [
        ("grains.csv", {"radius": "7000.0"}, "larger than the packing"),
        ("walls.csv", {"x1": "1e300"}, "is larger than any length, time or force"),
        ("truth_contacts.csv", {"j": "9" * 30}, "is not the id of a grain"),
        ("truth_contacts.csv", {"j": "²"}, "neither a grain's id nor the name of a wall"),
        ("truth_contacts.csv", {"j": "9" * 5000}, "neither a grain's id nor the name of a wall"),
    ],
)
def test_an_invalid_cell_is_refused(originals, tmp_path, file, cell, message):
    copy = shutil.copytree(originals.tracked, tmp_path / "copy")
    first_lines(copy / file, **cell)
    ended = attempt(["check", str(copy), "--quiet"])
    assert find_problem(ended, None, (2,)) == ""
    assert message in ended.errors


@pytest.mark.parametrize(
    "corrupted", [{"seconds": []}, {"seconds": 10**400}, {"seconds": True}, {"verdict": []}, {"origin": {}}]
)
def test_a_verdict_of_a_wrong_type_is_refused(originals, tmp_path, corrupted):
    copy = shutil.copytree(originals.solved, tmp_path / "solved")
    log = copy / "verdicts.jsonl"
    line = json.loads(log.read_text().splitlines()[0])
    log.write_text(json.dumps(line | corrupted) + "\n")
    ended = attempt(["review", str(copy), "--export-csv", str(copy / "verdicts.csv")])
    assert find_problem(ended, None, (2,)) == ""
    assert next(iter(corrupted)) in ended.errors


@pytest.mark.parametrize("precision", ["0.01", "0.002"])
def test_imprecise_positions_are_refused_or_solved_quickly(originals, tmp_path, precision):
    out = tmp_path / "out"
    arguments = ["solve", str(originals.tracked), "--out", str(out), *FEW, "--set", f"tracks.precision={precision}"]
    ended = attempt(arguments)
    assert find_problem(ended, out) == ""
    assert ended.status == (2 if float(precision) > 0.009 else 0)


@pytest.mark.parametrize("file", ["one_ParticleData.dlm", "one_NormWeightedAdjacencyMatrix.dlm"])
def test_an_empty_table_of_another_program_is_named(originals, tmp_path, file):
    number = [form for form, _, _ in FORMS].index("pegs")
    copy = shutil.copytree(originals.foreign / str(number), tmp_path / "discs")
    (copy / file).write_text("\n")
    ended = attempt(["import", "pegs", str(copy), str(tmp_path / "out"), "--pixel-size", "1e-4", "--quiet"])
    assert find_problem(ended, tmp_path / "out", (2,)) == ""
    assert file in ended.errors


def test_rods_wider_than_the_photograph_are_not_found(originals):
    ended = attempt(["check", str(originals.photographed), "--set", "photographs.radii=[0.5]", "--quiet"])
    assert find_problem(ended, None, (2,)) == ""
    assert "no grains were found" in ended.errors


def test_a_photograph_without_rods_ends_in_one_line(originals, tmp_path):
    copy = shutil.copytree(originals.photographed, tmp_path / "copy")
    for file in (copy / "photos").iterdir():
        cv2.imwrite(str(file), np.full_like(cv2.imread(str(file), cv2.IMREAD_UNCHANGED), 90))
    ended = attempt(["check", str(copy), "--quiet"])
    assert find_problem(ended, None, (2,)) == ""
    assert "no grains were found" in ended.errors


def test_a_pattern_that_is_too_long_is_refused(originals):
    ended = attempt(["check", str(originals.photographed), "--set", f"photographs.files={'a' * 5000}", "--quiet"])
    assert find_problem(ended, None, (2,)) == ""
    assert "too long for a name" in ended.errors


def test_devices_and_pipes_are_refused(originals, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    commands = (
        ["check", str(originals.tracked), "--set", "tracks.positions=/dev/zero", "--quiet"],
        ["check", str(pipe), "--quiet"],
        ["score", str(pipe), "--json"],
        ["import", "trackmate", str(pipe), str(tmp_path / "out"), "--quiet"],
        ["review", str(originals.solved), "--import-csv", str(pipe)],
    )
    for arguments in commands:
        ended = attempt(arguments)
        assert find_problem(ended, None, (2,)) == "", arguments
        assert "not a file" in ended.errors, arguments


@pytest.mark.parametrize("command", ["check", "run"])
def test_times_that_no_calculation_holds_are_refused(originals, tmp_path, command):
    copy, out = shutil.copytree(originals.tracked, tmp_path / "copy"), tmp_path / "out"
    lines = (copy / "times.csv").read_text().splitlines()
    lines[-1] = f"{lines[-1].split(',')[0]},1e17"
    (copy / "times.csv").write_text("\n".join(lines) + "\n")
    ended = attempt([command, str(copy), "--quiet", *(("--out", str(out), *FEW) if command == "run" else ())])
    assert find_problem(ended, out, (2,)) == ""
    assert "times.csv" in ended.errors
    assert "1e17" in ended.errors


@pytest.mark.parametrize("command", ["check", "run"])
def test_an_experiment_file_of_gigabytes_that_takes_no_disk_is_refused(originals, tmp_path, command):
    copy, out = shutil.copytree(originals.tracked, tmp_path / "copy"), tmp_path / "out"
    os.truncate(copy / "experiment.toml", 3 << 30)
    ended = attempt([command, str(copy), "--quiet", *(("--out", str(out)) if command == "run" else ())])
    assert find_problem(ended, out, (2,)) == ""
    assert "has a hole" in ended.errors
