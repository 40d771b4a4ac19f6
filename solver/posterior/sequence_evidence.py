"""Evidence of a sequence for each of its frames, without motion: smoothed gaps without errors that all gaps share.

The same equations serve hard and soft grains: the variance of touching gaps is that of residual noise, errors of
centres and radii, and overlap. The overlap's part follows from the mean gap, because the standard deviation of contact
forces is nearly their mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from ..bodies.grains import Array
from ..bodies.motion import Snapshot
from ..bodies.packing import Packing
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts, measure_pairs
from ..contacts.pairs import Keys, are_among
from ..contacts.verdicts import NO_VERDICTS, Verdicts
from ..even_subset import even_subset
from .candidate_gaps import OPEN_REACH, find_candidate_gaps, pair_covariates
from .error_variances import ErrorVariances, estimate_error_variances
from .frame_evidence import FrameEvidence, KnownForces
from .fringe_calibration import FringeCalibration
from .gap_series import GapNoise, GapSeries
from .posterior_settings import PosteriorSettings
from .touching_gaps import TouchingGaps

REACH = 6.0  # standard deviations of a gap, beyond OPEN_REACH
FORCE_SD = 0.8  # standard deviation of contact forces over their mean
SHARED_ERROR_SDS = 1.0  # mean touching gap over its standard deviation above which all gaps must share an error
VARIANCE_FRAMES = 8  # photographs used to separate errors of radii from errors of centres
REVIEWED_PRIOR = 0.99  # prior probability of bearing of a pair that a reviewer saw touch
IGNORED_OVERLAP_SDS = 2.0**0.5  # centre errors over the standard deviation of touching gaps, without overlaps
NO_COMPLIANCE = 1e-6  # mean diameters per force unit: overlaps that show no forces
GAP_LAW_FRACTION = 0.12  # b over the centres' standard deviation: below it the sampler mixes badly


@dataclass(frozen=True, slots=True)
class SequenceEvidence:
    """Smoothed gaps of a sequence, with the noise, errors and softness that follow from them."""

    packing: Packing
    snapshots: Sequence[Snapshot]
    key: Keys  # (c,) pairs within reach in some frame, ascending
    gap: Float[Array, "f c"]  # [m] smoothed and corrected; NaN where a grain is missing
    unsmoothed: Float[Array, "f c"]  # [m] the same without smoothing: its noise is independent between frames
    noise: GapNoise
    touching: TouchingGaps  # before the correction
    reach: float  # [m] of corrected gaps
    radius_correction: Float[Array, " n"]  # [m] an error that all gaps share, per radius; zero if none was subtracted
    centre_sd: Float[Array, " f"]  # [m] standard deviation of an error of a centre's coordinate
    radius_sd: float  # [m] of an error of a radius
    offset_sd: float  # [m] of an error that all gaps still share
    settings: PosteriorSettings  # with the standard deviations and reach of the sequence

    def of_frame(
        self,
        k: int,
        *,
        verdicts: Verdicts = NO_VERDICTS,
        fringes: FringeCalibration | None = None,
    ) -> FrameEvidence:
        """Assemble the evidence of frame k.

        Parameters
        ----------
        k : int
            Frame.
        verdicts : Verdicts
            Reviewed pairs: forbidden ones are left out, forced ones have the prior probability REVIEWED_PRIOR.
        fringes : FringeCalibration, optional
            Curve by which the fringes of discs show their pressures.
        """
        packing, snapshot = self.packing.at_frame(self.snapshots, k), self.snapshots[k]
        walls = packing.walls_of(snapshot)
        with np.errstate(invalid="ignore"):
            near = self.gap[k] < self.reach
        reviewed = are_among(self.key, verdicts.forced)
        rows = np.flatnonzero((near | (reviewed & np.isfinite(self.gap[k]))) & ~are_among(self.key, verdicts.forbidden))
        contacts = measure_pairs(packing.grains, snapshot.position, walls, self.key[rows])
        contacts = replace(contacts, gap=self.gap[k, rows])
        n = packing.grains.count
        known = _known_forces(packing, walls, contacts)
        pressure, pressure_sd = self._pressures(k, fringes)
        return FrameEvidence(
            contacts=contacts,
            prior=np.where(reviewed[rows], REVIEWED_PRIOR, self.touching.touching_fraction[k]),
            friction=packing.material.friction_at(contacts.with_wall),
            radius=packing.grains.radius,
            centre_sd=np.full(n, self.centre_sd[k]),
            radius_sd=np.full(n, self.radius_sd),
            balanced=snapshot.present & packing.grains.free,
            edge=None if packing.grains.boundary is None else snapshot.present & packing.grains.boundary,
            known=known,
            pressure=pressure,
            pressure_sd=pressure_sd,
            pressure_scale=np.nan if fringes is None or known.scale_known else fringes.scale.get(k, 1.0),
            pressure_correlation=np.nan if fringes is None else fringes.correlation,
        )

    def without_overlaps(self) -> SequenceEvidence:
        """Return the evidence in which gaps show which pairs are near, and not how strongly they press.

        The variance of touching gaps is then all error of the centres.
        """
        error = np.maximum(self.centre_sd, IGNORED_OVERLAP_SDS * self.touching.sd)
        settings = replace(self.settings, compliance=0.0, compliance_sd=NO_COMPLIANCE)
        return replace(self, centre_sd=error, settings=settings)

    def complete_discs(self, k: int) -> Bool[np.ndarray, " n"]:
        """Mark the discs of frame k (n,) whose fringes count: present, and with all their forces among the pairs."""
        packing, snapshot = self.packing.at_frame(self.snapshots, k), self.snapshots[k]
        complete = snapshot.present & packing.grains.free
        return complete if packing.grains.boundary is None else complete & ~packing.grains.boundary

    def _pressures(self, k: int, fringes: FringeCalibration | None) -> tuple[Array | None, Array | None]:
        seen = self.snapshots[k].fringes
        if fringes is None or seen is None:
            return None, None
        return fringes.pressure(k, np.where(self.complete_discs(k), seen, np.nan))


def gather_position_evidence(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: PosteriorSettings | None = None,
    *,
    shared_error: float = 0.0,
    soft: bool = False,
) -> SequenceEvidence:
    """Gather the evidence of a sequence from its positions.

    Parameters
    ----------
    packing : Packing
        Grains, material and loads.
    snapshots : sequence of Snapshot
        Positions; their `sigma` is used where too few photographs determine the noise.
    settings : PosteriorSettings, optional
        Settings of the posterior before the sequence's own standard deviations replace them.
    shared_error : float
        Standard deviation [m] of an error that all gaps may share (radii, pixel size, perspective). 0: calibrated; an
        error is then subtracted only where touching pairs stand apart, which no overlap explains.
    soft : bool
        Whether forces follow from overlaps, so that only errors of radii that last over the photographs count.

    Raises
    ------
    ValueError
        If no two bodies are near.

    Notes
    -----
    With a and s the mean and standard deviation of touching gaps, o = max(−a, 0) the mean overlap (0 where a shared
    error was subtracted), σ_r² and σ_cc² the variances of radii and centres by `error_variances`, v the noise of a gap
    (at most that stated) and ν the fraction of it that smoothing leaves, the variance of a centre's coordinate is

        σ_c² = max((1 − u) d + u min(σ_cc², d), ½ ν v),
        d = ½ max(s² − (0.8 o)² − 2 σ_r², 0),  u = min(1, 2 σ_r²/(σ_r² + d)),

    and the posterior has b = 0.12 × the median of σ_c, ℓ = the reach, σ_o = the standard error of a where corrected.
    """
    settings = settings or PosteriorSettings()
    diameter = 2.0 * float(packing.grains.radius.mean())
    stated = float(np.median([each.sigma for each in snapshots]))
    found = find_candidate_gaps(
        packing, snapshots, OPEN_REACH * diameter + REACH * np.sqrt(2.0) * stated + 3.0 * shared_error
    )
    series, noise, touching, wide = found.series, found.noise, found.touching, found.reach
    corrected = shared_error > 0.0 or touching.offset > SHARED_ERROR_SDS * touching.sd
    gap = found.smooth
    error = _shared_error(packing, snapshots, series, touching) if corrected else np.zeros(len(series.key))
    overlap = 0.0 if corrected else max(-touching.offset, 0.0)
    variances = _error_variances(packing, snapshots, series, (gap, wide), touching, soft=soft)
    radius_sd = variances.radius_sd(overlap)
    # Drift of contacts looks like noise, and the stated noise may be too large: the smaller value is a lower limit.
    # Where pairs of a frame differ in smoothing, the largest remaining fraction counts.
    smoothed = min(noise.noise, 2.0 * stated**2) * np.nanmax(found.variance_fraction, axis=1, initial=0.0)
    centre = np.sqrt(np.maximum(_centre_variance(touching, overlap, radius_sd**2, variances.centre), 0.5 * smoothed))
    offset = touching.offset_sd if corrected else settings.offset_sd * diameter
    typical = float(np.median(centre)) / diameter
    gap_law_sd = GAP_LAW_FRACTION * typical
    return SequenceEvidence(
        packing, snapshots, series.key, gap - error, series.gap - error, noise, touching,
        reach=wide - (touching.offset if corrected else 0.0),
        radius_correction=_radius_correction(packing, touching, corrected),
        centre_sd=centre,
        radius_sd=radius_sd,
        offset_sd=offset,
        settings=replace(
            settings, gap_law_sd=gap_law_sd, start_gap_law_sd=max(settings.start_gap_law_sd, gap_law_sd),
            offset_sd=offset / diameter, mean_open_gap=wide / diameter,
        ),
    )  # fmt: skip


def _centre_variance(touching: TouchingGaps, overlap: float, radius: float, covariance: float) -> float:
    """Compute the variance of a centre's coordinate [m²] from that of radii and from the covariance of gaps that meet.

    The difference between the variance of touching gaps and those of overlap and radii is the less certain, the larger
    the variance of radii; the covariance is biased by overlap, but not by radii.
    """
    difference = 0.5 * max(touching.sd**2 - (FORCE_SD * overlap) ** 2 - 2.0 * radius, 0.0)
    uncertainty = min(1.0, 2.0 * radius / (radius + difference)) if radius > 0.0 else 0.0
    return (1.0 - uncertainty) * difference + uncertainty * min(covariance, difference)


def _shared_error(packing: Packing, snapshots: Sequence[Snapshot], series: GapSeries, touching: TouchingGaps) -> Array:
    """Compute by how much the gap of every pair (c,) [m] is too large; a wall has no radius error."""
    covariate = pair_covariates(packing, snapshots, series)
    wall = series.with_wall
    covariate[wall, 1:] *= 0.5  # covariate 0 of a pair with a wall holds one grain's size already
    return touching.mean_at(covariate) - np.where(wall, 0.5 * touching.offset, 0.0)


def _error_variances(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    series: GapSeries,
    smooth: tuple[Array, float],
    touching: TouchingGaps,
    *,
    soft: bool,
) -> ErrorVariances:
    """Separate errors of radii from errors of centres in some of the frames; smooth: gaps (f, c) and reach [m]."""
    gap, reach = smooth
    between = np.flatnonzero(~series.with_wall)
    covariate = pair_covariates(packing, snapshots, series)[between]
    rows = even_subset(len(snapshots), VARIANCE_FRAMES)
    gap = gap[np.ix_(rows, between)]
    rest = gap - touching.mean_at(covariate)
    sampled = replace(touching, touching_fraction=touching.touching_fraction[rows])
    weight = sampled.probability(gap, covariate, reach)
    frames = []
    for row, k in enumerate(rows):
        seen = weight[row] > 0.0
        walls = packing.walls_of(snapshots[k])
        contacts = measure_pairs(packing.grains, snapshots[k].position, walls, series.key[between[seen]])
        frames.append((contacts, rest[row, seen], weight[row, seen]))
    return estimate_error_variances(frames, lasting=soft)


def _radius_correction(packing: Packing, touching: TouchingGaps, corrected: bool) -> Array:
    radius = packing.grains.radius
    if not corrected:
        return np.zeros(len(radius))
    return 0.5 * touching.offset + touching.slope[0] * (radius / radius.mean() - 1.0)


def _known_forces(packing: Packing, walls: Walls, contacts: Contacts) -> KnownForces:
    """Collect the loads of plates; the unit is near the mean force."""
    n, diameter = packing.grains.count, 2.0 * float(packing.grains.radius.mean())
    j, plates = contacts.j, np.flatnonzero(walls.loaded)
    group, total, factor = np.full(len(j), -1, np.int64), walls.load[plates], np.ones(len(j))
    at_wall = np.flatnonzero(contacts.with_wall)
    plate, factor[at_wall], _ = walls.plate_components(j[at_wall] - n, contacts.normal[at_wall])
    for g, wall in enumerate(plates):
        group[at_wall[plate == wall]] = g
    if len(plates):
        unit = float(np.nanmax(packing.pressure)) * packing.length * diameter
    elif np.any(packing.weight):
        # Half the weight of n grains rests on a row of √n grains.
        unit = float(np.linalg.norm(packing.weight, axis=1).mean()) * 0.5 * np.sqrt(n)
    else:
        unit = 1.0
    return KnownForces(unit, packing.weight, group, total, factor)
