"""Rods that another program has found are read with their places and radii, and what is no rod is left out."""

import cv2
import numpy as np
import pytest
from rodsight.exchange.photographic.rod_readings import read_rods, rods_of_labels
from rodsight.process.errors import InputError

PLACES = {3: (40.3, 50.8, 12.0), 7: (80.0, 30.5, 15.5), 300: (120.6, 90.2, 9.5)}  # by label: x, y, radius [px]
SHAPE = (130, 160)


def labels() -> np.ndarray:
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    found = np.zeros(SHAPE, np.uint16)
    for label, (x, y, radius) in PLACES.items():
        found[np.hypot(column - x, row - y) < radius] = label
    return found


def assert_places(rods) -> None:
    for x, y, radius in PLACES.values():
        nearest = np.hypot(rods.x - x, rods.y - y).argmin()
        assert np.hypot(rods.x[nearest] - x, rods.y[nearest] - y) < 0.1
        assert abs(rods.radius[nearest] - radius) < 0.1


@pytest.mark.parametrize("name", ["labels.png", "labels.tif", "labels.npy"])
def test_every_region_of_a_label_image_is_a_rod(tmp_path, name):
    file = tmp_path / name
    if file.suffix == ".npy":
        np.save(file, labels().astype(np.int32))
    else:
        cv2.imwrite(str(file), labels())
    rods, remarks = read_rods(file, SHAPE)
    assert rods.id.tolist() == [3, 7, 300]
    assert not remarks
    assert_places(rods)


def test_specks_and_bars_are_left_out_and_counted():
    image = labels()
    image[2, 2:5] = 8
    image[120:124, 20:100] = 9
    rods, remarks = rods_of_labels(image)
    assert rods.id.tolist() == [3, 7, 300]
    assert [each.split()[:4] for each in remarks] == [["Left", "out:", "1", "region"]] * 2
    assert "pixels" in remarks[0]
    assert "without a round outline" in remarks[1]


def test_one_label_for_all_rods_is_refused(tmp_path):
    file = tmp_path / "mask.png"
    cv2.imwrite(str(file), np.where(labels() > 0, 255, 0).astype(np.uint8))
    with pytest.raises(InputError, match="has one label for all rods"):
        read_rods(file, SHAPE)


@pytest.mark.parametrize("form", ["area", "axes"])
def test_a_table_of_imagej_is_read_for_its_first_slice(tmp_path, form):
    file = tmp_path / "Results.csv"
    lines = [" ,Area,X,Y,Slice" if form == "area" else " ,X,Y,Major,Minor,Slice"]
    for slice_ in (1, 2):
        for k, (x, y, radius) in enumerate(PLACES.values()):
            place = f"{x + 0.5 + slice_ - 1},{y + 0.5}"
            size = f"{np.pi * radius**2},{place}" if form == "area" else f"{place},{2 * radius},{2 * radius}"
            lines.append(f"{k + 1},{size},{slice_}")
    file.write_text("\n".join(lines) + "\n")
    rods, remarks = read_rods(file, SHAPE)
    assert rods.id.tolist() == [0, 1, 2]
    assert_places(rods)
    assert remarks == ["Not used, since rods are followed: 3 rows of later slices."]


def test_what_holds_no_rods_of_these_photographs_is_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "small.png"), labels()[:50])
    with pytest.raises(InputError, match="is 160 x 50 pixels, the photographs are 160 x 130"):
        read_rods(tmp_path / "small.png", SHAPE)
    cv2.imwrite(str(tmp_path / "colour.png"), np.zeros((*SHAPE, 3), np.uint8))
    with pytest.raises(InputError, match="is no label image"):
        read_rods(tmp_path / "colour.png", SHAPE)
    cv2.imwrite(str(tmp_path / "empty.png"), np.zeros(SHAPE, np.uint8))
    with pytest.raises(InputError, match="holds no rods"):
        read_rods(tmp_path / "empty.png", SHAPE)
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="neither"):
        read_rods(tmp_path / "other.csv", SHAPE)
    (tmp_path / "metres.csv").write_text("id,x,y,radius\n1,2000,3,4\n")
    with pytest.raises(InputError, match="outside the photograph"):
        read_rods(tmp_path / "metres.csv", SHAPE)
