"""What the first photographs promise before anything is computed: whether their motion can carry forces.

Noise against motion, pairs of which nobody can say whether they touch, sliding and overlap are read from two or three
photographs; what r they lead to was fitted on simulated worlds (`rodsight study budget` prints it anew).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Grains
from solver.bodies.motion import Snapshot
from solver.bodies.rods import RodMaterial
from solver.bodies.strain import displacement_gradient, shear_of
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts, measure_pairs
from solver.contacts.kinematics import relative_motion
from solver.detection.displacement import displacement_scale
from solver.detection.precision import contradiction, measure_precision
from solver.detection.refinement import refine
from solver.detection.touch_probability import ContactProbabilitySettings
from solver.posterior.sequence_evidence import gather_evidence
from solver.sequence.settings import typical_overlap

from ..tracks import Tracks, WallTracks
from .snapshots import make_snapshots

LOOKED_AT = 3  # photographs
UNPROMISED = (
    "What forces to expect is not told: that takes grains and walls that are seen in two photographs in a row, and no "
    "periodic cell."
)
# Where the gaps of touching grains scatter by too much nobody can tell who touches, whatever the motion: scatter over
# the mean diameter, and 1 − r as it was with simulated discs, with photoelastic discs, and with a ring of these.
GAP_SCATTER = (0.009, 0.0125, 0.05)
GAP_ERROR = (0.05, 0.26, 0.85)
APART = 0.015  # mean diameters that touching grains stand apart from which on it is said
NOISE_SHARES = (0.05, 1.0)  # between which noise over motion counts
REFERENCE_STEP = math.radians(0.25)
HIDDEN = 0.5  # noise over motion from which on the motion tells next to nothing
CLEAR = 0.25  # the same where it tells enough
STILL = 0.02  # share of sliding contacts below which nothing slides
COARSE = 2.0  # reference steps beyond which forces cannot be followed
DOUBTFUL = 0.5  # ambiguous share from which on radii or centres must be found first
AMBIGUOUS = (0.05, 0.95)  # P(touch) between which nobody can say
TOUCHES = 0.5
SLIDES = 3.0  # standard deviations of a sliding from which on it is seen
SLIDING_SIGMAS = 2.8  # of a position: two grains that move and turn, two photographs


@dataclass(frozen=True, slots=True)
class Promise:
    """ln(1 − r) = a + b ln(noise / motion) + c ln(step / .25°) where the step is larger; its standard deviation."""

    a: float
    b: float
    c: float
    sd: float


# Fitted on simulated worlds, seeds 0, 1 and 3, with 10 to 100 µm of noise.
EXPECTED = Promise(-3.29, 0.235, 0.424, 0.45)


@dataclass(frozen=True, slots=True)
class DataBudget:
    """What two or three photographs tell of a whole test."""

    photographs: int
    noise: float  # [m] standard deviation of a position component
    noise_told: float  # [m] as it was stated
    motion: float  # [m] typical displacement between neighbours in a step
    shear: float  # [rad] of a step
    sliding: float  # share of touching pairs that slide by more than noise
    ambiguous: float  # share of the pairs that may touch of which nobody can say whether they do
    apart: float  # [m] at which touching grains stand, by their radii
    scatter: float  # [m] of these gaps: noise, errors of radii and centres, overlap
    diameter: float  # [m] mean

    @property
    def noise_share(self) -> float:
        """Noise over motion."""
        return self.noise / self.motion if self.motion > 0.0 else math.inf

    @property
    def expected(self) -> tuple[float, float, float]:
        """r that such data led to on simulated worlds, and the interval that two of three lie in: r, low, high."""
        noise, steps = self.witnesses
        error = EXPECTED.a + EXPECTED.b * noise + EXPECTED.c * steps
        if self.coarse:
            error = max(error, self._error_of_gaps)
        r, low, high = (max(1.0 - math.exp(error + k * EXPECTED.sd), 0.0) for k in (0.0, 1.0, -1.0))
        return r, low, high

    @property
    def witnesses(self) -> tuple[float, float]:
        """ln(noise / motion) and ln(step / .25°), within what counts."""
        noise = math.log(float(np.clip(self.noise_share, *NOISE_SHARES)))
        return noise, math.log(max(self.shear / REFERENCE_STEP, 1.0))

    @property
    def coarse(self) -> bool:
        """Whether the gaps of touching grains scatter by so much that nobody can tell who touches."""
        return self.scatter > GAP_SCATTER[0] * self.diameter

    @property
    def suffices(self) -> bool:
        """Whether the motion can carry forces."""
        return self.noise_share < HIDDEN and not self.sliding < STILL and not self.coarse

    @property
    def _error_of_gaps(self) -> float:
        """ln(1 − r) that the scatter of gaps leads to."""
        scatter = math.log(self.scatter / self.diameter)
        return float(np.interp(scatter, np.log(GAP_SCATTER), np.log(GAP_ERROR)))

    def describe(self) -> list[str]:
        """What was found and what it means, in two or three sentences."""
        step = math.degrees(self.shear)
        told = "" if self.noise == self.noise_told else f" (told {1e6 * self.noise_told:.3g})"
        lines = [
            f"First {self.photographs} photographs: noise {1e6 * self.noise:.3g} µm{told} against "
            f"{1e6 * self.motion:.3g} µm that neighbours move in a step of {step:.2g}° of shear; "
            f"{_share(self.sliding)} of the contacts slide by more than noise; of {_share(self.ambiguous)} of the near "
            "pairs nobody can say yet whether they touch."
        ]
        if self.apart > APART * self.diameter:
            lines.append(
                f"Touching grains stand {1e6 * self.apart:.3g} µm apart, {_share(self.apart / self.diameter)} of a "
                f"diameter: all radii look {0.5e6 * self.apart:.3g} µm too small, or the pixel size too large."
            )
        r, low, high = self.expected
        expected = f"expected r(f_n) {r:.2f} ({low:.2f} to {high:.2f})"
        if self.coarse:
            scatter = f"{100.0 * self.scatter / self.diameter:.1f} % of a diameter"
            return [
                *lines,
                f"These data hardly tell who touches, because the gaps of touching grains scatter by {scatter}, "
                f"which noise, centres and radii must not: {expected}.",
            ]
        if self.suffices:
            return [*lines, f"These data can carry forces from motion: {expected}{self._advice()}."]
        if self.noise_share >= HIDDEN:
            enough = f"a step {self.noise_share / CLEAR:.2g} times as large would"
            why = f"because noise is {self.noise_share:.1f} of what neighbours move; {enough}"
        else:
            why = "because next to nothing slides; a step with more shear would"
        return [*lines, f"These data cannot carry forces from motion alone, {why}. Positions are asked besides."]

    def _advice(self) -> str:
        if self.shear > COARSE * REFERENCE_STEP:
            return f"; steps of {math.degrees(REFERENCE_STEP):.2g}° would let forces be followed from frame to frame"
        if self.ambiguous > DOUBTFUL:
            return "; radii or centres are wrong by more than noise, which all photographs together will tell"
        return ""


def measure_budget(tracks: Tracks, walls: WallTracks | None) -> DataBudget | None:
    """What the first photographs of these tracks tell; None with fewer than two, too few grains, or in a cell."""
    if walls is not None and walls.cell is not None:
        return None  # pairs across its edges would have to be measured otherwise
    count = min(LOOKED_AT, tracks.frame_count)
    first = tracks.frames(0, count)
    ends = WallTracks((), np.empty((count, 0, 2, 2)), np.empty(0)) if walls is None else walls.frames(0, count)
    if count < 2 or not np.isfinite(ends.endpoints).all() or int(first.present.all(axis=0).sum()) < 4:
        return None
    snapshots = make_snapshots(first, ends)
    grains = Grains.of_rods(first.radius, density=1.0, length=1.0)
    told = float(np.median(first.position_sigma))
    found = measure_precision(grains, snapshots)
    noise = told if found is None else told * contradiction(found, told)
    overlap = typical_overlap(first.radius) if found is None else found.overlap
    settings = ContactProbabilitySettings(overlap=overlap)
    block = refine(grains, [_with_sigma(each, noise) for each in snapshots], settings)
    touch = block.touch[1]
    possible, touching = touch > AMBIGUOUS[0], touch > TOUCHES
    contacts = measure_pairs(grains, snapshots[1].position, Walls.at_rest(snapshots[1].endpoints), block.key[touching])
    both = snapshots[0].present & snapshots[1].present
    moved = np.where(both[:, None], snapshots[1].position - snapshots[0].position, np.nan)
    gradient = displacement_gradient(snapshots[0].position, moved, both)
    seen = [np.where(both[:, None], each.position, np.nan) for each in snapshots[:2]]
    apart, scatter = _touching(first, ends, snapshots, noise)
    return DataBudget(
        count, noise, told,
        displacement_scale(seen[0], seen[1], np.full(grains.count, noise)),
        shear_of(0.5 * (gradient + gradient.T)),
        _sliding(contacts, grains, snapshots, noise),
        float((possible & (touch < AMBIGUOUS[1])).sum() / max(possible.sum(), 1)),
        apart,
        scatter,
        2.0 * float(first.radius.mean()),
    )  # fmt: skip


def _share(value: float) -> str:
    return "an unknown share" if math.isnan(value) else f"{100.0 * value:.0f} %"


def _with_sigma(snapshot: Snapshot, sigma: float) -> Snapshot:
    return Snapshot(
        snapshot.time, snapshot.position, snapshot.rotation, snapshot.present, snapshot.endpoints, sigma
    )  # fmt: skip


def _sliding(contacts: Contacts, grains: Grains, snapshots: list[Snapshot], noise: float) -> float:
    """Share of the contacts that slide by more than noise in the first step; NaN without contacts."""
    before, after = snapshots[:2]
    walls = Walls(after.endpoints, after.endpoints - before.endpoints, np.full(len(after.endpoints), np.nan))
    both = (before.present & after.present)[:, None]
    _, slid = relative_motion(
        contacts, grains.radius, np.where(both, after.position - before.position, np.nan),
        after.rotation - before.rotation, walls,
    )  # fmt: skip
    known = np.isfinite(slid)
    return float((np.abs(slid[known]) > SLIDES * SLIDING_SIGMAS * noise).mean()) if known.any() else math.nan


def _touching(tracks: Tracks, walls: WallTracks, snapshots: list[Snapshot], noise: float) -> tuple[float, float]:
    """Where touching grains stand apart by their radii [m], and how their gaps scatter [m]; NaN without near pairs."""
    packing = RodMaterial().pack(tracks.radius, walls.usual_pressure(RodMaterial().length), boundary=tracks.boundary)
    try:
        found = gather_evidence(packing, [_with_sigma(each, noise) for each in snapshots]).touching
    except ValueError:
        return math.nan, math.nan
    return found.offset, found.deviation
