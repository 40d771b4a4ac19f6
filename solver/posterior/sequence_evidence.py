"""What a sequence tells of each of its frames without any motion: gaps freed of noise and of errors that all share.

How hard the packing is decides how the posterior reads it, by numbers that follow from the gaps and not by cases: the
scatter of touching gaps is noise that is left, error of centres and radii, and overlap. The overlap's part follows from
the mean gap, for forces in a packing scatter nearly as much as their mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from solver.bodies.grains import Array
from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.contacts.contacts import measure_pairs
from solver.contacts.pairs import Keys, are_among
from solver.contacts.verdicts import NO_VERDICTS, Verdicts
from solver.posterior.error_scatter import ErrorScatter, scatter_of
from solver.posterior.frame_evidence import FrameEvidence, KnownForces
from solver.posterior.gap_series import GapNoise, GapSeries
from solver.posterior.near_gaps import NEAR, find_near_gaps, traits_of
from solver.posterior.settings import PosteriorSettings
from solver.posterior.touching import TouchingGaps

REACH = 6.0  # standard deviations of a gap, beyond
SCATTER = 0.8  # standard deviation of contact forces over their mean
APART = 1.0  # standard deviations that touching pairs stand apart from which on the gaps must share an error
SCATTER_FRAMES = 8  # photographs that tell errors of radii from errors of centres
SEEN = 0.99  # P(bears) of a pair that people saw touch, before gap and balance are looked at
SHARPNESS = 0.12  # bearing width over the centres' error: narrower, and the sampler sticks


@dataclass(frozen=True, slots=True)
class SequenceEvidence:
    """Smoothed gaps of a sequence, and what they say of noise, errors and softness."""

    packing: Packing
    snapshots: Sequence[Snapshot]
    key: Keys  # (c,) pairs within reach in some frame, ascending
    gap: Float[Array, "f c"]  # [m] smoothed and corrected; NaN where a grain is missing
    unsmoothed: Float[Array, "f c"]  # [m] the same as measured: the noise of one frame is not that of the next
    noise: GapNoise
    touching: TouchingGaps  # before the correction
    reach: float  # [m] of corrected gaps
    corrected: bool  # whether errors that the gaps share were taken off
    radius_correction: Float[Array, " n"]  # [m] what was taken off, per radius; zero if nothing
    centre_deviation: Float[Array, " f"]  # [m] of a centre's coordinate
    radius_deviation: float  # [m] of a radius
    offset_deviation: float  # [m] of an error that all gaps still share
    settings: PosteriorSettings  # as the sequence asks for

    def of_frame(
        self, k: int, *, wall_normal_total: float | None = None, verdicts: Verdicts = NO_VERDICTS
    ) -> FrameEvidence:
        """What frame k tells. wall_normal_total [N]: known sum of f_n over all walls, where nothing else is known.

        Pairs that people forbade bear nothing; those that they saw touch bear, unless balance contradicts it strongly.
        """
        packing, snapshot = self.packing, self.snapshots[k]
        walls = packing.walls_of(snapshot)
        with np.errstate(invalid="ignore"):
            near = self.gap[k] < self.reach
        seen = are_among(self.key, verdicts.forced)
        rows = np.flatnonzero((near | (seen & np.isfinite(self.gap[k]))) & ~are_among(self.key, verdicts.forbidden))
        contacts = measure_pairs(packing.grains, snapshot.position, walls, self.key[rows])
        contacts = replace(contacts, gap=self.gap[k, rows])
        n = packing.grains.count
        return FrameEvidence(
            contacts=contacts,
            prior=np.where(seen[rows], SEEN, self.touching.share[k]),
            friction=packing.material.friction_at(contacts.with_wall),
            radius=packing.grains.radius,
            centre_deviation=np.full(n, self.centre_deviation[k]),
            radius_deviation=np.full(n, self.radius_deviation),
            balanced=snapshot.present & packing.grains.free,
            edge=None if packing.grains.boundary is None else snapshot.present & packing.grains.boundary,
            known=_known_forces(packing, walls.load, contacts.j, wall_normal_total),
        )


def gather_evidence(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: PosteriorSettings | None = None,
    *,
    shared_error: float = 0.0,
) -> SequenceEvidence:
    """Gather what the positions of a sequence tell. `Snapshot.sigma` is believed where too few photographs tell.

    shared_error [m]: standard deviation of an error that all gaps may share (radii, pixel size, perspective). 0:
    calibrated; then an error is taken off only where touching pairs stand apart, which no overlap explains.
    Errors: ValueError if no two bodies are near.
    """
    settings = settings or PosteriorSettings()
    diameter = 2.0 * float(packing.grains.radius.mean())
    stated = float(np.median([each.sigma for each in snapshots]))
    found = find_near_gaps(packing, snapshots, NEAR * diameter + REACH * np.sqrt(2.0) * stated + 3.0 * shared_error)
    series, noise, touching, wide = found.series, found.noise, found.touching, found.reach
    corrected = shared_error > 0.0 or touching.offset > APART * touching.deviation
    gap, left = found.smooth, found.left
    error = _shared_error(packing, snapshots, series, touching) if corrected else np.zeros(len(series.key))
    overlap = 0.0 if corrected else max(-touching.offset, 0.0)
    scatter = _error_scatter(packing, snapshots, series, gap, touching, wide)
    radius_deviation = scatter.radius_deviation(overlap)
    # Drift of contacts passes for noise, a claim may be cautious: the lesser of both is sure. Where the smoothing of a
    # frame differs by pair, the most of it counts.
    smoothed = min(noise.noise, 2.0 * stated**2) * np.nanmax(left, axis=1, initial=0.0)
    centre = np.sqrt(
        np.maximum(_centre_variance(touching, overlap, radius_deviation**2, scatter.centre), 0.5 * smoothed)
    )
    offset = touching.offset_deviation if corrected else settings.offset_sd * diameter
    typical = float(np.median(centre)) / diameter
    width = SHARPNESS * typical
    return SequenceEvidence(
        packing, snapshots, series.key, gap - error, series.gap - error, noise, touching,
        reach=wide - (touching.offset if corrected else 0.0),
        corrected=corrected,
        radius_correction=_radius_correction(packing, touching, corrected),
        centre_deviation=centre,
        radius_deviation=radius_deviation,
        offset_deviation=offset,
        settings=replace(
            settings, width=width, start_width=max(settings.start_width, width), offset_sd=offset / diameter,
            open_gap=wide / diameter,
        ),
    )  # fmt: skip


def _centre_variance(touching: TouchingGaps, overlap: float, radius: float, covariance: float) -> float:
    """Variance of a centre's coordinate [m²], of those of radii and of the centres' covariance in gaps that meet.

    It is what overlap and radii leave of the scatter of touching gaps. The wider radii scatter, the less can be said by
    that difference; the covariance does not suffer by radii, but by overlap.
    """
    left = 0.5 * max(touching.deviation**2 - (SCATTER * overlap) ** 2 - 2.0 * radius, 0.0)
    doubt = min(1.0, 2.0 * radius / (radius + left)) if radius > 0.0 else 0.0
    return (1.0 - doubt) * left + doubt * min(covariance, left)


def _shared_error(packing: Packing, snapshots: Sequence[Snapshot], series: GapSeries, touching: TouchingGaps) -> Array:
    """How much too large the gap of every pair (c,) [m] is; a wall has no radius that could be wrong."""
    trait = traits_of(packing, snapshots, series)
    wall = series.with_wall
    trait[wall, 1:] *= 0.5  # the size of a grain on a wall is its own already
    return touching.mean_at(trait) - np.where(wall, 0.5 * touching.offset, 0.0)


def _error_scatter(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    series: GapSeries,
    gap: Array,
    touching: TouchingGaps,
    reach: float,
) -> ErrorScatter:
    """Tell errors of radii from errors of centres in some of the frames; smoothed gaps (f, c) [m]."""
    between = np.flatnonzero(~series.with_wall)
    trait = traits_of(packing, snapshots, series)[between]
    rows = np.unique(np.linspace(0, len(snapshots) - 1, min(SCATTER_FRAMES, len(snapshots))).astype(int))
    gap = gap[np.ix_(rows, between)]
    rest = gap - touching.mean_at(trait)
    weight = replace(touching, share=touching.share[rows]).probability(gap, trait, reach)
    frames = []
    for row, k in enumerate(rows):
        seen = weight[row] > 0.0
        walls = packing.walls_of(snapshots[k])
        contacts = measure_pairs(packing.grains, snapshots[k].position, walls, series.key[between[seen]])
        frames.append((contacts, rest[row, seen], weight[row, seen]))
    return scatter_of(frames)


def _radius_correction(packing: Packing, touching: TouchingGaps, corrected: bool) -> Array:
    radius = packing.grains.radius
    if not corrected:
        return np.zeros(len(radius))
    return 0.5 * touching.offset + touching.slope[0] * (radius / radius.mean() - 1.0)


def _known_forces(packing: Packing, load: Array, j: np.ndarray, wall_normal_total: float | None) -> KnownForces:
    """Loads of plates, or else the sum over all walls; the unit is near the mean force."""
    n, diameter = packing.grains.count, 2.0 * float(packing.grains.radius.mean())
    plates = np.flatnonzero(np.isfinite(load))
    group, total = np.full(len(j), -1, np.int64), load[plates]
    for g, wall in enumerate(plates):
        group[j == n + wall] = g
    if len(plates):
        unit = float(np.nanmax(packing.pressure)) * packing.length * diameter
    elif np.any(packing.weight):
        # Half the grains' weight rests on the other half: a row of them carries this on every grain.
        unit = float(np.linalg.norm(packing.weight, axis=1).mean()) * 0.5 * np.sqrt(n)
    elif wall_normal_total is not None and np.any(j >= n):
        group[j >= n], total = 0, np.array([wall_normal_total])
        unit = wall_normal_total / np.count_nonzero(j >= n)
    else:
        unit = 1.0
    return KnownForces(unit, packing.weight, group, total)
