"""Mistakes of a set-up are refused before they are written, or named with what to do."""

import shutil

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.workbench.setup.draft import Draft

BEGIN = {"folder": "my photographs/pictures", "suffix": ".jpg", "name": "mine"}


@pytest.fixture
def begun(visitor):
    return visitor, visitor.request("begin", **BEGIN)["at"]


def messages(described, step):
    return " ".join(next(each["messages"] for each in described["steps"] if each["name"] == step))


@pytest.mark.parametrize(
    ("endpoint", "values", "words"),
    [
        ("set_photographs", {"interval": -3.0}, "interval: value -3.0: must be greater than 0"),
        ("set_photographs", {"name": "a/b"}, "letters, digits, spaces"),
        ("set_photographs", {"region": [300, 10, 20, 40]}, "x0 < x1"),
        ("set_material", {"friction": 7.0}, "friction: value 7.0: must be less than or equal to 2"),
        ("set_material", {"density": 0.0}, "density"), ("set_scale", {"pixel_size": -1e-4}, "pixel_size"),
        ("set_scale", {"line": [[0.0, 0.0], [50.0, 0.0]], "metres": 0.0}, "metres"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_refused_in_words_and_not_written(begun, photographs_only, endpoint, values, words):
    visitor, at = begun
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    visitor.request("set_photographs", at=at, interval=30.0)
    file = photographs_only / "my photographs" / "experiment.toml"
    before = file.read_bytes()
    answer = visitor.refused(endpoint, at=at, **values)
    assert words in answer
    assert "literal[" not in answer
    assert file.read_bytes() == before
    assert visitor.request("project", at=at)["undo"] == "photographs"


@pytest.fixture
def walled(begun, made_photographs, photographs_only):
    """An experiment with rods, two bolts among them, and bars around the others."""
    visitor, at = begun
    folder = photographs_only / "my photographs"
    visitor.request("set_photographs", at=at, interval=30.0)
    visitor.request("set_scale", at=at, pixel_size=load_experiment(made_photographs).config.photographs.pixel_size)
    shutil.copy(made_photographs / "grains.csv", folder)
    Draft(folder).set_keys("rods", {"photographs.grains": "grains.csv"})
    visitor.request("find_walls", at=at)
    with (folder / "grains.csv").open("a") as stream:
        stream.write("900,12.0,14.0,9.0\n901,14.0,300.0,9.0\n")
    return visitor, at


@pytest.mark.thorough
def test_what_lies_outside_the_walls_is_dropped_at_once(walled):
    visitor, at = walled
    described = visitor.request("project", at=at)
    assert described["outside"] == [900, 901]
    assert "2 of 32 circles lie outside the walls" in messages(described, "rods")
    described = visitor.request("drop_outside", at=at)
    assert (len(described["rods"]["id"]), described["outside"]) == (30, [])
    assert "outside the walls" not in messages(described, "rods")
    assert len(visitor.request("undo", at=at)["rods"]["id"]) == 32


@pytest.mark.thorough
def test_circles_much_smaller_than_the_rods_are_named(walled):
    visitor, at = walled
    assert "2 of 32 circles have radii up to 2.2 mm" in messages(visitor.request("project", at=at), "rods")
    assert "have radii up to" not in messages(visitor.request("drop_outside", at=at), "rods")


@pytest.mark.thorough
@pytest.mark.parametrize(("factor", "word"), [(10.0, "large"), (0.1, "small")])
def test_a_scale_wrong_by_ten_is_named(walled, made_photographs, factor, word):
    visitor, at = walled
    section = load_experiment(made_photographs).config.photographs
    visitor.request("drop_outside", at=at)
    Draft(visitor.workbench.root / at).set_keys("radii", {"photographs.radii": list(section.radii)})
    assert "times too" not in messages(visitor.request("project", at=at), "scale")
    described = visitor.request("set_scale", at=at, pixel_size=factor * section.pixel_size)
    stated = messages(described, "scale")
    assert f"times too {word}" in stated
    ratio = float(stated.partition("looks ")[2].partition(" times")[0])
    assert np.log10(ratio) == pytest.approx(1.0, abs=0.1)


@pytest.mark.thorough
def test_no_rod_at_a_scale_wrong_by_ten_names_the_scale(begun, made_photographs):
    visitor, at = begun
    section = load_experiment(made_photographs).config.photographs
    visitor.request("set_scale", at=at, pixel_size=10.0 * section.pixel_size)
    answer = visitor.refused("detect_rods", at=at, radii=list(section.radii))
    assert "scale: looks 10 times too large" in answer


@pytest.mark.thorough
def test_a_masked_rod_is_not_detected(begun, made_photographs):
    visitor, at = begun
    section = load_experiment(made_photographs).config.photographs
    visitor.request("set_scale", at=at, pixel_size=section.pixel_size)
    visitor.request("set_photographs", at=at, interval=30.0)
    rods = visitor.request("detect_rods", at=at, radii=list(section.radii))["rods"]
    x, y, r = (rods[key][3] for key in ("x", "y", "r"))
    corners = [
        [x - 1.1 * r, y - 1.1 * r],
        [x + 1.1 * r, y - 1.1 * r],
        [x + 1.1 * r, y + 1.1 * r],
        [x - 1.1 * r, y + 1.1 * r],
    ]
    described = visitor.request("set_photographs", at=at, mask=[corners])
    assert len(described["photographs"]["mask"]) == 1
    rods = visitor.request("detect_rods", at=at, radii=list(section.radii))["rods"]
    assert np.hypot(np.array(rods["x"]) - x, np.array(rods["y"]) - y).min() > r
    assert "mask" not in visitor.request("set_photographs", at=at, mask=[])["photographs"]
    assert visitor.post("set_photographs", {"at": at, "mask": [corners[:2]]}).status_code == 400
