"""Conversion of pixels to metres and back, with and without a lens, compared with OpenCV's functions and by hand."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from rodsight.experiment.config.experiment_file import load_config
from rodsight.experiment.lens import BrownLens, OpenCVLens, invert
from rodsight.experiment.scaling import make_scale
from rodsight.experiment.units import Scale, pixel_size_between
from rodsight.process.errors import InputError

EXACT = 1e-6  # [px] Newton's method ends below it; OpenCV's iteration does at about this
HEIGHT = 1000

OPENCV = OpenCVLens(fx=1500.0, fy=1480.0, cx=655.0, cy=490.0, k1=-0.21, k2=0.08, p1=6e-4, p2=-4e-4, k3=-0.01)
BROWN = BrownLens(xc=650.0, yc=500.0, K1=8e-8, K2=-2e-14, K3=1e-20, P1=3e-7, P2=-2e-7, P3=1e-7)


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    generator = np.random.default_rng(0)
    return generator.uniform([0.0, 0.0], [1300.0, 1000.0], (200, 2))


def matrix(lens: OpenCVLens) -> tuple[np.ndarray, np.ndarray]:
    camera = np.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]])
    return camera, np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])


def test_distortion_is_that_of_opencv(points: np.ndarray) -> None:
    camera, coefficients = matrix(OPENCV)
    rays = np.column_stack(
        [(points[:, 0] - OPENCV.cx) / OPENCV.fx, (points[:, 1] - OPENCV.cy) / OPENCV.fy, np.ones(200)]
    )
    expected, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), camera, coefficients)
    assert np.abs(OPENCV.distort(points) - expected[:, 0]).max() < EXACT
    assert np.abs(OPENCV.distort(points) - points).max() > 10.0


def test_undistortion_is_that_of_opencv(points: np.ndarray) -> None:
    camera, coefficients = matrix(OPENCV)
    bent = OPENCV.distort(points)
    ends = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    expected = cv2.undistortImagePoints(bent[:, None], camera, coefficients, arg1=ends)[:, 0]
    assert np.abs(OPENCV.undistort(bent) - expected).max() < EXACT


def test_browns_model_is_written_from_the_photograph_to_the_undistorted_picture() -> None:
    # By hand at dx = 100, dy = 200: r² = 5e4.
    lens = BrownLens(xc=10.0, yc=20.0, K1=1e-7, K2=2e-13, K3=4e-19, P1=1e-6, P2=2e-6, P3=1e-6)
    radial = 1e-7 * 5e4 + 2e-13 * 25e8 + 4e-19 * 125e12
    rest = 1.0 + 1e-6 * 5e4
    x = 110.0 + 100.0 * radial + (1e-6 * (5e4 + 2e4) + 2 * 2e-6 * 2e4) * rest
    y = 220.0 + 200.0 * radial + (2e-6 * (5e4 + 8e4) + 2 * 1e-6 * 2e4) * rest
    assert lens.undistort(np.array([110.0, 220.0])) == pytest.approx([x, y], abs=1e-12)


@pytest.mark.parametrize("lens", [OPENCV, BROWN, None])
@pytest.mark.parametrize("tall", [None, 2.6e-4])
def test_conversion_to_metres_and_back_is_the_identity(
    points: np.ndarray, lens: OpenCVLens | BrownLens | None, tall: float | None
) -> None:
    scale = Scale(2.5e-4, HEIGHT, tall, lens)
    assert np.abs(scale.to_pixels(scale.to_world(points)) - points).max() < EXACT


def test_points_without_position_stay_nan() -> None:
    scale = Scale(2.5e-4, HEIGHT, None, OPENCV)
    world = scale.to_world(np.array([[np.nan, np.nan], [600.0, 500.0]]))
    assert np.isnan(world[0]).all()
    assert np.isfinite(world[1]).all()


def test_a_point_outside_the_range_of_the_lens_model_is_nan() -> None:
    barrel = OpenCVLens(fx=500.0, fy=500.0, cx=0.0, cy=0.0, k1=-0.5)
    # x (1 − x²/2) has its maximum .544 at x = .816: nothing is seen farther out than 272 px.
    assert np.isnan(barrel.undistort(np.array([[300.0, 0.0]]))).all()
    assert np.isfinite(barrel.undistort(np.array([[200.0, 0.0]]))).all()


def test_pixels_may_differ_in_width_and_height() -> None:
    scale = Scale(2e-4, 11, 3e-4)
    assert scale.to_world(np.array([5.0, 0.0])) == pytest.approx([1e-3, 3e-3])
    assert scale.size_at(np.zeros((1, 2))) == pytest.approx([np.sqrt(6e-8)])


def test_size_of_a_pixel_follows_the_lens() -> None:
    scale = Scale(1e-4, HEIGHT, None, OPENCV)
    point = np.array([[200.0, 150.0]])
    square = point + np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) - 0.5
    x, y = scale.to_world(square).T
    area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
    assert scale.size_at(point)[0] == pytest.approx(np.sqrt(area), rel=1e-6)
    assert scale.size_at(point)[0] > 1.02e-4


def test_two_points_of_known_distance_give_the_pixel_size() -> None:
    assert pixel_size_between(np.array([10.0, 20.0]), np.array([310.0, 420.0]), 0.1) == pytest.approx(2e-4)
    lens = OPENCV
    ends = lens.distort(np.array([[100.0, 100.0], [1100.0, 100.0]]))
    assert pixel_size_between(ends[0], ends[1], 0.25, lens) == pytest.approx(2.5e-4)


def test_inversion_of_no_points_returns_no_points() -> None:
    assert invert(lambda p: p, np.empty((0, 2))).shape == (0, 2)


PHOTOGRAPHS = 'name = "a"\n[photographs]\nfiles = "*.png"\ninterval = 1.0\n'


@pytest.mark.parametrize(
    ("text", "sides"),
    [
        ("pixel_size = 2e-4", (2e-4, 2e-4)),
        ("pixel_size = [2e-4, 3e-4]", (2e-4, 3e-4)),
        ("distance = { start = [0, 0], end = [300, 400], metres = 0.1 }", (2e-4, 2e-4)),
    ],
)
def test_the_scale_may_be_given_in_three_ways(tmp_path: Path, text: str, sides: tuple[float, float]) -> None:
    file = tmp_path / "experiment.toml"
    file.write_text(PHOTOGRAPHS + text)
    section = load_config(file).photographs
    assert section is not None
    assert make_scale(section, HEIGHT).sides == pytest.approx(sides)


@pytest.mark.parametrize(
    ("text", "lens"),
    [
        (
            "fx = 1500\nfy = 1480\ncx = 655\ncy = 490\nk1 = -0.21\np2 = 1e-4",
            OpenCVLens(1500, 1480, 655, 490, -0.21, p2=1e-4),
        ),
        ("fx = 1500\ncx = 655\ncy = 490\nk3 = 0.1", OpenCVLens(1500, 1500, 655, 490, k3=0.1)),
        ("xc = 650\nyc = 500\nK1 = 1e-8\nP3 = 1e-9", BrownLens(650, 500, K1=1e-8, P3=1e-9)),
    ],
)
def test_both_lens_models_are_read(tmp_path: Path, text: str, lens: OpenCVLens | BrownLens) -> None:
    file = tmp_path / "experiment.toml"
    file.write_text(PHOTOGRAPHS + "pixel_size = 2e-4\n[photographs.lens]\n" + text)
    section = load_config(file).photographs
    assert section is not None
    assert make_scale(section, HEIGHT).lens == lens


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", ["photographs", "pixel_size", "missing"]),
        ("pixel_size = 0", ["photographs.pixel_size", "0"]),
        ("pixel_size = [1e-4, -1e-4]", ["photographs.pixel_size", "-0.0001"]),
        ("pixel_size = [1e-4, 1e-4, 1e-4]", ["photographs.pixel_size", "along rows"]),
        ("pixel_size = nan", ["photographs.pixel_size", "nan"]),
        ("pixel_size = true", ["photographs.pixel_size", "True"]),
        (
            "pixel_size = 1e-4\ndistance = { start = [0, 0], end = [1, 0], metres = 1 }",
            ["either pixel_size or distance"],
        ),
        (
            "distance = { start = [3, 4], end = [3, 4], metres = 1 }",
            ["photographs.distance", "[3.0, 4.0]", "same point"],
        ),
        ("distance = { start = [3, 4], end = [3, 5], metres = 0 }", ["photographs.distance.metres", "0"]),
        ("pixel_size = 1e-4\nlens = { k1 = 0.1 }", ["photographs.lens", "fx is missing"]),
        ("pixel_size = 1e-4\nlens = { fx = 9, cx = 1, cy = 1, K1 = 0.1 }", ["photographs.lens", "fx", "K1"]),
        ("pixel_size = 1e-4\nlens = { xc = 9, K1 = 0.1 }", ["photographs.lens", "yc is missing"]),
        ("pixel_size = 1e-4\nlens = { k7 = 0.1 }", ["photographs.lens.k7", "not known"]),
        ("pixel_size = 1e-4\nlens = { fx = inf, cx = 1, cy = 1 }", ["photographs.lens.fx", "inf"]),
    ],
)
def test_a_wrong_scale_is_named(tmp_path: Path, text: str, named: list[str]) -> None:
    file = tmp_path / "experiment.toml"
    file.write_text(PHOTOGRAPHS + text)
    with pytest.raises(InputError) as refused:
        load_config(file)
    for part in ["experiment.toml", *named]:
        assert part in str(refused.value)
