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
from solver.contacts.pairs import Keys, are_among, split_keys
from solver.contacts.verdicts import NO_VERDICTS, Verdicts
from solver.posterior.error_scatter import ErrorScatter, scatter_of
from solver.posterior.frame_evidence import FrameEvidence, KnownForces
from solver.posterior.gap_series import GapNoise, GapSeries, measure_noise, measure_series, smooth_series
from solver.posterior.settings import PosteriorSettings
from solver.posterior.touching import TouchingGaps, fit_touching

NEAR = 0.01  # [mean diameter] of gaps of pairs that do not touch but may soon
REACH = 6.0  # standard deviations of a gap, beyond
FARTHEST = 0.3  # mean diameters: pairs beyond it are no near pairs
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
    found = _find_touching(packing, snapshots, NEAR * diameter + REACH * np.sqrt(2.0) * stated + 3.0 * shared_error)
    series, noise, touching, wide = found.series, found.noise, found.touching, found.reach
    corrected = shared_error > 0.0 or touching.offset > APART * touching.deviation
    gap, left = smooth_series(series.gap, noise)
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


@dataclass(frozen=True, slots=True)
class _Found:
    series: GapSeries
    noise: GapNoise
    touching: TouchingGaps
    reach: float  # [m]


def _find_touching(packing: Packing, snapshots: Sequence[Snapshot], reach: float) -> _Found:
    """Find the gaps of touching pairs, looking farther than `reach` [m] where they lie there."""
    diameter, grains = 2.0 * float(packing.grains.radius.mean()), packing.grains.count
    stated = float(np.median([each.sigma for each in snapshots]))
    while True:
        series = measure_series(packing, snapshots, reach)
        noise = measure_noise(series, stated)
        farthest = reach >= FARTHEST * diameter
        if len(series.key) < grains and not farthest:  # fewer than two a grain: something shifts all gaps
            reach = min(2.0 * reach, FARTHEST * diameter)
            continue
        touching = _fit_mixture(packing, snapshots, series, noise, reach)
        needed = touching.offset + NEAR * diameter + 4.0 * touching.deviation
        if needed <= reach or farthest:
            return _Found(series, noise, touching, reach)
        reach = min(max(needed, 1.2 * reach), FARTHEST * diameter)


def _fit_mixture(
    packing: Packing, snapshots: Sequence[Snapshot], series: GapSeries, noise: GapNoise, reach: float
) -> TouchingGaps:
    """Fit pairs of grains where there are any: walls are known otherwise."""
    gap, _ = smooth_series(series.gap, noise)
    with np.errstate(invalid="ignore"):
        gap = np.where(gap < reach, gap, np.nan)
    some = ~series.with_wall if (~series.with_wall).any() else np.ones(len(series.key), np.bool_)
    return fit_touching(gap[:, some], _traits(packing, snapshots, series)[some], reach, float(np.sqrt(noise.noise)))


def _shared_error(packing: Packing, snapshots: Sequence[Snapshot], series: GapSeries, touching: TouchingGaps) -> Array:
    """How much too large the gap of every pair (c,) [m] is; a wall has no radius that could be wrong."""
    trait = _traits(packing, snapshots, series)
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
    trait = _traits(packing, snapshots, series)[between]
    rest = gap[:, between] - touching.mean_at(trait)
    weight = touching.probability(gap[:, between], trait, reach)
    frames = []
    for k in np.unique(np.linspace(0, len(snapshots) - 1, min(SCATTER_FRAMES, len(snapshots))).astype(int)):
        seen = weight[k] > 0.0
        walls = packing.walls_of(snapshots[k])
        contacts = measure_pairs(packing.grains, snapshots[k].position, walls, series.key[between[seen]])
        frames.append((contacts, rest[k, seen], weight[k, seen]))
    return scatter_of(frames)


def _traits(packing: Packing, snapshots: Sequence[Snapshot], series: GapSeries) -> Array:
    """What an error that the gaps share may depend on (c, 6): size of the pair, its place, squares of that.

    Size in mean radii beyond the mean of two; place from the middle of the packing, over its half width.
    """
    radius, n = packing.grains.radius, packing.grains.count
    i, j = split_keys(series.key, series.body_count)
    position = _mean_position(snapshots)
    size = radius[i] + np.where(j < n, radius[np.minimum(j, n - 1)], radius.mean()) - 2.0 * radius.mean()
    place = np.where((j < n)[:, None], 0.5 * (position[i] + position[np.minimum(j, n - 1)]), position[i])
    place = place - place.mean(axis=0)
    x, y = (place / max(float(np.abs(place).max()), 1e-30)).T
    trait = np.column_stack([size / radius.mean(), x, y, x * x, x * y, y * y])
    return trait - trait.mean(axis=0)


def _mean_position(snapshots: Sequence[Snapshot]) -> Array:
    """Mean place of every grain over the frames that show it (n, 2) [m]; the origin if none does."""
    here = np.stack([each.present for each in snapshots])
    position = np.where(here[:, :, None], np.stack([each.position for each in snapshots]), 0.0)
    return position.sum(axis=0) / np.maximum(here.sum(axis=0), 1)[:, None]


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
