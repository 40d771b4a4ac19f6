"""Detection of a frame's bars from the rods between them."""

import numpy as np
import pytest
from rodsight.tracking.walls.surrounding_bars import are_held, depth_in_circles, find_bars, lines_to_corners


def test_bars_are_found_from_the_rods_of_a_sheared_frame():
    row, column = np.mgrid[0:9, 0:12]
    x = 60.0 + 40.0 * column + 6.0 * (8 - row)
    y = 50.0 + 40.0 * row
    bars = find_bars(x.ravel().astype(float), y.ravel(), np.full(x.size, 20.0))
    assert bars.shape == (4, 2, 2)
    bottom, right, top, left = bars
    np.testing.assert_allclose(bottom[:, 1], 390.0, atol=0.2)
    np.testing.assert_allclose(top[:, 1], 30.0, atol=0.2)
    assert bottom[0, 0] < bottom[1, 0]
    assert top[0, 0] > top[1, 0]
    assert right[0, 1] > right[1, 1]
    np.testing.assert_allclose((right[1, 0] - right[0, 0]) / (right[0, 1] - right[1, 1]), 6.0 / 40.0, atol=0.01)
    np.testing.assert_allclose(bottom[1], right[0], atol=1e-6)
    np.testing.assert_allclose(left[1], bottom[0], atol=1e-6)


def test_lines_are_cut_where_they_meet():
    bottom, right = [[1.0, 9.0], [8.0, 9.0]], [[9.0, 12.0], [9.0, 2.0]]
    top, left = [[12.0, 1.0], [2.0, 1.0]], [[0.0, 0.0], [0.0, 7.0]]
    lines = np.array([bottom, right, top, left])
    met = lines_to_corners(lines)
    np.testing.assert_allclose(met[0], [[0.0, 9.0], [9.0, 9.0]])
    np.testing.assert_allclose(met[2], [[9.0, 1.0], [0.0, 1.0]])


def test_the_depth_of_a_line_in_circles_is_positive_inside_and_negative_beyond():
    x, y, radius = np.array([10.0, 30.0]), np.array([10.0, 10.0]), np.array([10.0, 5.0])
    floor = np.array([[0.0, 20.0], [40.0, 20.0]])
    assert depth_in_circles(floor, x, y, radius) == pytest.approx(0.0)
    assert depth_in_circles(floor - [0.0, 4.0], x, y, radius) == pytest.approx(0.4)
    assert depth_in_circles(floor - [0.0, -2.0], x, y, radius) == pytest.approx(-0.2)


@pytest.mark.parametrize(
    "others",
    [
        [(300.0, -60.0), (620.0, 200.0)],  # bolts beside the packing, as large as rods
        [(281.0, 15.0)],  # a spot of a bar's paint next to two rods
    ],
)
def test_bars_do_not_bound_circles_that_are_no_rods(others):
    row, column = np.mgrid[0:9, 0:12]
    x, y = (60.0 + 40.0 * column).ravel(), (50.0 + 40.0 * row).ravel()
    alone = find_bars(x, y, np.full(x.size, 20.0))
    more_x, more_y = (np.concatenate([each, more]) for each, more in zip((x, y), np.transpose(others), strict=True))
    np.testing.assert_allclose(find_bars(more_x, more_y, np.full(len(more_x), 20.0)), alone, atol=0.05)


def test_a_loose_packing_is_bounded_with_all_its_circles():
    x, y = (60.0 * each.ravel() for each in np.mgrid[0:5, 0:6].astype(float))
    assert are_held(x, y, np.full(x.size, 20.0)).all()
    bars = find_bars(x, y, np.full(x.size, 20.0))
    assert (bars.reshape(-1, 2).min(), bars.reshape(-1, 2).max()) == (
        pytest.approx(-20.0, abs=0.05),
        pytest.approx(320.0, abs=0.05),
    )


def test_a_ring_of_few_circles_is_bounded():
    angle = 2.0 * np.pi * np.arange(6) / 6
    x, y = 100.0 + 40.0 * np.cos(angle), 100.0 + 40.0 * np.sin(angle)  # every line rests on two of them
    assert len(find_bars(x, y, np.full(6, 20.0))) == 4
