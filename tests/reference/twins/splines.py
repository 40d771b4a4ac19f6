"""B-splines from their definition, and interpolation of pictures."""

from __future__ import annotations

import numpy as np
from rodsight.solver.bodies.grains import Array
from scipy.interpolate import BSpline


def basis(degree: int, distance: Array | float, derivative: int = 0) -> Array:
    """The B-spline of a degree at a distance from its middle, or a derivative of it."""
    half = 0.5 * (degree + 1)
    spline = BSpline.basis_element(np.arange(degree + 2) - half, extrapolate=False)
    spline = spline.derivative(derivative) if derivative else spline
    return np.nan_to_num(spline(np.asarray(distance, float)))


def value(coefficients: Array, x: float, y: float, degree: int, derivative: tuple[int, int] = (0, 0)) -> float:
    """Σ c[l, k] β(x − k) β(y − l); derivative: orders along x and y."""
    return float(values(coefficients, np.array([x]), np.array([y]), degree, derivative)[0])


def values(coefficients: Array, x: Array, y: Array, degree: int, derivative: tuple[int, int] = (0, 0)) -> Array:
    """Values at points x, y (p,), over the whole support; zero beyond the picture."""
    reach = (degree + 1) // 2
    near = np.arange(-reach, reach + 2)
    column, row = np.floor(x).astype(int)[:, None] + near, np.floor(y).astype(int)[:, None] + near
    along = basis(degree, x[:, None] - column, derivative[0])
    down = basis(degree, y[:, None] - row, derivative[1])
    height, width = coefficients.shape
    inside = ((row >= 0) & (row < height))[:, :, None] & ((column >= 0) & (column < width))[:, None, :]
    there = coefficients[np.clip(row, 0, height - 1)[:, :, None], np.clip(column, 0, width - 1)[:, None, :]]
    return np.einsum("pl,pk,plk->p", down, along, np.where(inside, there, 0.0).astype(np.float64))
