import math

import numpy as np
import pytest
from rodsight.solver.bodies.strain import displacement_gradient, logarithmic_strain, shear_strain

ALL = np.ones(60, bool)


def points() -> np.ndarray:
    return np.random.default_rng(0).random((60, 2))


def test_gradient_of_a_homogeneous_motion_is_exact_with_missing_grains():
    x = points()
    gradient = np.array([[0.1, 0.3], [-0.2, 0.05]])
    moved = x @ gradient.T + [7.0, -3.0]
    moved[:5] = np.nan
    np.testing.assert_allclose(displacement_gradient(x, moved, np.arange(60) >= 5), gradient, atol=1e-12)


def test_too_few_grains_give_nan():
    few = np.arange(60) < 3
    gradient = displacement_gradient(points(), points(), few)
    assert np.isnan(gradient).all()
    assert np.isnan(logarithmic_strain(gradient)).all()
    assert math.isnan(shear_strain(logarithmic_strain(gradient)))


def test_rotation_has_no_strain_and_strain_is_logarithmic():
    rotation = np.array([[math.cos(0.4), -math.sin(0.4)], [math.sin(0.4), math.cos(0.4)]])
    np.testing.assert_allclose(logarithmic_strain(rotation - np.eye(2)), 0.0, atol=1e-12)
    stretch = np.diag([1.25, 0.8])
    np.testing.assert_allclose(logarithmic_strain(rotation @ stretch @ rotation.T - np.eye(2))[0, 0],
                               math.log(1.25) * math.cos(0.8), atol=1e-12)  # fmt: skip
    np.testing.assert_allclose(np.trace(logarithmic_strain(stretch - np.eye(2))), 0.0, atol=1e-12)


@pytest.mark.parametrize("angle", [1e-3, 0.02])
def test_shear_of_a_small_simple_shear_is_its_angle(angle):
    strain = logarithmic_strain(np.array([[0.0, math.tan(angle)], [0.0, 0.0]]))
    assert shear_strain(strain) == pytest.approx(angle, rel=1e-3)
    assert strain[0, 1] > 0.0
