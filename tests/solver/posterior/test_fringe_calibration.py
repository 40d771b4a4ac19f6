"""The curve from fringes to pressures of discs."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.posterior.fringe_calibration import FringeReading, calibrate_fringes, with_scale_of

pytestmark = pytest.mark.unit

DISCS = 400
NOISE = 0.2  # of a reading, over its pressure
DILUTION = 0.15  # relative: noise of the readings flattens their regression, and so draws scales together


def make_readings(rng: np.random.Generator, scale: float = 1.0, error: float = 0.0) -> tuple[np.ndarray, FringeReading]:
    """Pressures of mean 4, fringes that grow as their power 1.6, and estimates drawn towards their mean."""
    pressure = rng.gamma(4.0, 1.0, DISCS)
    fringes = (scale * pressure * (1.0 + NOISE * rng.standard_normal(DISCS))).clip(0.01) ** 1.6
    variance = pressure.var()
    kept = variance / (variance + error**2)  # a posterior mean of a measurement with this error
    estimate = pressure.mean() + kept * (pressure + error * rng.standard_normal(DISCS) - pressure.mean())
    sd = np.full(DISCS, np.sqrt(kept) * error)
    return pressure, FringeReading(fringes, estimate, sd, np.ones(DISCS, bool))


def best_correlation(pressure: np.ndarray, reading: FringeReading) -> float:
    """Correlation of the pressures with the readings by the true curve."""
    return float(np.corrcoef(reading.fringes ** (1 / 1.6), pressure)[0, 1])


def test_curve_gives_the_pressures_and_their_scatter():
    pressure, reading = make_readings(np.random.default_rng(0))
    found = calibrate_fringes({3: reading}, {3: 1.0}, None)
    level, sd = found.pressure(3, reading.fringes)
    assert np.corrcoef(level, pressure)[0, 1] > best_correlation(pressure, reading) - 0.02
    # Noise of the readings flattens the regression by the square of their correlation.
    assert np.polyfit(pressure, level, 1)[0] == pytest.approx(best_correlation(pressure, reading) ** 2, abs=0.05)
    assert np.sqrt(np.mean(((level - pressure) / sd) ** 2)) == pytest.approx(1.0, abs=0.25)
    assert found.correlation == pytest.approx(np.corrcoef(level, pressure)[0, 1], abs=0.05)


def test_means_drawn_together_do_not_flatten_the_curve():
    pressure, reading = make_readings(np.random.default_rng(1), error=3.0)
    found = calibrate_fringes({0: reading}, {0: 1.0}, None)
    level, _ = found.pressure(0, reading.fringes)
    assert np.polyfit(reading.fringes ** (1 / 1.6), level, 1)[0] > 0.7
    assert np.polyfit(reading.fringes ** (1 / 1.6), reading.pressure, 1)[0] < 0.4
    assert np.corrcoef(level, pressure)[0, 1] > best_correlation(pressure, reading) - 0.05


def test_scales_of_frames_without_a_load_follow_from_their_fringes():
    rng = np.random.default_rng(2)
    readings = {k: make_readings(rng, scale)[1] for k, scale in ((0, 1.0), (5, 2.0), (9, 1.4))}
    found = calibrate_fringes(readings, None, None)
    assert found.scale[0] / found.scale[5] == pytest.approx(2.0, rel=DILUTION)
    assert found.scale[0] / found.scale[9] == pytest.approx(1.4, rel=DILUTION)
    other = make_readings(rng, 2.0)[1]
    fringes = [readings[0].fringes, other.fringes]
    extended = with_scale_of(found, fringes, [np.ones(DISCS, bool)] * 2, {0: 4.0, 5: 4.0, 9: 4.0})
    assert extended.scale[1] == pytest.approx(found.scale[5], rel=0.1)


def test_fringes_that_show_no_forces_are_not_used():
    _, reading = make_readings(np.random.default_rng(3))
    shuffled = FringeReading(
        np.random.default_rng(4).permutation(reading.fringes), reading.pressure, reading.pressure_sd, reading.used
    )
    falling = FringeReading(-reading.fringes, reading.pressure, reading.pressure_sd, reading.used)
    few = FringeReading(*(getattr(reading, name)[:20] for name in ("fringes", "pressure", "pressure_sd", "used")))
    found = calibrate_fringes({0: shuffled}, {0: 1.0}, None)
    assert found is None or found.correlation < 0.5
    assert calibrate_fringes({0: falling}, {0: 1.0}, None) is None
    assert calibrate_fringes({0: few}, {0: 1.0}, None) is None


def test_discs_without_fringes_are_unknown():
    _, reading = make_readings(np.random.default_rng(5))
    found = calibrate_fringes({0: reading}, {0: 1.0}, None)
    level, sd = found.pressure(0, np.array([np.nan, 4.0]))
    assert np.isnan([level[0], sd[0]]).all()
    assert level[1] > 0.0
    assert sd[1] > 0.0
