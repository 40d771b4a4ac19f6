"""Weights of a B-spline's taps as polynomials."""

from __future__ import annotations

import numpy as np

from ...solver.bodies.grains import Array
from .lanes import constant, evaluate_polynomial, fused_multiply_add


def weight_polynomials(degree: int, first: int, lanes: int) -> Array:
    """Coefficients (degree + 1, lanes) of the powers of 0 ≤ t < 1 in the weights of the taps first, first + 1, …"""
    from scipy.interpolate import BSpline  # slow to import, and compiled readers do not need it

    spline = BSpline.basis_element(np.arange(degree + 2) - 0.5 * (degree + 1), extrapolate=False)
    t = np.linspace(0.0, 1.0, degree + 1)
    weight = np.nan_to_num(spline(t[:, None] - (first + np.arange(lanes))))
    return np.asarray(np.linalg.solve(np.vander(t, degree + 1, increasing=True), weight), np.float64)


def build_weights(builder, degree: int, t) -> list:
    """Build the weights of all taps of an odd degree, each a vector over the points t, by powers of s = t − 1/2.

    A tap and its mirror image have the same even powers and opposite odd ones.
    """
    shifted = np.polynomial.Polynomial([0.5, 1.0])
    polynomials = weight_polynomials(degree, -(degree // 2), (degree + 1) // 2)
    s = builder.fsub(t, constant(t.type, 0.5))
    square = builder.fmul(s, s)
    first, last = [], []
    for column in polynomials.T:
        power = np.zeros(degree + 1)
        for k, coefficient in enumerate(column):
            power[: k + 1] += coefficient * (shifted**k).coef
        powers = [constant(t.type, each) for each in power]
        even, odd = (evaluate_polynomial(builder, powers[begin::2], square) for begin in (0, 1))
        first.append(fused_multiply_add(builder, odd, s, even))
        last.append(fused_multiply_add(builder, builder.fneg(odd), s, even))
    return first + last[::-1]
