"""The kernels that draw a photograph against array implementations."""

import numpy as np
import pytest
from rodsight.synthetic import speckle_kernels as kernels
from rodsight.synthetic.camera import pixel_response

from tests.reference.twins import drawing

pytestmark = pytest.mark.unit

SINGLE = 1e-5  # relative: tiles and pictures are in single precision
SHAPE = (52, 61)
DOTS = np.array([[0.0, 0.0, 1.5, 0.8], [3.0, -2.0, 2.5, 0.5], [-4.5, 3.5, 1.0, 1.0], [30.0, 2.0, 1.0, 0.9]])


def tiles():
    return np.full((2, *SHAPE), 7.0, np.float32)


def test_the_constants_equal_those_of_the_twin():
    assert (
        drawing.FINE,
        pytest.approx(drawing.EDGE),
        drawing.PITCH,
    ) == (kernels.FINE, kernels.EDGE, kernels.BACKING_PITCH)


def test_an_edge_is_the_integral_of_its_kernel():
    t = np.linspace(-1.5, 1.5, 41)
    assert [kernels.blurred_step(each) for each in t] == pytest.approx(drawing.step(t), abs=1e-12)


@pytest.mark.parametrize("centre", [(30.2, 25.7), (4.0, 26.0)])  # within the tile, and over its side
def test_a_rod_is_drawn_as_by_the_twin(centre):
    glow, share = tiles()
    angle, tilt = 0.7, np.array([0.6, -0.8])
    given = (*centre, 21.4, np.cos(angle), np.sin(angle), DOTS, 210.0, 20.0, 0.6, tilt, 5.0)
    kernels.draw_rod(glow, share, *given)
    expected, part = drawing.rod(SHAPE, *centre, 21.4, angle, DOTS, 210.0, 20.0, 0.6, tilt, 5.0)
    assert share == pytest.approx(part, abs=SINGLE)
    assert glow == pytest.approx(expected, abs=210.0 * SINGLE)
    assert ((part > 0) & (part < 1)).any()
    assert (part == 1).any()


def test_a_bar_is_drawn_as_by_the_twin():
    glow, share = tiles()
    along = np.array([np.cos(0.4), np.sin(0.4)])
    kernels.draw_bar(glow, share, 12.0, 9.5, along, 33.0, 14.0, DOTS, 150.0, 20.0)
    expected, part = drawing.bar(SHAPE, 12.0, 9.5, along, 33.0, 14.0, DOTS, 150.0, 20.0)
    assert share == pytest.approx(part, abs=SINGLE)
    assert glow == pytest.approx(expected, abs=150.0 * SINGLE)
    assert part.max() == pytest.approx(1.0)


def test_sub_pixels_are_weighted_about_their_pixels_and_added():
    rng = np.random.default_rng(4)
    glow, share = rng.uniform(0, 200, (2, *SHAPE)).astype(np.float32)
    taps = pixel_response(0.9)
    assert taps.sum() == pytest.approx(1.0)
    before = rng.uniform(0, 9, (2, 40, 40)).astype(np.float32)
    light, covered = before.copy()
    kernels.collect_light(light, covered, glow, share, taps, 5, 3, np.empty((2, SHAPE[1])))
    for found, given, old in ((light, glow, before[0]), (covered, share, before[1])):
        added = drawing.collect(given, taps)
        expected = old.astype(float)
        expected[5 : 5 + added.shape[0], 3 : 3 + added.shape[1]] += added
        assert found == pytest.approx(expected, rel=SINGLE)


def test_the_backing_fills_uncovered_pixels():
    rng = np.random.default_rng(6)
    scene, covered = rng.uniform(0, 200, SHAPE).astype(np.float32), rng.uniform(0.0, 1.3, SHAPE).astype(np.float32)
    covered[:4] = 1.0
    backing = rng.uniform(-1, 1, (SHAPE[0] // 6 + 2, SHAPE[1] // 6 + 2)).astype(np.float32)
    expected = drawing.with_backing(scene, covered, backing, 30.0, 60.0, 0.2)
    kernels.add_backing(scene, covered, backing, 30.0, 60.0, 0.2)
    assert scene == pytest.approx(expected, rel=SINGLE, abs=1e-3)
