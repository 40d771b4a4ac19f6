"""CONF files in all their forms, corners and markers among their rows, and the way back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rodsight.cli.main import main
from rodsight.exchange.dic_files import read_sequence, write_sequence
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.experiment.units import Scale
from rodsight.experiment.walls import read_walls
from rodsight.process.errors import InputError
from rodsight.solver.bodies.wall_shapes import OUT, STRAIGHT, circle_ends
from rodsight.tracks import WallTracks

PIXEL, HEIGHT = 1.45e-4, 4032
RODS = np.array([[300.0, 300.0], [420.0, 310.0], [330.0, 420.0]])  # px, y down
R = np.array([48.0, 55.0, 76.0])
CORNERS = np.array([[900.0, 900.0], [900.0, 100.0], [100.0, 100.0], [100.0, 900.0]])  # as the program numbers them
MARKERS = [(50.0, 980.0, 2.1), (950.0, 980.0, 2.1), (20.0, 20.0, 2.2)]
TURN = 0.01  # [rad] of the rods from file to file


def table(k: int, *, markers: bool = True) -> list[tuple[float, float, float, float]]:
    """Rows x, y, rotation, radius of photograph k, corners first."""
    rows = [(x + 2 * k, y, 0.0, 1.0) for x, y in CORNERS]
    rows += [(x + k, y, TURN * k, r) for (x, y), r in zip(RODS, R, strict=True)]
    return rows + [(x, y, 0.0, r) for x, y, r in MARKERS if markers]


def write(folder: Path, lines_of) -> Path:
    folder.mkdir(exist_ok=True)
    for k in range(3):
        lines = [each if isinstance(each, str) else " ".join(f"{v:.8e}" for v in each) for each in lines_of(k)]
        (folder / f"CONF{k + 1:04d}").write_text("\n".join(lines) + "\n")
    return folder


def without_count(k: int):
    """Pixels, x y rotation radius, corners among the rows, no markers."""
    return table(k, markers=False)


def radius_third(k: int):
    """Pixels, the number of rows, x y radius rotation."""
    return [str(len(table(k))), *((x, y, r, a) for x, y, a, r in table(k))]


def metres(k: int):
    """Metres, y up from a marker, two correlations, corners in a section of their own."""
    scale = PIXEL * (1.0 + 1e-5 * k)  # found anew in every photograph
    rods = [
        (scale * (x + k - 20.0), -scale * (y - 20.0), scale * r, TURN * k, 0.9, 0.99)
        for (x, y), r in zip(RODS, R, strict=True)
    ]
    corners = [(scale * (x + 2 * k - 20.0), -scale * (y - 20.0)) for x, y in CORNERS]
    return [
        "    3", *rods, "0 - corners coordinates - countercloc", *corners,
        "1 - Associated macroscopic deformation Fxx,Fyy,Fxy,Fyx,Exx,Eyy,Exy,E", (0.0,) * 8,
        "2 - scale factor (meters/pixels)", f"{scale:.13e}",
    ]  # fmt: skip


def sections(k: int):
    """Pixels, x y rotation radius, corners and scale in sections with a #."""
    rods = [row for row in table(k) if row[3] > 3.0]
    corners = [row[:3] for row in table(k) if row[3] == 1.0]
    return ["3", *rods, "#CORNERS  The four corners", "4", *corners, "#FIX_PTS  The fix points", "0", "#SCALES_", "1"]


def imported(folder: Path, *options: str, capsys) -> tuple[Path, str]:
    out = folder.parent / f"{folder.name}_experiment"
    with pytest.raises(SystemExit) as end:
        main(["import", "dic", str(folder), str(out), *options])
    printed = capsys.readouterr()
    assert not end.value.code, printed.err
    return out, printed.out.replace("\n", " ")


@pytest.mark.parametrize("form", [without_count, radius_third, metres, sections])
def test_every_form_gives_the_same_experiment(form, tmp_path, capsys):
    folder = write(tmp_path / "conf", form)
    unit = [] if form is metres else ["--pixel-size", str(PIXEL), "--height", str(HEIGHT)]
    radius = 142.0 * (PIXEL if form is metres else 1.0)
    out, _ = imported(folder, *unit, "--corner-radius", str(radius), "--pressure", "top=5e4", capsys=capsys)
    experiment = load_experiment(out)
    tracks = read_tracks(experiment)
    walls = read_walls(experiment, 3)
    assert tracks.radius == pytest.approx(PIXEL * R, rel=1e-4)
    assert tracks.rotation[2] == pytest.approx(np.full(3, 2 * TURN), abs=1e-7)  # counter-clockwise as seen
    between = tracks.position[0, 1:] - tracks.position[0, 0]
    assert between == pytest.approx(PIXEL * np.array([[120.0, -10.0], [30.0, -120.0]]), rel=1e-6)
    assert walls.name[:4] == ("bottom", "right", "top", "left")
    assert walls.radius[0, 4:] == pytest.approx(142.0 * PIXEL)
    from_rod = walls.endpoints[0, 2] - tracks.position[0, 0]
    assert from_rod == pytest.approx(PIXEL * np.array([[600.0, 200.0], [-200.0, 200.0]]), rel=1e-6)
    named = dict(zip(walls.name[4:], walls.plate[4:].tolist(), strict=True))
    assert named == {"bottom_right": -1, "top_right": 2, "top_left": 2, "bottom_left": -1}


def test_markers_are_named_and_left_out(tmp_path, capsys):
    folder = write(tmp_path / "conf", radius_third)
    out, printed = imported(folder, "--pixel-size", str(PIXEL), capsys=capsys)
    assert "3 rows of radius 2.1 and 2.2 are no rod but a marker" in printed
    assert read_tracks(load_experiment(out)).grain_count == 3


def test_the_radius_of_corner_discs_is_proposed_where_it_is_not_given(tmp_path, capsys):
    folder = write(tmp_path / "conf", radius_third)
    out, printed = imported(folder, "--pixel-size", str(PIXEL), capsys=capsys)
    walls = read_walls(load_experiment(out), 3)
    touching = np.hypot(198.0, 200.0) - 48.0  # the corner moves by 4 px, the rod by 2 px
    assert walls.radius[0, 4] == pytest.approx(PIXEL * touching)
    assert "PROPOSED, NOT MEASURED" in printed
    assert "PROPOSED, NOT MEASURED" in (out / "experiment.toml").read_text()


def test_columns_that_can_both_be_the_radius_are_named(tmp_path):
    def ambiguous(k):
        return ["2", (100.0 + k, 100.0, 1.5, 1.2), (200.0, 100.0, 1.1, 1.4)]

    folder = write(tmp_path / "conf", ambiguous)
    with pytest.raises(InputError, match=r"both columns 3 and 4 can be the radius.*--columns radius=3"):
        read_sequence(folder)
    with pytest.raises(InputError, match="contains no grain"):
        read_sequence(folder, 3)


def test_rods_that_do_not_turn_have_their_radius_in_the_column_of_large_numbers(tmp_path):
    def still(k):
        return ["2", (100.0 + k, 100.0, 48.0, 0.3), (200.0, 100.0, 55.0, 0.2)]

    assert read_sequence(write(tmp_path / "conf", still)).radius.tolist() == [48.0, 55.0]


def test_radii_of_later_files_are_compared(tmp_path):
    def growing(k):
        return ["1", (100.0, 100.0, 0.1 * k, 48.0 + k)]

    with pytest.raises(InputError, match="CONF0002: row 2: radius 49, in CONF0001 it is 48"):
        read_sequence(write(tmp_path / "conf", growing), 4)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (["--pixel-size", "1e-4", "--columns", "x=1"], "x=1"),
        (["--pixel-size", "1e-4", "--walls", "box", "--corner-radius", "9"], "--walls box replaces them"),
        ([], "--pixel-size"),
        (["--pixel-size", "1e-4", "--pressure", "lid=5"], "the walls are bottom, right, top, left"),
    ],
)
def test_options_that_do_not_fit_are_refused(tmp_path, capsys, options, problem):
    folder = write(tmp_path / "conf", radius_third)
    with pytest.raises(SystemExit) as end:
        main(["import", "dic", str(folder), str(tmp_path / "out"), *options])
    assert end.value.code == 2
    assert problem in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_exported_corners_are_imported_again(results, tmp_path):
    tracks, f = results.tracks, results.tracks.frame_count
    centre = np.tile(PIXEL * np.array([[100.0, 100.0], [900.0, 100.0], [900.0, 900.0], [100.0, 900.0]]), (f, 1, 1))
    centre[:, 2:, 0] += 1e-4 * np.arange(f)[:, None]
    bars = np.stack([centre, np.roll(centre, -1, axis=1)], axis=2)
    discs = circle_ends(centre, np.full((f, 4), 0.01), np.tile(0.01 * np.arange(f)[:, None], (1, 4)))
    side = np.array([STRAIGHT] * 4 + [OUT] * 4, np.int8)
    names = ("a", "b", "c", "d", "e", "f", "g", "h")
    walls = WallTracks(names, np.concatenate([bars, discs], axis=1), np.full(8, np.nan), side=side)
    scale = Scale(PIXEL, HEIGHT)
    write_sequence(tracks, scale, tmp_path, walls)
    found = read_sequence(tmp_path)
    assert found.row.tolist() == list(range(tracks.grain_count))
    assert found.corners is not None
    assert np.stack([found.corners.x, found.corners.y], axis=-1) == pytest.approx(scale.to_pixels(centre))
    assert found.corners.rotation[-1] == pytest.approx(np.full(4, 0.01 * (f - 1)))
    without = write_sequence(tracks, scale, tmp_path, replace(walls, side=np.where(side == OUT, -side, side)))
    assert without[0].read_text().split("\n", 1)[0] == str(tracks.grain_count)


def test_a_measured_load_is_written_for_every_photograph(tmp_path, capsys):
    folder = write(tmp_path / "conf", without_count)
    options = ("--pixel-size", str(PIXEL), "--corner-radius", "60", "--load", "top=1438")
    out, _ = imported(folder, *options, capsys=capsys)
    walls = read_walls(load_experiment(out), 3)
    assert walls is not None
    assert walls.load is not None
    np.testing.assert_array_equal(walls.load[:, walls.name.index("top")], 1438.0)


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        (("--load", "lid=5"), "is not a wall"),
        (("--load", "top=-5"), "is negative"),
        (("--load", "top"), "is not WALL=N"),
        (("--load", "top=5", "--pressure", "top=5e4"), "has a pressure, too"),
    ],
)
def test_a_wrong_load_is_refused_in_one_line(tmp_path, capsys, given, problem):
    folder = write(tmp_path / "conf", without_count)
    with pytest.raises(SystemExit) as end:
        main(["import", "dic", str(folder), str(tmp_path / "out"), "--pixel-size", str(PIXEL), "--corner-radius", "60",
              *given])  # fmt: skip
    assert end.value.code == 2
    error = capsys.readouterr().err
    assert problem in error.replace("\n", " ")
    assert not (tmp_path / "out").exists()
