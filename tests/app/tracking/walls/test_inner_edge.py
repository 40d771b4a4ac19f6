"""Detection of a bar's inner edge from a line near it."""

import cv2
import numpy as np
import pytest
from rodsight.tracking.walls.inner_edge import find_edge


@pytest.fixture
def bar():
    """A bright bar below the line (40, 300) to (460, 280), with paint on it and rods above it."""
    rng = np.random.default_rng(5)
    image = np.full((400, 500), 20.0, np.float32)
    cv2.fillPoly(image, [np.array([[0, 302], [499, 278], [499, 399], [0, 399]])], 170.0)
    for x, y in rng.uniform((0, 310), (500, 400), (150, 2)):
        cv2.circle(image, (int(x), int(y)), 4, 70.0, -1)
    for x in range(60, 460, 55):
        cv2.circle(image, (x, int(302 - 24 * x / 499 - 26)), 24, 190.0, -1)
    return cv2.GaussianBlur(image, None, 1.0)


def test_a_line_drawn_by_hand_moves_onto_the_edge(bar):
    edge = find_edge(bar, np.array([[45.0, 309.0], [455.0, 273.0]]), 20.0)
    true = 302.0 - 24.0 * edge.line[:, 0] / 499.0
    assert np.abs(edge.line[:, 1] - true).max() < 1.0
    assert edge.is_seen
    assert edge.fraction > 0.5
    assert (edge.sigma > 0.0).all()


def test_where_there_is_no_edge_a_line_stays(bar):
    empty = np.full_like(bar, 50.0)
    line = np.array([[45.0, 309.0], [455.0, 273.0]])
    edge = find_edge(empty, line, 20.0)
    assert not edge.is_seen
    np.testing.assert_array_equal(edge.line, line)


@pytest.mark.parametrize("reach", [8.0, 20.0, 60.0])
@pytest.mark.parametrize("grain", [0.0, 3.0])
def test_noise_and_texture_are_no_edge(reach, grain):
    rng = np.random.default_rng(3)
    image = (40.0 + 60.0 * rng.standard_normal((400, 500))).astype(np.float32)
    image = cv2.GaussianBlur(image, None, grain) if grain else image
    lines = np.array([[40.0, 150.0], [460.0, 155.0]]) + np.array([0.0, 9.0]) * np.arange(6)[:, None, None]
    assert not any(find_edge(image, line, reach).is_seen for line in lines)


def test_a_line_outside_the_photograph_shows_no_edge(bar):
    assert not find_edge(bar, np.array([[-300.0, -90.0], [-100.0, -90.0]]), 20.0).is_seen


def test_the_edge_is_found_between_pixels_and_its_error_is_stated():
    """The greatest slope is attracted by the pixels of a level edge; the centre of the slopes is not."""
    off, scaled = [], []
    for k, height in enumerate(np.linspace(200.0, 201.0, 9)):
        image = np.full((400, 500), 20.0)
        share = np.clip(np.arange(400) + 0.5 - height, 0.0, 1.0)[:, None]
        image = image + 150.0 * share
        image = cv2.GaussianBlur(image, None, 0.7) + np.random.default_rng(k).normal(0.0, 3.0, image.shape)
        edge = find_edge(image.astype(np.float32), np.array([[40.0, 202.0], [460.0, 199.0]]), 8.0)
        off.append(edge.line[:, 1] - height)
        scaled.append(off[-1] / edge.sigma)
    assert np.abs(off).max() < 0.03
    assert 0.3 < np.sqrt(np.mean(np.square(scaled))) < 2.0
