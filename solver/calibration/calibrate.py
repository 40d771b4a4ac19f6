"""Self-calibration: constant errors of centres, radii, walls and pixel size, estimated from the gaps of a sequence.

Rigid grains do not overlap, and where they carry force their gap is zero. Errors that all grains share are estimated
first: the pixel size, the radius of a whole class (`scale`). Then the errors of each grain: a constant, body-fixed
error of a centre changes the gaps as the grain rotates and its neighbours change, so that many photographs determine
it. The gap equations (`equations`) are solved by robust, one-sided, iteratively re-weighted least squares with Gaussian
priors (`fit`, `weights`, `priors`). Corrections are applied only if they make the gaps of touching pairs more
plausible.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..quantity import Quantity
from .equations import GapEquations, move_walls, radial_distortion, rotate_offsets
from .fit import ROUNDS, GapFit, fit_gaps
from .gap_statistics import GapStatistics, gap_statistics, width_gain
from .gaps import MeasuredSequence, measure_gaps
from .priors import FINEST_SURFACE, CalibrationPriors, narrow_priors, prior_vector
from .scale import SIGNIFICANT_SDS, ScaleErrors, find_scale, scale_walls

MIN_GAIN = 0.1  # relative narrowing of the gaps of touching pairs below which grains are not corrected
EXCESSIVE_NOISE = 1.3  # measured over stated noise above which the verdict contains a warning
MISJUDGED_NOISE = 2.0  # … above which the calibration is repeated with the measured noise
TOLERATED_IMPOSSIBLE = 0.02  # fraction of overlaps that are impossible above which the verdict contains a warning
EXCESSIVE_WIDTH = 2.0  # width of the errors by the overlaps, over the prior, above which the verdict contains a warning
MOST_FRAMES = 64  # photographs that are used, evenly spaced: with more the errors are known no better than they matter
LENS_FRAMES = 16  # photographs used to decide whether the lens is corrected
LENS_SAMPLES = 30  # draws for its standard deviation there
POSTERIOR_SAMPLES = 50  # draws for each standard deviation: accurate to 10 %
DEFAULT_CENTRE_SD = 1e-2  # of the mean diameter: default upper limit, which the overlaps reduce
DEFAULT_WALL_SD = 3e-3  # of the mean diameter: default prior of a wall
DEFAULT_TILT_SD = 5e-4  # [rad] default prior of a wall's direction
DEFAULT_LENS_SD = 1e-2  # of the mean diameter: default prior of the shift by the lens at the farthest corner
RADIUS_SD_FRACTION = 0.5  # default prior of a radius over that of a centre; the data reduce both


@dataclass(frozen=True, slots=True)
class Calibration:
    """Estimated constant errors of a sequence. Add the corrections to the measured values."""

    offset: Annotated[Array, Quantity("from measured to true centre, turning with the grain", "m", "grain xy")]
    radius: Annotated[Array, Quantity("from given to true radius", "m", "grain")]
    # A dataset must not have the name of a dimension: netCDF would read it as the labels of that dimension.
    wall: Annotated[
        Array,
        Quantity(
            "correction of a wall outward, at its middle",
            "m",
            "wall",
            path="calibration/wall_outward",
            formerly="calibration/wall",
        ),
    ]
    wall_tilt: Annotated[Array, Quantity("correction of a wall about its middle, counter-clockwise", "rad", "wall")]
    radius_offset: Annotated[float, Quantity("error that all radii share, part of radius", "m", since=2, absent=0.0)]
    pixel_size: Annotated[float, Quantity("true distances are (1 + pixel_size) times the measured ones")]
    lens: Annotated[float, Quantity("outward shift of the farthest corner by the lens", "m")]
    walls_follow: Annotated[bool, Quantity("the walls are corrected by the pixel size, too", absent=False)]
    offset_sd: Annotated[
        Array, Quantity("standard deviation of offset, the prior's without neighbours", "m", "grain xy")
    ]
    radius_sd: Annotated[Array, Quantity("standard deviation of radius", "m", "grain")]
    wall_sd: Annotated[Array, Quantity("standard deviation of wall_outward", "m", "wall")]
    wall_tilt_sd: Annotated[Array, Quantity("standard deviation of wall_tilt", "rad", "wall")]
    pixel_size_sd: Annotated[float, Quantity("standard deviation of pixel_size")]
    radius_offset_sd: Annotated[float, Quantity("standard deviation of radius_offset", "m", since=2)]
    lens_sd: Annotated[float, Quantity("standard deviation of lens", "m")]
    gap_sd: Annotated[float, Quantity("standard deviation of a gap by the remaining errors, without noise", "m")]
    priors: CalibrationPriors  # as used: at most those given, smaller where the gaps support less
    noise_factor: Annotated[float, Quantity("measured noise of the corrected gaps over the stated noise")]
    before: GapStatistics
    after: GapStatistics  # with the corrections, whether they are applied or not
    rounds: Annotated[int, Quantity("rounds of re-weighted least squares", absent=0)]
    applied: Annotated[bool, Quantity("whether the corrections were applied; if not, all are zero", absent=True)]
    verdict: Annotated[str, Quantity("why it was applied or not, for the user", absent="")]
    radius_factor: Annotated[
        float, Quantity("relative error that all radii share, part of radius", since=2, absent=0.0)
    ] = 0.0
    radius_factor_sd: Annotated[
        float, Quantity("standard deviation of radius_factor; 0: not estimated", since=2, absent=0.0)
    ] = 0.0
    walls_decide: Annotated[
        bool,
        Quantity("rods at walls and discs separate radius_factor from pixel_size", since=2, absent=False),
    ] = False

    def shared_radius(self, radius: Array) -> Array:
        """Return the part (n,) [m] of the correction of given radii (n,) [m] that all grains share."""
        return self.radius_offset + self.radius_factor * radius

    def position_sd(self, sigma: float) -> float:
        """Compute the standard deviation [m] of a position for contact detection from the stated noise `sigma` [m].

        Notes
        -----
        σ² = (noise_factor · sigma)² + gap_sd²/2: the gap of a touching pair has the standard deviation √2 σ.
        """
        return float(np.hypot(self.noise_factor * sigma, self.gap_sd / np.sqrt(2.0)))

    def of_grains(self, count: int) -> Calibration:
        """Extend to `count` grains; those after the calibrated ones have no correction."""
        more = count - len(self.radius)
        unknown = np.full((more, 2), np.nan)
        return replace(
            self,
            offset=np.concatenate([self.offset, np.zeros((more, 2))]),
            radius=np.concatenate([self.radius, np.zeros(more)]),
            offset_sd=np.concatenate([self.offset_sd, unknown]),
            radius_sd=np.concatenate([self.radius_sd, unknown[:, 0]]),
        )

    def correct(self, sequence: MeasuredSequence) -> MeasuredSequence:
        """Apply the corrections to the sequence that they were estimated from.

        Notes
        -----
        x ← (1 + ε) x + d q(x) + Rot(θ) o,  R ← R + δR, with ε the pixel size, d the lens and q by `radial_distortion`;
        walls by `move_walls`.
        """
        scale = 1.0 + self.pixel_size
        endpoints = sequence.endpoints
        if self.walls_follow:
            endpoints = scale_walls(endpoints, scale, sequence.side)
        shift = self.lens * radial_distortion(sequence) + rotate_offsets(sequence, self.offset)
        return replace(
            sequence,
            radius=sequence.radius + self.radius,
            position=scale * sequence.position + shift,
            endpoints=move_walls(endpoints, self.wall, self.wall_tilt, sequence.side),
        )


def calibrate(
    sequence: MeasuredSequence,
    priors: CalibrationPriors | None = None,
    *,
    rng: np.random.Generator,
    typical_overlap: float = 0.0,
    radius_class: NDArray[np.integer] | None = None,
) -> Calibration:
    """Estimate the constant errors of a sequence and decide whether they are corrected.

    Parameters
    ----------
    sequence : MeasuredSequence
        Tracked grains and walls.
    priors : CalibrationPriors, optional
        Standard deviations of the errors; None: defaults for centres, radii and walls, an exact pixel size. Those of
        centres and radii are upper limits, which the data reduce.
    rng : numpy.random.Generator
        Random numbers of the posterior draws.
    typical_overlap : float
        Mean elastic overlap [m] of a touching pair.
    radius_class : int array (n,), optional
        Class 0, 1, … of each grain, for `priors.radius_class`.

    Returns
    -------
    Calibration
        Corrections, all zero unless they narrow the gaps of touching grains by 10 %, a correction of walls, lens or
        classes is significant (3 standard deviations), or the scale is wrong.

    Raises
    ------
    ValueError
        If the overlap is negative, or the classes do not match the grains.
    """
    if not typical_overlap >= 0.0:
        raise ValueError(f"typical_overlap must be zero or positive, not {typical_overlap}")
    if radius_class is not None and radius_class.shape != sequence.radius.shape:
        raise ValueError(f"radius_class must name a class for each of the {sequence.grain_count} grains")
    limits = default_priors(sequence) if priors is None else priors
    sequence = sequence.thinned(MOST_FRAMES)
    found = _calibrate(sequence, limits, rng, typical_overlap, radius_class, 1.0)
    if found.noise_factor < MISJUDGED_NOISE:
        return found
    # Understated noise passes for errors of centres: repeat with the measured noise.
    noisier = replace(sequence, sigma=found.noise_factor * sequence.sigma)
    return _calibrate(noisier, limits, rng, typical_overlap, radius_class, found.noise_factor)


def _calibrate(
    sequence: MeasuredSequence,
    limits: CalibrationPriors,
    rng: np.random.Generator,
    typical_overlap: float,
    radius_class: NDArray[np.integer] | None,
    noise_ratio: float,
) -> Calibration:
    """Calibrate once; noise_ratio: the noise of `sequence` over that stated."""
    scale = find_scale(sequence, limits, typical_overlap, radius_class)
    equations = GapEquations(scale.correct(sequence, radius_class), radius_class, walls_follow=scale.walls_follow)
    # A scale that may be right stays; a corrected one has its posterior standard deviation as prior.
    # A factor of all radii is a scale of everything else: it is refined as one, and converted in the end.
    rest = replace(
        limits, pixel_size=scale.pixel_size_sd + scale.radius_factor_sd if scale.found else 0.0, radius_class=0.0,
        radius_offset=0.0, radius_factor=0.0,
    )  # fmt: skip
    start, width_ratio = narrow_priors(equations, rest, typical_overlap)
    lens_sd = _lens_sd(equations, start, typical_overlap, rng)
    if lens_sd is not None:
        start = replace(start, lens=0.0)
    fit = fit_gaps(equations, start, typical_overlap, POSTERIOR_SAMPLES, rng)
    if width_gain(fit) < MIN_GAIN and (scale.found or _significant_parts(equations, fit)):
        # Only walls and scale are wrong: the grains stay where they were measured.
        held = fit_gaps(equations, replace(start, centre=0.0, radius=0.0), typical_overlap, 1, rng)
        fit = replace(held, sd=fit.sd, gap_sd=fit.gap_sd, priors=fit.priors)
    found = _assess(sequence, scale, equations, limits, width_ratio, fit, noise_ratio)
    return found if lens_sd is None else replace(found, lens_sd=lens_sd)


def _lens_sd(
    equations: GapEquations, priors: CalibrationPriors, overlap: float, rng: np.random.Generator
) -> float | None:
    """Compute the standard deviation of the lens from some photographs; None where its distortion is significant.

    Distortion resembles walls that are too far out, and is corrected only where it is significant.
    """
    if priors.lens == 0.0:
        return 0.0
    some = GapEquations(
        equations.sequence.thinned(LENS_FRAMES), equations.radius_class, walls_follow=equations.walls_follow
    )  # fmt: skip
    fit, lens = fit_gaps(some, priors, overlap, LENS_SAMPLES, rng), some.layout.lens
    value, sd = float(fit.unknowns[lens][0]), float(fit.sd[lens][0])
    return None if abs(value) > SIGNIFICANT_SDS * sd > 0.0 else sd


def default_priors(
    sequence: MeasuredSequence,
    *,
    pixel_size: float = 0.0,
    radius_class: float = 0.0,
    radius_offset: float = 0.0,
    radius_factor: float = 0.0,
) -> CalibrationPriors:
    """Build default priors; pixel_size, radius_class, radius_offset and radius_factor are relative."""
    radius = float(sequence.radius.mean())
    if sequence.cell is not None:  # a simulation: no camera, and its size is given with the positions
        pixel_size, lens = 0.0, 0.0
    else:
        lens = DEFAULT_LENS_SD * 2.0 * radius
    centre = DEFAULT_CENTRE_SD * 2.0 * radius
    return CalibrationPriors(
        centre, RADIUS_SD_FRACTION * centre, wall=DEFAULT_WALL_SD * 2.0 * radius, wall_tilt=DEFAULT_TILT_SD,
        pixel_size=pixel_size, lens=lens, radius_class=radius_class * radius,
        radius_offset=radius_offset * radius, radius_factor=radius_factor,
    )  # fmt: skip


def _assess(
    sequence: MeasuredSequence,
    scale: ScaleErrors,
    equations: GapEquations,
    limits: CalibrationPriors,
    width_ratio: float,
    fit: GapFit,
    noise_ratio: float,
) -> Calibration:
    layout, noise_factor = equations.layout, noise_ratio * fit.candidates.noise_factor
    given = measure_gaps(
        fit.candidates.rows, sequence.position, sequence.endpoints, sequence.radius, sequence.side, sequence.cell
    ).gap
    before = gap_statistics(given, fit)
    between, after = gap_statistics(fit.gap_before, fit), gap_statistics(fit.gap_after, fit)
    gain, significant = width_gain(fit), _significant_parts(equations, fit)
    applied = gain >= MIN_GAIN or bool(significant) or scale.found
    if not applied:
        after = between
    verdict = _verdict(applied, gain, list(dict.fromkeys(_scale_parts(scale) + significant)), before, after)
    verdict += _track_warning(noise_factor, after)
    if applied:
        verdict += _prior_warning(equations, limits, width_ratio, fit)
    unknowns = fit.unknowns if applied else np.zeros(layout.count)
    sd = fit.sd
    radius_sd = sd[layout.radius]
    if equations.radius_class is not None:
        radius_sd = np.hypot(radius_sd, sd[layout.radius_class][equations.radius_class])
    of_radii = scale.radius_factor_sd > 0.0
    refined = float(unknowns[layout.scale][0])
    shrunk = 1.0 + refined if of_radii else 1.0  # all lengths of the fit, so that positions stay as measured
    return Calibration(
        offset=unknowns[layout.offset].reshape(-1, 2) / shrunk,
        radius=equations.radius(unknowns) / shrunk - sequence.radius,
        wall=unknowns[layout.wall] / shrunk,
        wall_tilt=unknowns[layout.wall_tilt],
        radius_offset=scale.radius_offset / shrunk if applied else 0.0,
        pixel_size=0.0 if of_radii else (1.0 + scale.pixel_size) * (1.0 + refined) - 1.0,
        lens=float(unknowns[layout.lens][0]) / shrunk,
        walls_follow=scale.walls_follow and not of_radii,
        offset_sd=sd[layout.offset].reshape(-1, 2),
        radius_sd=radius_sd,
        wall_sd=sd[layout.wall],
        wall_tilt_sd=sd[layout.wall_tilt],
        pixel_size_sd=float(sd[layout.scale][0]) if scale.found and not of_radii else scale.pixel_size_sd,
        radius_offset_sd=scale.radius_offset_sd,
        lens_sd=float(sd[layout.lens][0]),
        gap_sd=fit.gap_sd,
        priors=fit.priors,
        noise_factor=noise_factor,
        before=before,
        after=after,
        rounds=ROUNDS,
        applied=applied,
        verdict=verdict,
        radius_factor=(1.0 + scale.radius_factor) / shrunk - 1.0 if of_radii else 0.0,
        radius_factor_sd=float(sd[layout.scale][0]) if of_radii else 0.0,
        walls_decide=scale.walls_decide,
    )


def _scale_parts(scale: ScaleErrors) -> list[str]:
    parts = [] if abs(scale.pixel_size) <= scale.pixel_size_sd else ["pixel size"]
    parts += [] if abs(scale.radius_offset) <= scale.radius_offset_sd else ["all radii alike"]
    if abs(scale.radius_factor) > scale.radius_factor_sd:
        parts.append("a factor of all radii")
    elif len(parts) and not scale.separable:
        parts = ["pixel size or all radii alike, which rods of one size cannot separate"]
    return parts + (["radius classes"] if np.any(np.abs(scale.radius_class) > scale.radius_class_sd) else [])


def _significant_parts(equations: GapEquations, fit: GapFit) -> list[str]:
    layout = equations.layout
    finest = FINEST_SURFACE * float(equations.sequence.radius.mean())
    parts = {
        "walls": (layout.wall, finest),
        "directions of walls": (layout.wall_tilt, FINEST_SURFACE),
        "lens": (layout.lens, finest),
        "radius classes": (layout.radius_class, finest),
    }
    return [
        name
        for name, (part, least) in parts.items()
        if np.any(np.abs(fit.unknowns[part]) > SIGNIFICANT_SDS * np.hypot(fit.sd[part], least))
    ]


def _verdict(applied: bool, gain: float, significant: list[str], before: GapStatistics, after: GapStatistics) -> str:
    widths = f"the gaps of touching grains change from {before.spread * 1e6:.1f} to {after.spread * 1e6:.1f} µm rms"
    if not applied:
        return f"not applied: {widths}, and no error of walls or scale is significant"
    reasons = [widths] if gain >= MIN_GAIN or after.spread < (1.0 - MIN_GAIN) * before.spread else []
    reasons += [f"significant errors: {', '.join(significant)}"] if significant else []
    return "applied: " + "; ".join(reasons or [widths])


def _track_warning(noise_factor: float, after: GapStatistics) -> str:
    """Describe noise above the stated one and impossible overlaps."""
    text = ""
    if noise_factor > EXCESSIVE_NOISE:
        text += f"; the noise of positions is {noise_factor:.1f} times the stated noise"
    if after.impossible > TOLERATED_IMPOSSIBLE:
        text += f"; {100 * after.impossible:.0f} % of the overlaps remain impossible: some tracks are wrong"
    return text


def _prior_warning(equations: GapEquations, limits: CalibrationPriors, width_ratio: float, fit: GapFit) -> str:
    """Describe errors that exceed their priors."""
    text = ""
    if width_ratio > EXCESSIVE_WIDTH:
        text += f"; the overlaps correspond to errors of grains {width_ratio:.1f} times wider than the prior"
    large = np.abs(fit.unknowns) > SIGNIFICANT_SDS * np.maximum(prior_vector(equations, limits), np.finfo(float).tiny)
    if np.any(large):
        text += (
            f"; {np.count_nonzero(large)} corrections exceed {SIGNIFICANT_SDS:.0f} standard deviations of their prior"
        )
    return text
