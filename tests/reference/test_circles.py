"""Circles measured in one call against the plain twin."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rodsight.tracking.correlation.splines import spline_coefficients
from rodsight.tracking.detection.circles.circle_kernels import lowest_tenth, measure_circles

from tests.reference.twins.circles import measured

pytestmark = pytest.mark.unit

NO_CIRCLE = [np.nan, 0.0]  # standard deviation and quality where there is no circle


def two_discs():
    """A photograph (90, 120) of a disc, a small one, a chipped one and one that is cut by the edge."""
    rng = np.random.default_rng(4)
    y, x = np.mgrid[:90, :120].astype(float)
    light = np.zeros((90, 120))
    for cx, cy, r in ((40.3, 44.6, 20.2), (80.4, 30.2, 9.1), (100.0, 64.0, 9.0), (117.0, 30.0, 14.0)):
        light += 1.0 / (1.0 + np.exp((np.hypot(x - cx, y - cy) - r) / 0.4))
    light[60:, 92:104] *= 0.05
    light[:, :22] = np.maximum(light[:, :22], 0.6)
    return (30.0 + 150.0 * light + rng.normal(0.0, 2.0, light.shape)).astype(np.float32)


@pytest.mark.parametrize("narrow", [0.0, 1.0])
def test_circles_are_measured_as_one_by_one(narrow):
    image = two_discs()
    dark = np.full(image.shape, 30.0, np.float32)
    contrast = np.full(image.shape, 150.0)
    rough = np.array([
        [40.0, 45.0, 20.0, 3.0, 0.0, np.inf], [40.0, 45.0, 20.0, 2.0, 0.1, 0.3], [80.0, 30.0, 9.0, 1.8, 0.0, np.inf],
        [99.0, 65.0, 9.0, 1.8, 0.0, np.inf], [116.0, 30.0, 14.0, 2.0, 0.0, 0.3], [60.0, 80.0, 8.0, 1.5, 0.0, np.inf],
        [-3.0, 200.0, 10.0, 2.0, 0.0, 0.3], [46.0, 50.0, 13.0, 1.5, 0.0, np.inf],
    ])  # fmt: skip
    rules = np.tile([0.3, narrow, 0.3, 8.0, 12.0, 0.35], (len(rough), 1))
    rules[2:4, 5], rules[5, 2:4] = 0.75, (0.2, 6.0)
    coefficients = spline_coefficients(image)
    found = np.empty((len(rough), 5))
    measure_circles(coefficients, dark, contrast, rough, rules, found)
    for row in range(len(rough)):
        assert found[row].tolist() == pytest.approx(
            measured(coefficients, dark, contrast, rough[row], rules[row]), nan_ok=True
        )
    assert found[:3, 4].min() > 0.5
    assert found[0, :3] == pytest.approx([40.3, 44.6, 20.2], abs=0.1)
    assert found[6].tolist() == pytest.approx([-3.0, 200.0, 10.0, *NO_CIRCLE], nan_ok=True)


@given(arrays(st.sampled_from([np.float32, np.float64]), st.integers(1, 40), elements=st.floats(-1e3, 1e3, width=32)))
def test_the_lowest_tenth_is_that_of_numpy(values):
    assert lowest_tenth(values) == np.percentile(values, 10.0)
