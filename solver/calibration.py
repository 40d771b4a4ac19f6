"""Self-calibration: constant errors of centres, radii, walls and pixel size, found from the gaps of a sequence.

Rigid grains neither overlap nor, where they carry force, stand apart. A centre that is wrong by a
constant, body-fixed amount breaks this in a way that turns with the grain and changes with its
neighbours, so many photographs reveal it. The gap equations are solved by robust, one-sided,
iteratively re-weighted least squares: a positive gap g counts as (1 + (g/s)²)⁻², an overlap in full
unless only a wrong track can explain it, and s shrinks from the scale of the errors to that of the
noise. Gaussian priors hold whatever the sequence does not determine.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.calibration_equations import GapEquations, MeasuredSequence
from solver.calibration_priors import FINEST_SURFACE, CalibrationPriors, Candidates, narrow_priors, prior_vector
from solver.calibration_solve import ROUNDS, GapFit, fit_gaps
from solver.calibration_weights import contact_width
from solver.grains import Array

LEAST_GAIN = 0.1  # corrections that narrow the gaps of touching pairs by less are not worth their own noise
CERTAIN = 3.0  # standard deviations beyond which a correction is called sure, or larger than its prior allows
IMPOSSIBLE = 4.0  # standard deviations of noise: no touching pair overlaps more
EXCESSIVE_NOISE = 1.3  # true over stated noise: above this the user is told
TOLERATED_IMPOSSIBLE = 0.02  # share of the overlaps: above this the user is told
EXCESSIVE_DEMAND = 2.0  # errors that the overlaps suggest, over the prior: above this the user is told
POSTERIOR_SAMPLES = 100  # draws behind each standard deviation: known to 7 %
EXPECTED_CENTRE = 1e-2  # widest prior without being told, of the mean diameter; the overlaps then narrow it
EXPECTED_WALL = 3e-3  # prior of a wall without being told, of the mean diameter
RADIUS_SHARE = 0.5  # prior of a radius over that of a centre without being told; the data then reduce either


@dataclass(frozen=True, slots=True)
class GapStatistics:
    """How physical the gaps of a sequence are."""

    width: float  # [m] standard deviation of the gaps of touching grains, from their overlapping side
    wall_width: float  # [m] the same between grains and walls
    impossible: float  # share of all gaps below the noise that lie deeper than 4 of its standard deviations


@dataclass(frozen=True, slots=True)
class Calibration:
    """Constant errors found in a sequence. Add the corrections to what was measured."""

    offset: Array  # (n, 2) [m] from measured to true centre, in the body frame of the grain's first frame
    radius: Array  # (n,) [m] from given to true radius
    wall: Array  # (w,) [m] outward
    pixel_size: float  # relative; true lengths are (1 + pixel_size) times the measured ones
    offset_sd: Array  # (n, 2) [m] posterior standard deviation; the prior's where a grain meets nobody
    radius_sd: Array  # (n,) [m]
    wall_sd: Array  # (w,) [m]
    pixel_size_sd: float
    gap_sd: float  # [m] what the errors that are left do to the gap of a touching pair, noise apart
    priors: CalibrationPriors  # those used: never wider than given, narrower where the gaps say so
    noise_factor: float  # noise of positions that the corrected gaps show over that stated, at least 1
    before: GapStatistics
    after: GapStatistics  # with the corrections, whether they are applied or not
    rounds: int
    applied: bool  # False: every correction above is zero
    verdict: str  # why, in a sentence for the user

    def position_sd(self, sigma: float) -> float:
        """Standard deviation [m] of a position for contact detection: stated noise `sigma` [m] and what is left.

        The gap of a touching pair has √2 times this standard deviation.
        """
        return float(np.hypot(self.noise_factor * sigma, self.gap_sd / np.sqrt(2.0)))

    def correct(self, sequence: MeasuredSequence) -> MeasuredSequence:
        """Apply the corrections: centres, radii and walls of the sequence they were found in."""
        equations = GapEquations(sequence)
        unknowns = np.zeros(equations.layout.count)
        unknowns[equations.layout.offset] = self.offset.ravel()
        unknowns[equations.layout.radius] = self.radius
        unknowns[equations.layout.wall] = self.wall
        unknowns[equations.layout.scale] = self.pixel_size
        return MeasuredSequence(
            equations.radius(unknowns),
            equations.position(unknowns),
            sequence.rotation,
            sequence.present,
            equations.endpoints(unknowns),
            sequence.sigma,
        )


def calibrate(
    sequence: MeasuredSequence,
    priors: CalibrationPriors | None = None,
    *,
    rng: np.random.Generator,
    typical_overlap: float = 0.0,
    radius_class: NDArray[np.integer] | None = None,
) -> Calibration:
    """Find the constant errors of a sequence and decide whether correcting them makes it more plausible.

    priors: standard deviations of the errors; None: centres, radii and walls are taken as uncertain, the
    pixel size as exact. Widths given for centres and radii are upper limits: what the overlaps of the
    sequence do not support is not corrected. typical_overlap [m]: mean elastic overlap of a touching pair.
    radius_class (n,) int: the class 0, 1, … of each grain, for `priors.radius_class`.
    """
    if not typical_overlap >= 0.0:
        raise ValueError(f"typical_overlap must be zero or positive, not {typical_overlap}")
    if radius_class is not None and radius_class.shape != sequence.radius.shape:
        raise ValueError(f"radius_class must name a class for each of the {sequence.grain_count} grains")
    equations = GapEquations(sequence, radius_class)
    limits = _expected_priors(sequence) if priors is None else priors
    start, demand = narrow_priors(equations, limits, typical_overlap)
    fit = fit_gaps(equations, start, typical_overlap, POSTERIOR_SAMPLES, rng)
    return _judge(equations, limits, demand, fit)


def _expected_priors(sequence: MeasuredSequence) -> CalibrationPriors:
    diameter = 2.0 * float(sequence.radius.mean())
    centre = EXPECTED_CENTRE * diameter
    return CalibrationPriors(centre, RADIUS_SHARE * centre, wall=EXPECTED_WALL * diameter)


def _judge(equations: GapEquations, limits: CalibrationPriors, demand: float, fit: GapFit) -> Calibration:
    layout, sequence = equations.layout, equations.sequence
    before = _gap_statistics(fit.gap_before, fit.candidates)
    after = _gap_statistics(fit.gap_after, fit.candidates)
    gain = 1.0 - after.width / before.width if before.width > 0.0 else 0.0
    certain = _certain_parts(equations, fit)
    applied = gain >= LEAST_GAIN or bool(certain)
    verdict = _verdict(applied, gain, certain, before, after)
    verdict += _track_warning(fit, after)
    if applied:
        verdict += _prior_warning(equations, limits, demand, fit)
    unknowns = fit.unknowns if applied else np.zeros(layout.count)
    sd = fit.sd
    radius_sd = sd[layout.radius]
    if equations.radius_class is not None:
        radius_sd = np.hypot(radius_sd, sd[layout.radius_class][equations.radius_class])
    return Calibration(
        offset=unknowns[layout.offset].reshape(-1, 2),
        radius=equations.radius(unknowns) - sequence.radius,
        wall=unknowns[layout.wall],
        pixel_size=float(unknowns[layout.scale][0]),
        offset_sd=sd[layout.offset].reshape(-1, 2),
        radius_sd=radius_sd,
        wall_sd=sd[layout.wall],
        pixel_size_sd=float(sd[layout.scale][0]),
        gap_sd=fit.gap_sd,
        priors=fit.priors,
        noise_factor=fit.candidates.noise_factor,
        before=before,
        after=after,
        rounds=ROUNDS,
        applied=applied,
        verdict=verdict,
    )


def _gap_statistics(gap: Array, candidates: Candidates) -> GapStatistics:
    between, overlap = candidates.between_grains, candidates.overlap
    overlapping = gap + overlap < 0.0
    deep = gap + overlap < -IMPOSSIBLE * candidates.noise
    return GapStatistics(
        contact_width(gap[between], overlap),
        contact_width(gap[~between], overlap),
        float(np.mean(deep[overlapping])) if np.any(overlapping) else 0.0,
    )


def _certain_parts(equations: GapEquations, fit: GapFit) -> list[str]:
    layout = equations.layout
    finest = FINEST_SURFACE * float(equations.sequence.radius.mean())
    parts = {
        "walls": (layout.wall, finest),
        "radius classes": (layout.radius_class, finest),
        "pixel size": (layout.scale, FINEST_SURFACE),
    }
    return [
        name
        for name, (part, least) in parts.items()
        if np.any(np.abs(fit.unknowns[part]) > CERTAIN * np.hypot(fit.sd[part], least))
    ]


def _verdict(applied: bool, gain: float, certain: list[str], before: GapStatistics, after: GapStatistics) -> str:
    widths = f"the gaps of touching grains go from {before.width * 1e6:.1f} to {after.width * 1e6:.1f} µm wide"
    if not applied:
        return f"not applied: nothing to gain, {widths} and no wall or scale is surely wrong"
    reasons = [widths] if gain >= LEAST_GAIN else []
    reasons += [f"surely wrong before: {', '.join(certain)}"] if certain else []
    return "applied: " + "; ".join(reasons)


def _track_warning(fit: GapFit, after: GapStatistics) -> str:
    """Say what the tracks promise and do not keep."""
    text = ""
    if fit.candidates.noise_factor > EXCESSIVE_NOISE:
        text += f"; positions scatter {fit.candidates.noise_factor:.1f} times as much as stated"
    if after.impossible > TOLERATED_IMPOSSIBLE:
        text += f"; {100 * after.impossible:.0f} % of the overlaps stay impossible: some tracks are wrong"
    return text


def _prior_warning(equations: GapEquations, limits: CalibrationPriors, demand: float, fit: GapFit) -> str:
    """Say what is larger than the priors allow."""
    text = ""
    if demand > EXCESSIVE_DEMAND:
        text += f"; the overlaps suggest errors of grains {demand:.1f} times wider than the prior"
    large = np.abs(fit.unknowns) > CERTAIN * np.maximum(prior_vector(equations, limits), np.finfo(float).tiny)
    if np.any(large):
        text += f"; {np.count_nonzero(large)} corrections exceed {CERTAIN:.0f} standard deviations of their prior"
    return text
