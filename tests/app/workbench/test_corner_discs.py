"""Discs in the corners of a frame are made of drawn circles, and have a table of their own."""

import pytest
from rodsight.experiment.reading.tables import read_table
from rodsight.workbench.setup.draft import Draft


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
