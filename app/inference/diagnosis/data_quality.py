"""Quality of the data, by the first photographs: noise over motion, sliding, ambiguous pairs and gaps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...solver.assessment.motion_information import DETECTABLE
from ...solver.bodies.grains import Grains
from ...solver.bodies.motion import Snapshot
from ...solver.bodies.rods import RodMaterial
from ...solver.bodies.strain import displacement_gradient, shear_strain
from ...solver.bodies.walls import Walls
from ...solver.contacts.contacts import Contacts, measure_pairs
from ...solver.contacts.kinematics import relative_motion
from ...solver.contacts.surface import typical_overlap
from ...solver.detection.displacement import displacement_scale
from ...solver.detection.precision import contradiction, measure_precision
from ...solver.detection.refinement import refine
from ...solver.detection.touch_probability import ContactProbabilitySettings
from ...solver.part_settings import REFERENCE_STEP, SLIP_SIGMAS
from ...solver.posterior.sequence_evidence import gather_position_evidence
from ...tracks import Tracks, WallTracks
from ..snapshots import grains_of, make_snapshots

EXAMINED_PHOTOGRAPHS = 3
UNCLEAR_GAPS = 0.009  # standard deviation of the gaps of touching grains over a diameter that hides the contacts
VISIBLE_OFFSET = 0.015  # mean gap of touching grains over the mean diameter, above which it is reported
HIDING_NOISE = 0.5  # noise over motion above which the motion has almost no information
SUFFICIENT_NOISE = 0.25  # the same below which it has enough
NO_SLIDING = 0.02  # fraction of sliding contacts below which the motion does not determine forces
# Fraction of sliding contacts from which on friction is tested: forces that only push explain the noise of contacts at
# rest worse than forces of either sign. Sheared packings slide at .2 and more; under a rising pressure, or nearly
# jammed, at less than .06, and there causes were named wrongly.
FEW_SLIDING = 0.1
COARSE_STEPS = 2.0  # of REFERENCE_STEP, beyond which closer photographs are advised
AMBIGUOUS = (0.05, 0.95)  # P(touch) between which a pair is ambiguous
TOUCHING = 0.5  # P(touch)
MOSTLY_CENTRES = 0.3  # of the noise, below which the motion adds less than a twentieth to it


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
    tracked_noise: float = math.nan  # [m] of the motion alone, by correlation; NaN: the tracks are given

    @property
    def noise_ratio(self) -> float:
        """Noise over motion."""
        return self.noise / self.motion if self.motion > 0.0 else math.inf

    @property
    def gaps_unclear(self) -> bool:
        """Whether the gaps of touching grains vary so much that contacts cannot be detected."""
        return self.gap_sd > UNCLEAR_GAPS * self.diameter

    def describe(self) -> list[str]:
        """Describe noise, motion, sliding and gaps in one to four sentences."""
        step = math.degrees(self.shear)
        lines = [
            f"First {self.photographs} photographs: positions have a noise of {1e6 * self.noise:.3g} µm"
            f"{self._describe_origin()}, and neighbours move by {1e6 * self.motion:.3g} µm in a step of {step:.2g}° of "
            f"shear; {_percent(self.sliding)} of the contacts slide by more than noise; {_percent(self.ambiguous)} of "
            "the candidate pairs are ambiguous: touching or not."
        ]
        if self.sliding <= FEW_SLIDING:
            lines.append("Too few slide to test the friction of rods and walls: it is used as given.")
        if self.gap_offset > VISIBLE_OFFSET * self.diameter:
            lines.append(
                f"Touching grains have a mean gap of {1e6 * self.gap_offset:.3g} µm, "
                f"{_percent(self.gap_offset / self.diameter)} of a diameter: all radii are "
                f"{0.5e6 * self.gap_offset:.3g} µm too small, or the pixel size is too large."
            )
        if self.shear > COARSE_STEPS * REFERENCE_STEP:
            lines.append(f"In steps of {math.degrees(REFERENCE_STEP):.2g}° forces could be followed between frames.")
        return lines

    def _describe_origin(self) -> str:
        """State where the noise comes from: the tables, or the errors of centres and of the motion in photographs."""
        other, stated = self.noise != self.stated_noise, f"{1e6 * self.stated_noise:.3g} µm"
        if math.isnan(self.tracked_noise):
            return f" (stated: {stated})" if other else ", as given"
        expected = f" (expected: {stated})" if other else ""
        return (
            f"{expected}, nearly all of which is one error of each centre in all photographs: motions have "
            f"{1e6 * self.tracked_noise:.2g} µm"
            if self.tracked_noise < MOSTLY_CENTRES * self.noise
            else f"{expected}, by the correlation"
        )

    @property
    def obstacle(self) -> str:
        """Why the motion does not determine the forces, with the cure; empty: it does."""
        if self.gaps_unclear:
            return (
                "the gaps of touching grains have a standard deviation of "
                f"{100.0 * self.gap_sd / self.diameter:.1f} % of a diameter, by noise or errors of centres and radii: "
                "they hardly show which grains touch"
            )
        if self.noise_ratio >= HIDING_NOISE:
            return (
                f"noise is {self.noise_ratio:.1f} of the motion between neighbours; use a step "
                f"{self.noise_ratio / SUFFICIENT_NOISE:.2g} times as large"
            )
        return "almost nothing slides; use a step with more shear" if self.sliding < NO_SLIDING else ""


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
    grains = grains_of(first)
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
        math.nan if first.centre_sigma is None else float(np.nanmedian(first.sigma)),
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
    return float((np.abs(slid[known]) > DETECTABLE * SLIP_SIGMAS * noise).mean()) if known.any() else math.nan


def _measure_gaps(tracks: Tracks, walls: WallTracks, snapshots: list[Snapshot], noise: float) -> tuple[float, float]:
    """Mean and standard deviation of the gaps of touching grains [m]; NaN without candidate pairs."""
    packing = RodMaterial().pack(tracks.radius, walls.usual_pressure(RodMaterial().length), boundary=tracks.boundary)
    try:
        found = gather_position_evidence(packing, [_with_sigma(each, noise) for each in snapshots]).touching
    except ValueError:
        return math.nan, math.nan
    return found.offset, found.sd
