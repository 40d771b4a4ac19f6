"""The order of photographs, their places in time, what is left out, and how they are rotated."""

import io
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image
from rodsight.experiment.experiment import load_experiment, read_times
from rodsight.experiment.reading.camera_notes import camera_times, noted_rotation
from rodsight.experiment.reading.photograph_order import missing_numbers
from rodsight.process.errors import InputError
from rodsight.workbench.setup.draft import Draft

BEGIN = {"folder": "my photographs/pictures", "suffix": ".jpg", "name": "mine"}
NAMES = [f"pictures/DSC_{7 + 4 * k}.jpg" for k in range(4)]
TIMES = [0.0, 30.0, 60.0, 90.0]


@pytest.fixture
def begun(visitor, photographs_only):
    """A visitor, where the experiment is, and its folder."""
    at = visitor.request("begin", **BEGIN)["at"]
    visitor.request("set_photographs", at=at, interval=30.0)
    visitor.request("set_scale", at=at, pixel_size=1e-4)
    return visitor, at, photographs_only / "my photographs"


def as_used(folder: Path) -> tuple[list[str], list[float]]:
    """Names and times of the photographs as a run takes them."""
    experiment = load_experiment(folder)
    files = experiment.photographs().files
    return [f"pictures/{file.name}" for file in files], read_times(experiment, len(files)).tolist()


def messages(described, step="photographs"):
    return " ".join(next(each["messages"] for each in described["steps"] if each["name"] == step))


def test_a_photograph_that_is_left_out_changes_no_time_of_the_others(begun):
    visitor, at, folder = begun
    described = visitor.request("set_order", at=at, files=[NAMES[0], *NAMES[2:]])
    assert described["series"]["left_out"] == [NAMES[1]]
    assert as_used(folder) == ([NAMES[0], *NAMES[2:]], [0.0, 60.0, 90.0])
    described = visitor.request("set_order", at=at, files=NAMES)
    assert "order" not in described["photographs"]
    assert not (folder / "order.csv").exists()
    assert as_used(folder) == (NAMES, TIMES)


def test_a_new_order_takes_the_same_places_in_time(begun):
    visitor, at, folder = begun
    order = [NAMES[0], NAMES[2], NAMES[1], NAMES[3]]
    visitor.request("set_order", at=at, files=order)
    assert as_used(folder) == (order, TIMES)
    assert visitor.request("project", at=at)["files"] == [name.split("/")[1] for name in order]
    visitor.request("undo", at=at)
    assert as_used(folder) == (NAMES, TIMES)


def test_a_window_that_shows_another_order_edits_nothing(begun):
    visitor, at, folder = begun
    names = visitor.request("project", at=at)["series"]["names"]
    visitor.request("set_order", at=at, files=[*names[:1], *names[2:]], change="left out", photograph=[1, names[1]])
    content = (folder / "experiment.toml").read_bytes()
    refusal = visitor.refused("set_photographs", at=at, interval=20.0, photograph=[1, names[1]])
    assert "photograph 1: is another one by now" in refusal
    assert (folder / "experiment.toml").read_bytes() == content
    visitor.request("set_photographs", at=at, interval=20.0, photograph=[1, names[2]])
    visitor.request("undo", at=at, photograph=[1, names[1]])


def test_strokes_of_the_brush_are_added_to_the_mask_and_taken_back(begun):
    visitor, at, folder = begun
    for count, x in enumerate((40.0, 120.0), 1):
        visitor.request("brush_mask", at=at, points=[[x, 50.0], [x + 10.0, 60.0]], radius=5.0)
        mask = tomllib.loads((folder / "experiment.toml").read_text())["photographs"]["mask"]
        assert len(mask) == count
        first, *_ = mask[-1]
        assert abs(first[0] - x) <= 16.0
    visitor.request("undo", at=at)
    assert len(tomllib.loads((folder / "experiment.toml").read_text())["photographs"]["mask"]) == 1


def test_tables_go_with_the_photographs(begun):
    visitor, at, folder = begun
    (folder / "corrections.csv").write_text("frame,id,x,y,theta\n1,5,10.0,20.0,\n3,6,30.0,40.0,lost\n")
    (folder / "times.csv").write_text("frame,time\n0,0.0\n1,10.0\n2,30.0\n3,60.0\n")
    Draft(folder).set_keys("tables", {
        "photographs.corrections": "corrections.csv", "photographs.times": "times.csv", "photographs.interval": None,
    })  # fmt: skip
    visitor.request("project", at=at)
    visitor.request("set_order", at=at, files=[NAMES[0], NAMES[1], NAMES[3]])
    assert (folder / "corrections.csv").read_text().split() == [
        "frame,id,x,y,theta", "1,5,10.0,20.0,", "2,6,30.0,40.0,lost",
    ]  # fmt: skip
    assert as_used(folder)[1] == [0.0, 10.0, 60.0]


def test_the_first_photograph_stays_where_rods_are_marked_on_it(begun, made_photographs):
    visitor, at, folder = begun
    (folder / "grains.csv").write_bytes((made_photographs / "grains.csv").read_bytes())
    Draft(folder).set_keys("rods", {"photographs.grains": "grains.csv", "photographs.pixel_size": 2.5e-4})
    visitor.request("project", at=at)
    assert "stays the first photograph" in visitor.refused("set_order", at=at, files=NAMES[1:])
    assert "is unknown, or stands twice" in visitor.refused("set_order", at=at, files=[*NAMES, "pictures/other.jpg"])
    assert "is unknown, or stands twice" in visitor.refused("set_order", at=at, files=[*NAMES, NAMES[0]])


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda content: content[: len(content) // 2], "is cut short"),
        (lambda _: b"no picture", "is not a photograph"),
        (lambda _: b"", "is an empty file"),
        (lambda _: cv2.imencode(".jpg", np.zeros((9, 12), np.uint8))[1].tobytes(), "is 12 x 9 pixels"),
    ],
)  # fmt: skip
def test_photographs_that_cannot_be_used_are_named_and_left_out(begun, damage, words):
    visitor, at, folder = begun
    file = folder / NAMES[2]
    file.write_bytes(damage(file.read_bytes()))
    described = visitor.request("project", at=at)
    assert f"Photograph 2, DSC_15.jpg, {words}" in messages(described)
    assert described["steps"][0]["mark"] == "missing"
    assert described["series"]["unusable"] == [2]
    described = visitor.request("set_order", at=at, files=[*NAMES[:2], NAMES[3]])
    assert described["series"]["unusable"] == []
    assert "Photograph 2" not in messages(described)


def test_numbers_that_are_missing_are_stated_and_can_give_the_times(begun):
    visitor, at, folder = begun
    for k in (23, 31):
        (folder / f"pictures/DSC_{k}.jpg").write_bytes((folder / NAMES[0]).read_bytes())
    described = visitor.request("project", at=at)
    assert "A number is missing between DSC_23.jpg and DSC_31.jpg" in messages(described)
    described = visitor.request("number_by_names", at=at)
    assert described["series"]["number"] == [0, 1, 2, 3, 4, 6]
    assert "missing" not in messages(described)
    assert as_used(folder)[1] == [0.0, 30.0, 60.0, 90.0, 120.0, 180.0]


@pytest.mark.parametrize(
    ("names", "count"),
    [
        (("P3", "P6", "P9", "P15", "P18"), 1), (("P3", "P6", "P9"), 0), (("a", "b", "c", "d"), 0),
        (("P9", "P1", "P8", "P30", "P2"), 0), (("t001_a", "t004_a", "t007_a", "t019_a"), 3),
    ],
)  # fmt: skip
def test_missing_numbers(names, count):
    assert sum(each.count for each in missing_numbers([Path(f"{name}.png") for name in names])) == count


def with_notes(file: Path, seconds: int, orientation: int = 1) -> None:
    """Store a camera's notes in a photograph."""
    notes = Image.Exif()
    notes[0x0112] = orientation
    notes.get_ifd(0x8769).update({0x9003: f"2024:05:06 10:{seconds // 60:02d}:{seconds % 60:02d}", 0x9291: "5"})
    with Image.open(io.BytesIO(file.read_bytes())) as picture:
        picture.save(file, exif=notes, quality=95)


def test_order_and_times_of_the_cameras_clock(begun):
    visitor, at, folder = begun
    for name, seconds in zip(NAMES, (0, 61, 31, 92), strict=True):
        with_notes(folder / name, seconds)
    assert camera_times([folder / name for name in NAMES]).tolist() == [0.0, 61.0, 31.0, 92.0]
    described = visitor.request("project", at=at)
    assert described["series"]["clock"]
    assert "DSC_15.jpg was taken before DSC_11.jpg" in messages(described)
    described = visitor.request("use_camera_times", at=at)
    assert "was taken before" not in messages(described)
    assert as_used(folder) == ([NAMES[0], NAMES[2], NAMES[1], NAMES[3]], [0.0, 31.0, 61.0, 92.0])
    with_notes(folder / NAMES[1], 31)
    assert "the camera's clock is too coarse" in visitor.refused("use_camera_times", at=at)


def test_an_interval_that_the_clock_contradicts_is_stated(begun):
    visitor, at, folder = begun
    for k, name in enumerate(NAMES):
        with_notes(folder / name, 300 * k)
    assert "there are 300 s between photographs, not 30 s" in messages(visitor.request("project", at=at))


def test_how_the_camera_was_held_is_stated_and_used_only_on_request(begun):
    visitor, at, folder = begun
    for k, name in enumerate(NAMES):
        with_notes(folder / name, 30 * k, orientation=6)
    assert noted_rotation([folder / name for name in NAMES]) == 90
    described = visitor.request("project", at=at)
    wide, high = described["width"], described["height"]
    assert "stand upright when rotated by 90° clockwise" in messages(described)
    described = visitor.request("rotate", at=at, rotation=90)
    assert (described["width"], described["height"]) == (high, wide)
    assert "upright" not in messages(described)
    with_notes(folder / NAMES[1], 30, orientation=8)
    assert "notes on how it was held differ" in messages(visitor.request("project", at=at))


@pytest.mark.thorough
def test_everything_that_is_drawn_goes_with_a_rotation(begun, made_photographs):
    visitor, at, folder = begun
    (folder / "grains.csv").write_bytes((made_photographs / "grains.csv").read_bytes())
    Draft(folder).set_keys("rods", {
        "photographs.grains": "grains.csv", "photographs.mask": [[[10.0, 20.0], [40.0, 20.0], [40.0, 60.0]]],
        "photographs.pixel_size": None,
        "photographs.distance": {"start": [20.0, 30.0], "end": [120.0, 30.0], "metres": 0.025},
        "photographs.region": [5, 6, 300, 290],
    })  # fmt: skip
    visitor.request("find_walls", at=at)
    start = visitor.request("project", at=at)
    before = load_experiment(folder).photographs()[0]
    turned = visitor.request("rotate", at=at, rotation=90)
    rows = before.shape[0]
    np.testing.assert_allclose(turned["rods"]["x"], rows - 1 - np.array(start["rods"]["y"]), atol=0.02)
    np.testing.assert_allclose(turned["rods"]["y"], start["rods"]["x"], atol=0.02)
    assert turned["pixel"] == pytest.approx(start["pixel"])
    for one, other in zip(start["walls"], turned["walls"], strict=True):
        ends = np.array(one["line"])
        np.testing.assert_allclose(other["line"], np.column_stack([rows - 1 - ends[:, 1], ends[:, 0]]), atol=0.05)
    assert turned["photographs"]["mask"] == [[[rows - 21, 10], [rows - 21, 40], [rows - 61, 40]]]
    same = load_experiment(folder).photographs()[0] == np.rot90(before, -1)
    assert same.mean() > 0.9999  # all but pixels on a slanted edge of the mask
    for angle in (180, 270, 0):
        last = visitor.request("rotate", at=at, rotation=angle)
    np.testing.assert_allclose(last["rods"]["x"], start["rods"]["x"], atol=0.02)
    np.testing.assert_allclose(last["walls"][0]["line"], start["walls"][0]["line"], atol=0.05)
    assert last["photographs"]["region"] == [5, 6, 300, 290]


def test_a_table_of_the_order_is_checked(begun):
    _, _, folder = begun
    for rows, words in (
        ("pictures/none.jpg,0\n", "is not one of the photographs"),
        (f"{NAMES[0]},0\n{NAMES[0]},1\n", "stands twice"),
        (f"{NAMES[0]},3\n{NAMES[1]},3\n", "is not greater than"),
    ):
        (folder / "order.csv").write_text(f"file,number\n{rows}")
        Draft(folder).set_keys("order", {"photographs.order": "order.csv", "photographs.pixel_size": 1e-4})
        with pytest.raises(InputError, match=words):
            load_experiment(folder).photographs()
