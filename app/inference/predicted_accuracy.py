"""Accuracy predicted from the first photographs: whether their motion determines the forces.

Noise over motion, ambiguous pairs, sliding and gaps are measured on two or three photographs; the correlation r that
they lead to was fitted on simulated scenarios (`rodsight study budget --fit` repeats the fit).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..solver.bodies.grains import Grains
from ..solver.bodies.motion import Snapshot
from ..solver.bodies.rods import RodMaterial
from ..solver.bodies.strain import displacement_gradient, shear_strain
from ..solver.bodies.walls import Walls
from ..solver.contacts.contacts import Contacts, measure_pairs
from ..solver.contacts.kinematics import relative_motion
from ..solver.contacts.surface import typical_overlap
from ..solver.detection.displacement import displacement_scale
from ..solver.detection.precision import contradiction, measure_precision
from ..solver.detection.refinement import refine
from ..solver.detection.touch_probability import ContactProbabilitySettings
from ..solver.posterior.sequence_evidence import gather_position_evidence
from ..tracks import Tracks, WallTracks
from .snapshots import make_snapshots

EXAMINED_PHOTOGRAPHS = 3
NOT_PREDICTED = (
    "The accuracy of the forces is not predicted: a prediction needs grains and walls seen in two consecutive "
    "photographs, and no periodic cell."
)
# A large standard deviation of the gaps of touching grains hides the contacts, whatever the motion: its values over the
# mean diameter, and 1 − r, for simulated discs, for photoelastic discs, and for a ring of these.
GAP_SD = (0.009, 0.0125, 0.05)
GAP_ERROR = (0.05, 0.26, 0.85)
VISIBLE_OFFSET = 0.015  # mean gap of touching grains over the mean diameter, above which it is reported
NOISE_RATIOS = (0.05, 1.0)  # noise over motion, range of the fit
REFERENCE_STEP = math.radians(0.25)
HIDING_NOISE = 0.5  # noise over motion above which the motion has almost no information
SUFFICIENT_NOISE = 0.25  # the same below which it has enough
NO_SLIDING = 0.02  # fraction of sliding contacts below which the motion does not determine forces
COARSE_STEPS = 2.0  # reference steps beyond which forces cannot be followed
MANY_AMBIGUOUS = 0.5  # fraction of ambiguous pairs above which radii or centres must be found first
AMBIGUOUS = (0.05, 0.95)  # P(touch) between which a pair is ambiguous
TOUCHING = 0.5  # P(touch)
DETECTABLE = 3.0  # standard deviations of a measured sliding beyond which it is detected
SLIDING_SIGMAS = 2.8  # sd of a sliding over that of a position: two grains, translation and rotation, two photographs


@dataclass(frozen=True, slots=True)
class AccuracyFit:
    """Fit of ln(1 − r) = a + b ln(noise / motion) + c ln(max(step / .25°, 1)), and its standard deviation."""

    a: float
    b: float
    c: float
    sd: float


# Fitted on simulated scenarios, seeds 0, 1 and 3, with 10 to 100 µm of noise.
ACCURACY_FIT = AccuracyFit(-3.29, 0.235, 0.424, 0.45)


@dataclass(frozen=True, slots=True)
class DataQuality:
    """Quality of the data of a test, by its first two or three photographs."""

    photographs: int
    noise: float  # [m] standard deviation of a position component
    stated_noise: float  # [m]
    motion: float  # [m] typical displacement between neighbours in a step
    shear: float  # [rad] of a step
    sliding: float  # fraction of the touching pairs that slide by more than noise
    ambiguous: float  # fraction of the candidate pairs with an ambiguous P(touch)
    gap_offset: float  # [m] mean gap of touching grains by their radii
    gap_sd: float  # [m] standard deviation of these gaps: noise, errors of radii and centres, overlap
    diameter: float  # [m] mean

    @property
    def noise_ratio(self) -> float:
        """Noise over motion."""
        return self.noise / self.motion if self.motion > 0.0 else math.inf

    @property
    def expected(self) -> tuple[float, float, float]:
        """Expected r of the normal forces, by the fit, and the ends of an interval with a coverage of two thirds."""
        noise, steps = self.predictors
        error = ACCURACY_FIT.a + ACCURACY_FIT.b * noise + ACCURACY_FIT.c * steps
        if self.gaps_unclear:
            error = max(error, self._error_of_gaps)
        r, low, high = (max(1.0 - math.exp(error + k * ACCURACY_FIT.sd), 0.0) for k in (0.0, 1.0, -1.0))
        return r, low, high

    @property
    def predictors(self) -> tuple[float, float]:
        """ln(noise / motion) and ln(step / .25°), limited to the range of the fit."""
        noise = math.log(float(np.clip(self.noise_ratio, *NOISE_RATIOS)))
        return noise, math.log(max(self.shear / REFERENCE_STEP, 1.0))

    @property
    def gaps_unclear(self) -> bool:
        """Whether the gaps of touching grains vary so much that contacts cannot be detected."""
        return self.gap_sd > GAP_SD[0] * self.diameter

    @property
    def suffices(self) -> bool:
        """Whether the motion determines the forces."""
        return self.noise_ratio < HIDING_NOISE and not self.sliding < NO_SLIDING and not self.gaps_unclear

    @property
    def _error_of_gaps(self) -> float:
        """ln(1 − r) by the standard deviation of the gaps."""
        ratio = math.log(self.gap_sd / self.diameter)
        return float(np.interp(ratio, np.log(GAP_SD), np.log(GAP_ERROR)))

    def describe(self) -> list[str]:
        """Describe the quality of the data and the expected accuracy in two or three sentences."""
        step = math.degrees(self.shear)
        stated = "" if self.noise == self.stated_noise else f" (stated: {1e6 * self.stated_noise:.3g} µm)"
        lines = [
            f"First {self.photographs} photographs: positions have a noise of {1e6 * self.noise:.3g} µm{stated}, and "
            f"neighbours move by {1e6 * self.motion:.3g} µm in a step of {step:.2g}° of shear; "
            f"{_percent(self.sliding)} of the contacts slide by more than noise; {_percent(self.ambiguous)} of the "
            "candidate pairs are ambiguous: touching or not."
        ]
        if self.gap_offset > VISIBLE_OFFSET * self.diameter:
            lines.append(
                f"Touching grains have a mean gap of {1e6 * self.gap_offset:.3g} µm, "
                f"{_percent(self.gap_offset / self.diameter)} of a diameter: all radii are "
                f"{0.5e6 * self.gap_offset:.3g} µm too small, or the pixel size is too large."
            )
        r, low, high = self.expected
        expected = f"expected r(f_n) {r:.2f} ({low:.2f} to {high:.2f})"
        if self.gaps_unclear:
            return [
                *lines,
                "These data hardly show which grains touch: the gaps of touching grains have a standard deviation of "
                f"{100.0 * self.gap_sd / self.diameter:.1f} % of a diameter, by noise or errors of centres and radii; "
                f"{expected}.",
            ]
        if self.suffices:
            return [*lines, f"The motion determines the forces: {expected}{self._advice()}."]
        if self.noise_ratio >= HIDING_NOISE:
            why = (
                f"noise is {self.noise_ratio:.1f} of the motion between neighbours; use a step "
                f"{self.noise_ratio / SUFFICIENT_NOISE:.2g} times as large"
            )
        else:
            why = "almost nothing slides; use a step with more shear"
        return [*lines, f"The motion alone does not determine the forces: {why}. Positions are used as well."]

    def _advice(self) -> str:
        if self.shear > COARSE_STEPS * REFERENCE_STEP:
            return f"; in steps of {math.degrees(REFERENCE_STEP):.2g}° forces could be followed from frame to frame"
        if self.ambiguous > MANY_AMBIGUOUS:
            return "; radii or centres are wrong by more than noise: calibration on all photographs can find the errors"
        return ""


def measure_data_quality(tracks: Tracks, walls: WallTracks | None) -> DataQuality | None:
    """Measure the first photographs; None with fewer than two, too few grains, or in a periodic cell."""
    if walls is not None and walls.cell is not None:
        return None  # pairs across its edges are not measured here
    count = min(EXAMINED_PHOTOGRAPHS, tracks.frame_count)
    first = tracks.frames(0, count)
    ends = WallTracks((), np.empty((count, 0, 2, 2)), np.empty(0)) if walls is None else walls.frames(0, count)
    if count < 2 or not np.isfinite(ends.endpoints).all() or int(first.present.all(axis=0).sum()) < 4:
        return None
    snapshots = make_snapshots(first, ends)
    grains = Grains.of_rods(first.radius, density=1.0, length=1.0)
    stated = float(np.median(first.position_sigma))
    found = measure_precision(grains, snapshots)
    noise = stated if found is None else stated * contradiction(found, stated)
    overlap = typical_overlap(first.radius) if found is None else found.overlap
    settings = ContactProbabilitySettings(overlap=overlap)
    block = refine(grains, [_with_sigma(each, noise) for each in snapshots], settings)
    touch = block.touch[1]
    possible, touching = touch > AMBIGUOUS[0], touch > TOUCHING
    contacts = measure_pairs(grains, snapshots[1].position, Walls.at_rest(snapshots[1].endpoints), block.key[touching])
    both = snapshots[0].present & snapshots[1].present
    moved = np.where(both[:, None], snapshots[1].position - snapshots[0].position, np.nan)
    gradient = displacement_gradient(snapshots[0].position, moved, both)
    seen = [np.where(both[:, None], each.position, np.nan) for each in snapshots[:2]]
    gap_offset, gap_sd = _measure_gaps(first, ends, snapshots, noise)
    return DataQuality(
        count, noise, stated,
        displacement_scale(seen[0], seen[1], np.full(grains.count, noise)),
        shear_strain(0.5 * (gradient + gradient.T)),
        _sliding(contacts, grains, snapshots, noise),
        float((possible & (touch < AMBIGUOUS[1])).sum() / max(possible.sum(), 1)),
        gap_offset,
        gap_sd,
        2.0 * float(first.radius.mean()),
    )  # fmt: skip


def _percent(value: float) -> str:
    return "an unknown fraction" if math.isnan(value) else f"{100.0 * value:.0f} %"


def _with_sigma(snapshot: Snapshot, sigma: float) -> Snapshot:
    return Snapshot(
        snapshot.time, snapshot.position, snapshot.rotation, snapshot.present, snapshot.endpoints, sigma
    )  # fmt: skip


def _sliding(contacts: Contacts, grains: Grains, snapshots: list[Snapshot], noise: float) -> float:
    """Fraction of the contacts that slide by more than noise in the first step; NaN without contacts."""
    before, after = snapshots[:2]
    walls = Walls(after.endpoints, after.endpoints - before.endpoints, np.full(len(after.endpoints), np.nan))
    both = (before.present & after.present)[:, None]
    _, slid = relative_motion(
        contacts, grains.radius, np.where(both, after.position - before.position, np.nan),
        after.rotation - before.rotation, walls,
    )  # fmt: skip
    known = np.isfinite(slid)
    return float((np.abs(slid[known]) > DETECTABLE * SLIDING_SIGMAS * noise).mean()) if known.any() else math.nan


def _measure_gaps(tracks: Tracks, walls: WallTracks, snapshots: list[Snapshot], noise: float) -> tuple[float, float]:
    """Mean and standard deviation of the gaps of touching grains [m]; NaN without candidate pairs."""
    packing = RodMaterial().pack(tracks.radius, walls.usual_pressure(RodMaterial().length), boundary=tracks.boundary)
    try:
        found = gather_position_evidence(packing, [_with_sigma(each, noise) for each in snapshots]).touching
    except ValueError:
        return math.nan, math.nan
    return found.offset, found.sd
