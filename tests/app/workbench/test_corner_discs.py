"""Discs in the corners of a frame are made of drawn circles, and have a table of their own."""

import shutil

import numpy as np
import pytest
from rodsight.experiment.reading.tables import read_table
from rodsight.synthetic.synthesis import SynthesisSettings, synthesize
from rodsight.workbench.service.workbench import Workbench
from rodsight.workbench.setup import found_walls
from rodsight.workbench.setup.draft import Draft
from rodsight.workbench.setup.validation import validate
from rodsight.workbench.setup.walls import circles

from tests.app.workbench.conftest import Visitor


@pytest.fixture
def framed(visitor):
    (series,) = visitor.request("home")["series"]
    at = visitor.request("begin", **{key: series[key] for key in ("folder", "suffix", "name")})["at"]
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    for line in ([[20.0, 380.0], [300.0, 380.0]], [[300.0, 380.0], [300.0, 20.0]], [[20.0, 20.0], [20.0, 380.0]]):
        visitor.request("draw_wall", at=at, line=line, snap=False)
    return visitor, at


def _disc(visitor, at, x):
    described = visitor.request("draw_circle", at=at, place=[x, 380.0, 40.0], side="out")
    visitor.request("make_corner", at=at, name=described["wall"])
    return described["wall"]


def test_a_circle_becomes_a_disc_of_the_frame_and_leaves_the_table_of_arcs(framed, photographs_only):
    visitor, at = framed
    folder = photographs_only / "my photographs"
    first, second = _disc(visitor, at, 20.0), _disc(visitor, at, 300.0)
    assert read_table(folder / "corners.csv", ("corner",)).text("corner") == [first, second]
    assert not (folder / "arcs.csv").exists()
    walls = visitor.request("set_photographs", at=at, interval=30.0)["walls"]
    assert [wall["name"] for wall in walls if wall["corner"]] == [first, second]
    assert [wall["circle"]["radius"] for wall in walls if wall["corner"]] == pytest.approx([40.0, 40.0])


def test_a_circle_beside_corner_discs_is_the_only_arc(framed, photographs_only):
    visitor, at = framed
    disc = _disc(visitor, at, 20.0)
    circle = visitor.request("draw_circle", at=at, place=[160.0, 160.0, 30.0], side="out")["wall"]
    folder = photographs_only / "my photographs"
    assert read_table(folder / "arcs.csv", ("wall",)).text("wall") == [circle]
    visitor.request("delete_wall", at=at, name=circle)
    assert "corners" in Draft(folder).data()["walls"]
    visitor.request("delete_wall", at=at, name=disc)
    assert "corners" not in Draft(folder).data()["walls"]
    assert not (folder / "corners.csv").exists()


def test_another_scale_moves_corner_discs_with_their_picture(framed):
    visitor, at = framed
    disc = _disc(visitor, at, 20.0)
    walls = visitor.request("set_scale", at=at, pixel_size=5e-4)["walls"]
    (circle,) = [wall["circle"] for wall in walls if wall["name"] == disc]
    assert (circle["x"], circle["y"], circle["radius"]) == pytest.approx((20.0, 380.0, 40.0))


def test_corner_discs_turn_with_the_photographs(framed):
    visitor, at = framed
    disc = _disc(visitor, at, 20.0)
    before = {wall["name"]: wall for wall in visitor.request("set_photographs", at=at, interval=30.0)["walls"]}
    after = {wall["name"]: wall for wall in visitor.request("rotate", at=at, rotation=180)["walls"]}
    (x, y), old = (20.0, 380.0), before[disc]["circle"]
    new = after[disc]["circle"]
    line, turned = (next(each[name]["line"] for name in each if not each[name]["circle"]) for each in (before, after))
    columns, rows = line[0][0] + turned[0][0], line[0][1] + turned[0][1]  # of the photograph, less one
    assert (old["x"], old["y"]) == pytest.approx((x, y))
    assert (new["x"], new["y"], new["radius"]) == pytest.approx((columns - x, rows - y, 40.0))


def test_a_corner_needs_the_bars_that_meet_there(visitor):
    (series,) = visitor.request("home")["series"]
    at = visitor.request("begin", **{key: series[key] for key in ("folder", "suffix", "name")})["at"]
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    circle = visitor.request("draw_circle", at=at, place=[160.0, 160.0, 30.0], side="out")["wall"]
    with pytest.raises(Exception, match="draw them first"):
        visitor.request("make_corner", at=at, name=circle)


@pytest.fixture
def apparatus(tmp_path):
    """The photograph of a frame with discs in its corners, and the true discs (x, y, radius) [m] by their names."""
    made = synthesize(tmp_path / "made", SynthesisSettings(preset="1g2e", seed=2, grains=60, frames=1))
    (tmp_path / "mine" / "pictures").mkdir(parents=True)
    for file in (made.folder / "photos").iterdir():
        shutil.copy(file, tmp_path / "mine" / "pictures")
    table = read_table(made.folder / "corners.csv", ("corner", "x", "y", "radius"))
    rows = np.column_stack([table.numbers(name) for name in ("x", "y", "radius")])
    visitor = Visitor(Workbench(tmp_path / "mine")).enter()
    (series,) = visitor.request("home")["series"]
    at = visitor.request("begin", **{key: series[key] for key in ("folder", "suffix", "name")})["at"]
    visitor.request("set_scale", at=at, pixel_size=1.45e-4)
    visitor.request("detect_rods", at=at, radii=[0.00686, 0.00784, 0.01078])
    return visitor, at, dict(zip(table.text("corner"), rows, strict=True))


@pytest.mark.slow
def test_discs_in_the_corners_are_found_with_the_bars_or_by_a_click(apparatus, tmp_path):
    visitor, at, true = apparatus
    described = visitor.request("find_walls", at=at)
    assert (described["bars"], described["discs"]) == (4, 4)
    discs = {wall["name"]: wall["circle"] for wall in described["walls"] if wall["corner"]}
    (file,) = (tmp_path / "mine").rglob("corners.csv")

    def written():
        table = read_table(file, ("corner", "x", "y", "radius"))
        rows = np.column_stack([table.numbers(name) for name in ("x", "y", "radius")])
        return dict(zip(table.text("corner"), rows, strict=True))

    assert "file" not in Draft(file.parent).data()["walls"]  # the bars run through the centres
    assert discs.keys() == true.keys()
    for name, row in written().items():
        np.testing.assert_allclose(row, true[name], atol=2.5e-5)  # [m], a sixth of a pixel
    disc = discs["top-left"]
    bars = {wall["name"]: wall["line"] for wall in described["walls"] if not wall["circle"]}
    left = visitor.request("delete_wall", at=at, name="top-left")
    for name, line in bars.items():  # they stay where they were, without the disc
        np.testing.assert_allclose(
            next(wall["line"] for wall in left["walls"] if wall["name"] == name), line, atol=0.01
        )
    click = {"x": disc["x"] - 0.5 * disc["radius"], "y": disc["y"] + 0.4 * disc["radius"]}
    rods = len(left["rods"]["id"])
    added = visitor.request("add_rod", at=at, x=disc["x"], y=disc["y"], radius=50.0)
    assert len(added["rods"]["id"]) == rods + 1
    found = visitor.request("find_corner", at=at, **click)
    assert found["wall"] == "top-left"
    assert len(found["rods"]["id"]) == rods  # a circle on the disc is no rod
    np.testing.assert_allclose(written()["top-left"], true["top-left"], atol=2.5e-5)
    assert "has a disc already" in visitor.refused("find_corner", at=at, **click)
    beside = {"x": disc["x"] + 2.5 * disc["radius"], "y": disc["y"] - 1.5 * disc["radius"]}
    assert "no disc with a visible rim" in visitor.refused("find_corner", at=at, **beside)


FRAME = [np.array(ends, float) for ends in (
    ((20, 380), (300, 380)), ((300, 380), (300, 20)), ((300, 20), (20, 20)), ((20, 20), (20, 380)),
)]  # fmt: skip


def test_discs_are_looked_for_between_the_bars_just_found_and_take_the_circles_on_them_away(visitor, monkeypatch):
    (series,) = visitor.request("home")["series"]
    at = visitor.request("begin", **{key: series[key] for key in ("folder", "suffix", "name")})["at"]
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    for x, y in ((20, 380), (100, 200), (300, 380), (150, 200)):
        rods = visitor.request("add_rod", at=at, x=x, y=y, radius=15.0)["rods"]
    looked = []
    discs = [
        circles.Circle("first", 20.0, 381.0, 15.0, side="out"),
        circles.Circle("second", 301.0, 380.0, 15.0, "out"),
    ]

    def find_corners(image, found):
        looked.append(len(circles.bars_of(found)))
        return discs

    monkeypatch.setattr(found_walls.bars, "find_walls", lambda image, found: FRAME)
    monkeypatch.setattr(found_walls.circles, "find_corners", find_corners)
    described = visitor.request("find_walls", at=at)
    assert looked == [4]
    assert (described["bars"], described["discs"]) == (4, 2)
    assert [wall["name"] for wall in described["walls"] if wall["corner"]] == ["first", "second"]
    left = described["rods"]
    assert left["id"] == [rods["id"][1], rods["id"][3]]
    assert left["x"] == [rods["x"][1], rods["x"][3]]
    assert left["r"] == [rods["r"][1], rods["r"][3]]
    back = visitor.request("undo", at=at)
    assert (back["rods"]["id"], back["walls"]) == (rods["id"], [])


def test_no_bar_is_found_where_the_picture_ends_within_the_packing(visitor, monkeypatch):
    (series,) = visitor.request("home")["series"]
    at = visitor.request("begin", **{key: series[key] for key in ("folder", "suffix", "name")})["at"]
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    visitor.request("add_rod", at=at, x=100, y=200, radius=15.0)
    beyond = [FRAME[0], FRAME[1], FRAME[2], FRAME[3] - (22.0, 0.0)]
    monkeypatch.setattr(found_walls.bars, "find_walls", lambda image, found: beyond)
    monkeypatch.setattr(found_walls.circles, "find_corners", lambda image, found: [])
    described = visitor.request("find_walls", at=at)
    assert described["bars"] == 3
    assert [wall["name"] for wall in described["walls"]] == ["bottom", "right", "top"]


def test_only_ends_of_two_bars_that_meet_hold_a_disc_without_a_name_in_the_table(framed, monkeypatch):
    visitor, at = framed
    found = validate(Draft(visitor.workbench.root / at))
    places = []
    monkeypatch.setattr(circles, "find_disc", lambda _, place, within: places.append(place) or (*place, 20.0))
    corners = circles.find_corners(np.zeros((400, 400), np.float32), found)
    assert sorted(places) == sorted((each.x, each.y) for each in corners)
    np.testing.assert_allclose(sorted(places), [(20.0, 380.0), (300.0, 380.0)])
    monkeypatch.setattr(circles, "corner_names", lambda _: {corners[0].name})
    assert [each.name for each in circles.find_corners(np.zeros((400, 400), np.float32), found)] == [corners[1].name]


@pytest.mark.slow
def test_a_frame_without_discs_has_bars_alone(visitor, photographs_only):
    (series,) = visitor.request("home")["series"]
    at = visitor.request("begin", **{key: series[key] for key in ("folder", "suffix", "name")})["at"]
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    visitor.request("detect_rods", at=at, radii=[0.007, 0.008, 0.011])
    described = visitor.request("find_walls", at=at)
    assert (described["bars"], described["discs"]) == (4, 0)
    assert not (photographs_only / "my photographs" / "corners.csv").exists()
