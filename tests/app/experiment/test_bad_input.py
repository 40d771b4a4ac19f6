"""Every mistake in the input gives one line with file, place and value, exit status 2, and writes nothing."""

import os
from pathlib import Path

import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.experiment.walls import describe_walls_at_rest, read_walls

from tests.app.experiment.tables import edit, scale_radii, swap_row
from tests.program import refuse, rodsight

TOML, TRACKS, WALLS, GRAINS, TIMES = "experiment.toml", "tracks.csv", "walls.csv", "grains.csv", "times.csv"

MISTAKES = {
    "unknown key": (TOML, lambda f: edit(f, "friction = 0.25", "frction = 0.25"), ["material.frction"]),
    "wrong type": (TOML, lambda f: edit(f, "density = 2700.0", 'density = "heavy"'), ["material.density", "heavy"]),
    "negative": (TOML, lambda f: edit(f, "density = 2700.0", "density = -1"), ["material.density", "-1"]),
    "not finite": (TOML, lambda f: edit(f, "friction = 0.25", "friction = nan"), ["material.friction", "nan"]),
    "not TOML": (TOML, lambda f: edit(f, "[material]", "[material"), ["not TOML"]),
    "no source": (TOML, lambda f: edit(f, "[tracks]", "[material2]"), ["material2"]),
    "pressure on no wall": (TOML, lambda f: edit(f, "[walls.top]", "[walls.roof]"), ["walls.roof"]),
    "unknown wall key": (TOML, lambda f: edit(f, "pressure =", "presure ="), ["walls.top.presure"]),
    "missing table": (TOML, lambda f: edit(f, '"walls.csv"', '"wals.csv"'), ["wals.csv", "No such file"]),
    "eta": (
        TOML,
        lambda f: edit(f, "friction = 0.25", "formal_weight = 0.7\nfriction = 0.25"),
        ["formal_weight", "0.7"],
    ),
    "missing column": (TRACKS, lambda f: edit(f, "id,x", "id,u"), ["column x"]),
    "diameters": (GRAINS, lambda f: scale_radii(f, 2.0), ["grains.csv", "radius", "overlap", "0.50"]),
    "small radii": (GRAINS, lambda f: scale_radii(f, 0.5), ["grains.csv", "radius", "stand apart", "2.00"]),
    "millimetres": (GRAINS, lambda f: scale_radii(f, 1e3), ["grains.csv", "radius", "in metres"]),
    "nan": (TRACKS, lambda f: swap_row(f, 8, {2: "nan"}), ["row 8", "x = 'nan'"]),
    "hole": (TRACKS, lambda f: os.truncate(f, f.stat().st_size + (1 << 20)), ["no text", "hole"]),
    "not a number": (TRACKS, lambda f: swap_row(f, 9, {3: "left"}), ["row 9", "y = 'left'"]),
    "twice": (TRACKS, lambda f: swap_row(f, 4, {1: "1"}), ["row 4", "id = '1'", "twice"]),
    "unknown id": (TRACKS, lambda f: swap_row(f, 5, {1: "777"}), ["row 5", "777"]),
    "short row": (TRACKS, lambda f: edit(f, "0,1,", "0,1"), ["row 3", "cells"]),
    "late start": (TRACKS, lambda f: f.write_text(f.read_text().replace("\n0,", "\n9,")), ["frame 0"]),
    "far outside": (TRACKS, lambda f: swap_row(f, 6, {2: "5.0"}), ["wall", "grain 4", "mm beyond"]),
    "wall without length": (WALLS, lambda f: swap_row(f, 2, {2: "0", 3: "0", 4: "0", 5: "0"}), ["row 2", "no length"]),
    "wall missing": (WALLS, lambda f: drop_row(f, 7), ["frame 1", "no row of wall"]),
    "walls of fewer frames": (WALLS, lambda f: cut(f, 4 * 4 + 1), ["4 frames", "5 frames"]),
    "radius": (GRAINS, lambda f: swap_row(f, 3, {1: "0"}), ["row 3", "radius = '0'"]),
    "id twice": (GRAINS, lambda f: swap_row(f, 3, {0: "0"}), ["row 3", "twice"]),
    "time in nanoseconds": (TIMES, lambda f: swap_row(f, 6, {1: "1.5e18"}), ["row 6", "1.5e18", "9e+09 s"]),
    "time goes back": (TIMES, lambda f: swap_row(f, 4, {1: "0.5"}), ["row 4", "0.5"]),
    "truth unknown grain": ("truth_contacts.csv", lambda f: swap_row(f, 2, {1: "999"}), ["row 2", "999"]),
    "truth unknown wall": ("truth_contacts.csv", lambda f: swap_row(f, 2, {2: "roof"}), ["row 2", "roof"]),
    "table of 0 bytes": (TRACKS, lambda f: f.write_bytes(b""), ["tracks.csv: is empty"]),
    "experiment of 0 bytes": (TOML, lambda f: f.write_bytes(b""), ["experiment.toml: is empty"]),
    "times of one frame": (TIMES, lambda f: cut(f, 2), ["times of 1 frame, but there are 5 frames"]),
    "empty table": (GRAINS, lambda f: f.write_text("id,radius\n"), ["no rows"]),
}


def drop_row(file: Path, row: int) -> None:
    lines = file.read_text().splitlines()
    del lines[row - 1]
    file.write_text("\n".join(lines) + "\n")


def cut(file: Path, rows: int) -> None:
    file.write_text("\n".join(file.read_text().splitlines()[:rows]) + "\n")


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named_in_one_line(mistake, tracked, tmp_path, capsys):
    name, spoil, named = MISTAKES[mistake]
    spoil(tracked / name)
    message = refuse(capsys, tmp_path / "out", "run", str(tracked))
    for part in named:
        assert part in message, message
    assert Path(name).stem.split("_")[0] in message or mistake in ("far outside", "missing table")


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ("solver.kapa=1", "solver.kapa"),
        ("solver.kappa=-1", "solver.kappa"),
        ("nonsense", "KEY=VALUE"),
        ("name.deep=1", "name"),
    ],
)
def test_a_wrong_setting_is_named(setting, named, tracked, tmp_path, capsys):
    assert named in refuse(capsys, tmp_path / "out", "run", str(tracked), "--set", setting)


@pytest.mark.parametrize("frames", ["3:2", "0:99", "x:y", "5", "0:4:0", "0:4:1:1"])
def test_a_wrong_frame_range_is_named(frames, tracked, tmp_path, capsys):
    assert frames.split(":")[0] in refuse(capsys, tmp_path / "out", "run", str(tracked), "--frames", frames)


def test_a_missing_experiment_is_named(tmp_path, capsys):
    assert "no such file" in refuse(capsys, tmp_path / "out", "run", str(tmp_path / "nowhere"))


def test_bad_input_leaves_finished_results_unchanged(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    assert rodsight("solve", str(tracked), "--out", str(out), "--quiet", "--set", "solver.sweeps=5") == 0
    before = {file: file.read_bytes() for file in out.rglob("*") if file.is_file()}
    swap_row(tracked / TRACKS, 8, {2: "nan"})
    assert rodsight("run", str(tracked), "--out", str(out), "--quiet") == 2
    capsys.readouterr()
    assert before == {file: file.read_bytes() for file in out.rglob("*") if file.is_file()}


def test_an_experiment_without_walls_can_be_tracked_but_not_solved(tracked, tmp_path, capsys):
    edit(tracked / TOML, '[walls]\nfile = "walls.csv"\nforces = "wall_forces.csv"\n', "")
    edit(tracked / TOML, "[walls.top]\npressure = 50000.0\n", "")
    edit(tracked / TOML, 'truth = "truth_contacts.csv"\n', "")
    assert "walls" in refuse(capsys, tmp_path / "out", "run", str(tracked))
    assert rodsight("track", str(tracked), "--out", str(tmp_path / "out"), "--quiet") == 0


def test_walls_given_in_frame_0_alone_are_at_rest_and_named(tracked, capsys):
    experiment = load_experiment(tracked)
    moving = read_walls(experiment, 5)
    assert describe_walls_at_rest(experiment, 5) == []
    head, *rows = (tracked / WALLS).read_text().splitlines()
    for kept, still in ((rows[:4], moving.name), ([r for r in rows if r[0] == "0" or ",left," not in r], ("left",))):
        (tracked / WALLS).write_text("\n".join([head, *kept]) + "\n")
        found = read_walls(load_experiment(tracked), 5)
        for w, name in enumerate(found.name):
            first = name in still
            assert (found.endpoints[:, w] == moving.endpoints[: 1 if first else None, moving.name.index(name)]).all()
        assert rodsight("check", tracked, "--no-budget") == 0
        words = (
            f"walls.csv gives {', '.join(still)} in frame 0 alone: taken as at rest in all 5 frames, unless the rods "
            "that touch them show that they move."
        )
        assert words in " ".join(capsys.readouterr().out.split())
