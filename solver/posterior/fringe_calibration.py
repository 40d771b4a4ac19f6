"""Pressures of discs from their fringes: one monotone curve for a sequence, found together with the forces.

The squared gradient of brightness over a photoelastic disc, G², grows with the forces on it. How it grows depends on
material, light and lens; it is found from the sequence itself, as the expected sum of normal forces at every G².
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from ..bodies.grains import Array

BINS = 24  # of equal numbers of readings, in which curve and residuals are averaged
FEWEST_READINGS = 60  # with fewer there is no curve
LEAST_RELATIVE_SD = 0.05  # of a pressure read from fringes: forces of equal sum differ in their fringes
LARGEST_DEATTENUATION = 6.0  # of the curve that positions alone show
SCALE_ROUNDS = 20
LEAST_CORRELATION = 0.1  # of readings and pressures: below it fringes show no forces


@dataclass(frozen=True, slots=True)
class FringeReading:
    """Pressures of the discs of one frame by one estimate, with their fringes."""

    fringes: Float[Array, " n"]  # G², NaN: not read
    pressure: Float[Array, " n"]  # [N] sum of normal forces on a disc
    pressure_sd: Float[Array, " n"]  # [N] over the draws
    used: Bool[np.ndarray, " n"]  # discs whose forces are all among the pairs


@dataclass(frozen=True, slots=True)
class FringeCalibration:
    """Monotone curve from G² to the pressure of a disc, in one unit for all frames."""

    knot: Float[Array, " q"]  # G², ascending
    level: Float[Array, " q"]  # pressure, ascending
    relative_sd: float  # s of a pressure p, whose standard deviation is s (p + p̄)/2 …
    mean: float  # … with p̄ the mean pressure
    scale: Mapping[int, float]  # [N] of a frame per unit of the curve: 1 where the scale of forces is known
    correlation: float  # of the pressures by the curve with the true ones, by the curve's own residuals

    def pressure(self, frame: int, fringes: Float[Array, " n"]) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
        """Return the pressures [N] of discs and their standard deviations; NaN: unknown."""
        known = np.isfinite(fringes)
        level = np.full(len(fringes), np.nan)
        level[known] = np.interp(fringes[known], self.knot, self.level)
        sd = 0.5 * self.relative_sd * (level + self.mean)
        scale = self.scale.get(frame, 1.0)
        return scale * level, scale * sd


def calibrate_fringes(
    readings: Mapping[int, FringeReading], scale: Mapping[int, float] | None, former: FringeCalibration | None
) -> FringeCalibration | None:
    """Find the curve from estimates of some frames.

    Parameters
    ----------
    readings : mapping of int to FringeReading
        By frame.
    scale : mapping of int to float or None
        1 for every frame where a load or weight determines the scale of forces; None: found with the curve.
    former : FringeCalibration or None
        Curve that the estimates have used; None: they rest on positions alone.

    Returns
    -------
    FringeCalibration or None
        None: too few readings, or they do not grow with the pressures.

    Notes
    -----
    With p the true pressure, p̂ its posterior mean and v its variance, E[p | G²] = E[p̂ | G²] where the posterior has
    used the fringes. Where it has not, posterior means are drawn towards their mean and the covariance with G² is too
    small by Var p̂/(Var p̂ + ⟨v⟩): deviations from the mean are divided by it. The curve is the isotonic regression of
    bin means. The variance of p about the curve is Var p̂ + ⟨v⟩ − Var(curve) in the first case, that of the residuals
    of p̂ plus ⟨v⟩ in the other.
    """
    frames = sorted(readings)
    fringes, pressure, variance, frame = _gather(readings, frames)
    if len(fringes) < FEWEST_READINGS:
        return None
    known = dict.fromkeys(frames, 1.0) if scale is None else {k: scale[k] for k in frames}
    if former is not None and scale is None:
        known = {k: former.scale.get(k, 1.0) for k in frames}
    knot = level = np.empty(0)
    for _ in range(1 if scale is not None else SCALE_ROUNDS):
        per_unit = np.array([known[k] for k in frames])[frame]
        knot, level = fit_curve(fringes, pressure / per_unit)
        if scale is None and len(frames) > 1:
            expected = np.interp(fringes, knot, level)
            known = {
                k: float(pressure[frame == row].sum() / max(expected[frame == row].sum(), 1e-12))
                for row, k in enumerate(frames)
            }
            middle = float(np.exp(np.mean(np.log([max(each, 1e-12) for each in known.values()]))))
            known = {k: each / middle for k, each in known.items()}
    per_unit = np.array([known[k] for k in frames])[frame]
    estimate, variance = pressure / per_unit, variance / per_unit**2
    curve, mean = np.interp(fringes, knot, level), float(estimate.mean())
    if not curve.std() > 0.0 or np.corrcoef(curve, estimate)[0, 1] < LEAST_CORRELATION:
        return None
    total = float(estimate.var() + variance.mean())
    if former is None:
        factor = min(total / max(float(estimate.var()), 1e-12), LARGEST_DEATTENUATION)
        factor = min(factor, float(np.sqrt(total / curve.var())))  # the curve varies no more than the pressures
        level = np.maximum(mean + factor * (level - mean), 0.0)
        curve = np.interp(fringes, knot, level)
        residual = total - float(curve.var())
    else:
        residual = float(np.mean((estimate - curve) ** 2 + variance))
    shape = float(np.mean((0.5 * (curve + mean)) ** 2))
    relative = max(float(np.sqrt(max(residual, 0.0) / shape)), LEAST_RELATIVE_SD)
    correlation = float(np.sqrt(max(1.0 - min(max(residual, 0.0) / total, 1.0), 0.0)))
    return FringeCalibration(knot, level, relative, mean, known, correlation)


def with_scale_of(
    calibration: FringeCalibration, fringes: Sequence[Array], used: Sequence[Array], typical: Mapping[int, float]
) -> FringeCalibration:
    """Extend the scales to all frames, for forces without a known scale, whose mean is the same in all frames.

    Parameters
    ----------
    fringes, used : sequences of (n,)
        Of every frame.
    typical : mapping of int to float
        Mean pressure [N] of the calibrated frames.
    """
    mean = float(np.mean(list(typical.values())))
    scale = dict(calibration.scale)
    for k, (value, here) in enumerate(zip(fringes, used, strict=True)):
        seen = here & np.isfinite(value)
        if k in scale or not seen.any():
            continue
        expected = float(np.interp(value[seen], calibration.knot, calibration.level).mean())
        scale[k] = mean / max(expected, 1e-12)
    return replace(calibration, scale=scale)


def _gather(readings: Mapping[int, FringeReading], frames: list[int]) -> tuple[Array, Array, Array, np.ndarray]:
    columns: list[tuple[Array, Array, Array, np.ndarray]] = []
    for row, k in enumerate(frames):
        one = readings[k]
        seen = one.used & np.isfinite(one.fringes)
        count = int(seen.sum())
        columns.append((one.fringes[seen], one.pressure[seen], one.pressure_sd[seen] ** 2, np.full(count, row)))
    fringes, pressure, variance, frame = (np.concatenate(each) for each in zip(*columns, strict=True))
    return fringes, pressure, variance, frame


def fit_curve(fringes: Array, pressure: Array) -> tuple[Array, Array]:
    """Return G² and pressure at the bins (q,): isotonic regression of the means of readings (m,) of equal numbers."""
    from scipy.optimize import isotonic_regression  # a tenth of all import time that few inputs need

    order = np.argsort(fringes, kind="stable")
    bins = np.array_split(order, min(BINS, max(len(order) // 10, 2)))
    knot = np.array([fringes[each].mean() for each in bins])
    level = np.array([pressure[each].mean() for each in bins])
    weight = np.array([float(len(each)) for each in bins])
    return knot, np.asarray(isotonic_regression(level, weights=weight).x)
