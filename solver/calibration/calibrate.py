"""Self-calibration: constant errors of centres, radii, walls and pixel size, found from the gaps of a sequence.

Rigid grains neither overlap nor, where they carry force, stand apart. What all grains share is found first: a wrong
pixel size, a mistaken radius of a whole class. Then what each has for itself. A centre that is wrong by a constant,
body-fixed amount opens and closes gaps in a way that turns with the grain and changes with its neighbours, so many
photographs reveal it. The gap equations are solved by robust, one-sided, iteratively re-weighted least squares: a
positive gap g counts as (1 + (g/s)²)⁻², an overlap in full unless only a wrong track can explain it, and s shrinks
from the scale of the errors to that of the noise. Gaussian priors hold whatever the sequence does not determine.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.quantity import Quantity
from solver.calibration.equations import GapEquations, bulge, move_walls, rotate_offsets
from solver.calibration.fit import ROUNDS, GapFit, fit_gaps
from solver.calibration.gaps import MeasuredSequence, measure_gaps
from solver.calibration.priors import FINEST_SURFACE, CalibrationPriors, narrow_priors, prior_vector
from solver.calibration.scale import ScaleErrors, find_scale
from solver.calibration.statistics import GapStatistics, gap_statistics, width_gain

LEAST_GAIN = 0.1  # corrections that narrow the gaps of touching pairs by less are not worth their own noise
CERTAIN = 3.0  # standard deviations beyond which a correction is called sure, or larger than its prior allows
EXCESSIVE_NOISE = 1.3  # true over stated noise: above this the user is told …
MISJUDGED_NOISE = 2.0  # … and above this everything is judged anew
TOLERATED_IMPOSSIBLE = 0.02  # share of the overlaps: above this the user is told
EXCESSIVE_DEMAND = 2.0  # errors that the overlaps suggest, over the prior: above this the user is told
LENS_FRAMES = 16  # photographs that tell whether the lens matters
LENS_SAMPLES = 30  # draws behind its standard deviation there
POSTERIOR_SAMPLES = 100  # draws behind each standard deviation: known to 7 %
EXPECTED_CENTRE = 1e-2  # widest prior without being told, of the mean diameter; the overlaps then narrow it
EXPECTED_WALL = 3e-3  # prior of a wall without being told, of the mean diameter
EXPECTED_TILT = 5e-4  # [rad] prior of a wall's direction without being told
EXPECTED_LENS = 1e-2  # prior of the displacement by the lens at the farthest corner, of the mean diameter
RADIUS_SHARE = 0.5  # prior of a radius over that of a centre without being told; the data then reduce either


@dataclass(frozen=True, slots=True)
class Calibration:
    """Constant errors found in a sequence. Add the corrections to what was measured."""

    offset: Annotated[Array, Quantity("from measured to true centre, turning with the grain", "m", "grain xy")]
    radius: Annotated[Array, Quantity("from given to true radius", "m", "grain")]
    # A dataset must not be called as a dimension is: netCDF would take it for the labels of that.
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
    gap_sd: Annotated[float, Quantity("what the errors left do to a gap, noise apart", "m")]
    priors: CalibrationPriors  # those used: never wider than given, narrower where the gaps say so
    noise_factor: Annotated[float, Quantity("noise that the corrected gaps show over that stated")]
    before: GapStatistics
    after: GapStatistics  # with the corrections, whether they are applied or not
    rounds: Annotated[int, Quantity("times that contacts were looked for again", absent=0)]
    applied: Annotated[bool, Quantity("whether the corrections were applied; if not, all are zero", absent=True)]
    verdict: Annotated[str, Quantity("why it was applied or not, for the user", absent="")]

    def position_sd(self, sigma: float) -> float:
        """Standard deviation [m] of a position for contact detection: stated noise `sigma` [m] and what is left.

        The gap of a touching pair has √2 times this standard deviation.
        """
        return float(np.hypot(self.noise_factor * sigma, self.gap_sd / np.sqrt(2.0)))

    def of_grains(self, count: int) -> Calibration:
        """The same for `count` grains: those after the ones that were calibrated were not corrected at all."""
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
        """Apply the corrections: centres, radii and walls of the sequence they were found in."""
        scale = 1.0 + self.pixel_size
        endpoints = scale * sequence.endpoints if self.walls_follow else sequence.endpoints
        return MeasuredSequence(
            sequence.radius + self.radius,
            scale * sequence.position + self.lens * bulge(sequence) + rotate_offsets(sequence, self.offset),
            sequence.rotation,
            sequence.present,
            move_walls(endpoints, self.wall, self.wall_tilt, sequence.side),
            sequence.sigma,
            sequence.side,
            sequence.cell,
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
    limits = expected_priors(sequence) if priors is None else priors
    found = _calibrate(sequence, limits, rng, typical_overlap, radius_class, 1.0)
    if found.noise_factor < MISJUDGED_NOISE:
        return found
    # With noise taken for errors of centres, what looks like a gain is none: judge it by the noise that is there.
    louder = replace(sequence, sigma=found.noise_factor * sequence.sigma)
    return _calibrate(louder, limits, rng, typical_overlap, radius_class, found.noise_factor)


def _calibrate(
    sequence: MeasuredSequence,
    limits: CalibrationPriors,
    rng: np.random.Generator,
    typical_overlap: float,
    radius_class: NDArray[np.integer] | None,
    raised: float,
) -> Calibration:
    """One pass; raised: the noise of `sequence` over that stated."""
    scale = find_scale(sequence, limits, typical_overlap, radius_class)
    equations = GapEquations(scale.correct(sequence, radius_class), radius_class, walls_follow=scale.walls_follow)
    # A scale that may be right is not touched; one that was wrong is known to its standard deviation now.
    rest = replace(
        limits, pixel_size=scale.pixel_size_sd if scale.found else 0.0, radius_class=0.0,
        radius_offset=0.0,
    )  # fmt: skip
    start, demand = narrow_priors(equations, rest, typical_overlap)
    lens_sd = _lens_sd(equations, start, typical_overlap, rng)
    if lens_sd is not None:
        start = replace(start, lens=0.0)
    fit = fit_gaps(equations, start, typical_overlap, POSTERIOR_SAMPLES, rng)
    if width_gain(fit) < LEAST_GAIN and (scale.found or _certain_parts(equations, fit)):
        # What is wrong belongs to walls and scale alone: the grains stay where they were measured.
        held = fit_gaps(equations, replace(start, centre=0.0, radius=0.0), typical_overlap, 1, rng)
        fit = replace(held, sd=fit.sd, gap_sd=fit.gap_sd, priors=fit.priors)
    found = _judge(sequence, scale, equations, limits, demand, fit, raised)
    return found if lens_sd is None else replace(found, lens_sd=lens_sd)


def _lens_sd(
    equations: GapEquations, priors: CalibrationPriors, overlap: float, rng: np.random.Generator
) -> float | None:
    """How well some of the photographs tell the lens; None where they show that it surely bends the picture.

    It looks much like walls that stand too far out, so that it is left alone unless it is needed.
    """
    if priors.lens == 0.0:
        return 0.0
    some = GapEquations(
        equations.sequence.thinned(LENS_FRAMES), equations.radius_class, walls_follow=equations.walls_follow
    )  # fmt: skip
    fit, lens = fit_gaps(some, priors, overlap, LENS_SAMPLES, rng), some.layout.lens
    value, sd = float(fit.unknowns[lens][0]), float(fit.sd[lens][0])
    return None if abs(value) > CERTAIN * sd > 0.0 else sd


def expected_priors(
    sequence: MeasuredSequence, *, pixel_size: float = 0.0, radius_class: float = 0.0, radius_offset: float = 0.0
) -> CalibrationPriors:
    """What to think of errors nobody was told about; pixel_size, radius_class and radius_offset are relative."""
    radius = float(sequence.radius.mean())
    if sequence.cell is not None:  # no camera saw it, and its size is told with the positions
        pixel_size, lens = 0.0, 0.0
    else:
        lens = EXPECTED_LENS * 2.0 * radius
    centre = EXPECTED_CENTRE * 2.0 * radius
    return CalibrationPriors(
        centre, RADIUS_SHARE * centre, wall=EXPECTED_WALL * 2.0 * radius, wall_tilt=EXPECTED_TILT,
        pixel_size=pixel_size, lens=lens, radius_class=radius_class * radius,
        radius_offset=radius_offset * radius,
    )  # fmt: skip


def _judge(
    sequence: MeasuredSequence,
    scale: ScaleErrors,
    equations: GapEquations,
    limits: CalibrationPriors,
    demand: float,
    fit: GapFit,
    raised: float,
) -> Calibration:
    layout, noise_factor = equations.layout, raised * fit.candidates.noise_factor
    given = measure_gaps(
        fit.candidates.rows, sequence.position, sequence.endpoints, sequence.radius, sequence.side, sequence.cell
    ).gap
    before = gap_statistics(given, fit)
    between, after = gap_statistics(fit.gap_before, fit), gap_statistics(fit.gap_after, fit)
    gain, certain = width_gain(fit), _certain_parts(equations, fit)
    applied = gain >= LEAST_GAIN or bool(certain) or scale.found
    if not applied:
        after = between
    verdict = _verdict(applied, gain, list(dict.fromkeys(_scale_parts(scale) + certain)), before, after)
    verdict += _track_warning(noise_factor, after)
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
        wall_tilt=unknowns[layout.wall_tilt],
        radius_offset=scale.radius_offset if applied else 0.0,
        pixel_size=(1.0 + scale.pixel_size) * (1.0 + float(unknowns[layout.scale][0])) - 1.0,
        lens=float(unknowns[layout.lens][0]),
        walls_follow=scale.walls_follow,
        offset_sd=sd[layout.offset].reshape(-1, 2),
        radius_sd=radius_sd,
        wall_sd=sd[layout.wall],
        wall_tilt_sd=sd[layout.wall_tilt],
        pixel_size_sd=float(sd[layout.scale][0]) if scale.found else scale.pixel_size_sd,
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
    )


def _scale_parts(scale: ScaleErrors) -> list[str]:
    parts = [] if abs(scale.pixel_size) <= scale.pixel_size_sd else ["pixel size"]
    parts += [] if abs(scale.radius_offset) <= scale.radius_offset_sd else ["all radii alike"]
    if len(parts) and not scale.told_apart:
        parts = ["pixel size or all radii alike, which rods of one size cannot tell"]
    return parts + (["radius classes"] if np.any(np.abs(scale.radius_class) > scale.radius_class_sd) else [])


def _certain_parts(equations: GapEquations, fit: GapFit) -> list[str]:
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
        if np.any(np.abs(fit.unknowns[part]) > CERTAIN * np.hypot(fit.sd[part], least))
    ]


def _verdict(applied: bool, gain: float, certain: list[str], before: GapStatistics, after: GapStatistics) -> str:
    widths = f"the gaps of touching grains go from {before.spread * 1e6:.1f} to {after.spread * 1e6:.1f} µm rms"
    if not applied:
        return f"not applied: nothing to gain, {widths} and no wall or scale is surely wrong"
    reasons = [widths] if gain >= LEAST_GAIN or after.spread < (1.0 - LEAST_GAIN) * before.spread else []
    reasons += [f"surely wrong before: {', '.join(certain)}"] if certain else []
    return "applied: " + "; ".join(reasons or [widths])


def _track_warning(noise_factor: float, after: GapStatistics) -> str:
    """Say what the tracks promise and do not keep."""
    text = ""
    if noise_factor > EXCESSIVE_NOISE:
        text += f"; positions scatter {noise_factor:.1f} times as much as stated"
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
