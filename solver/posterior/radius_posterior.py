"""Posterior of the radius errors, from all frames together: one error per radius, while forces and centres change.

In a single frame an error of a radius cannot be separated from errors of centres; over many frames neighbours and
forces change and the radius does not. The variance of the radii is estimated first, so that exact ones stay exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from ..bodies.grains import Array
from ..bodies.motion import Snapshot
from ..bodies.packing import Packing
from ..even_subset import even_subset
from ..robust_scale import NORMAL_MEDIAN
from .posterior_settings import PosteriorSettings
from .sampler.chain import ChainMeans, make_sampler_grains, make_sampler_pairs, make_schedule, run_chain
from .sampler.records import SamplerGrains, SamplerPairs
from .sequence_evidence import SequenceEvidence, gather_position_evidence

FRAMES = 12  # sampled together, evenly spaced
MIN_RADIUS_SD = 0.5  # of the radii, over that of the centres or the noise; below it radii are not corrected
GAP_LAW_FRACTION = 0.3  # b over the noise: larger than for forces, so that radii mix
ANNEALING = 600
KEPT = 400
FEWEST = 5  # grains of a size whose errors are compared
COMMON, APART = 3.0, 6.0  # standard deviations, of `share_errors`
LEAST_SHOWN = 0.3  # of a correction: less of it is the prior alone
RADIUS_COVERAGE_FACTOR = 3.0  # true over sampled standard deviation: a single-site sampler underestimates it


@dataclass(frozen=True, slots=True)
class RadiusPosterior:
    """Estimated errors of the radii. Add the correction to the given radii."""

    correction: Float[Array, " n"]  # [m] from given to true radius, mean over the draws
    correction_sd: Float[Array, " n"]  # [m] standard deviation of the remaining error
    prior_sd: float  # [m] standard deviation of the errors of the given radii; 0: exact within the noise


def has_radius_errors(packing: Packing, snapshots: Sequence[Snapshot]) -> bool:
    """Return whether errors of radii stand out from errors of centres and noise."""
    try:
        return _is_detectable(gather_position_evidence(packing, snapshots))
    except ValueError:  # no two bodies are near
        return False


def estimate_radii(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    rng: np.random.Generator,
    settings: PosteriorSettings | None = None,
    *,
    shared_error: float = 0.0,
) -> RadiusPosterior:
    """Estimate the errors of the radii from the positions of a sequence.

    Parameters
    ----------
    packing, snapshots, settings, shared_error
        As for `gather_position_evidence`.
    rng : numpy.random.Generator
        Random numbers of the chain.

    Raises
    ------
    ValueError
        If no two bodies are near.

    Notes
    -----
    One chain samples the posterior of `sampler.gibbs_sweeps` for up to 12 frames at once, with the gaps as measured,
    b = 0.3 × the noise of a position, one δ for each radius, and forces, centre errors and known sums for each frame.
    With D the mean diameter, the correction is D E[δ] plus the error that all gaps share; its standard deviation is
    min(3 D √Var(δ), max(σ_r, D √⟨E[δ²]⟩)), with 3 the RADIUS_COVERAGE_FACTOR.
    """
    rows = even_subset(len(snapshots), FRAMES)
    evidence = gather_position_evidence(packing, snapshots, settings, shared_error=shared_error)
    shared, sd = evidence.radius_correction, evidence.radius_sd
    if not _is_detectable(evidence):
        return RadiusPosterior(shared, np.full(len(shared), sd), sd)
    chain = _run_joint_chain(evidence, rows, rng)
    diameter = 2.0 * float(packing.grains.radius.mean())
    mean, square = chain.error[: len(shared), 2], chain.error[: len(shared), 3]
    sampled = np.sqrt(np.maximum(square - mean**2, 0.0)) * diameter
    # The first estimate is too small, because gaps that an error widens count as open; the draws contain the errors.
    sd = max(sd, diameter * float(np.sqrt(square.mean())))
    correction_sd = np.minimum(RADIUS_COVERAGE_FACTOR * sampled, sd)
    return RadiusPosterior(shared + diameter * mean, correction_sd, sd)


def share_errors(found: RadiusPosterior, size_class: Int[np.ndarray, " n"]) -> RadiusPosterior:
    """Estimate the errors again where grains of one stated size have an error in common.

    Parameters
    ----------
    found : RadiusPosterior
        By `estimate_radii`, whose prior knows no sizes.
    size_class : (n,)
        Stated size of each grain, from 0.

    Returns
    -------
    RadiusPosterior
        As given where no size has a common error: the true radii may then differ from the stated sizes one by one.

    Notes
    -----
    Empirical Bayes (C. N. Morris, J. Am. Stat. Assoc. 78, 47 (1983)) for every size of at least FEWEST grains. A
    correction c of standard deviation s is the part ρ = 1 − s²/σ_r² of what gaps and balance show: x = c/ρ, of variance
    v = s²/ρ. With the median m of x, its robust variance w² = ⟨(x − m)²⟩ and that of true errors τ² = max(w² − v, 0),

        c = m + k (x − m),  s² = k v + (1 − k)² w²/n,  k = τ²/(τ² + v).

    An error is common where |m| > COMMON w. Grains with |x − m| > APART √(τ² + v) have an error of their own and stay.
    """
    if not found.prior_sd > 0.0 or not len(size_class):
        return found
    correction, sd = found.correction.copy(), found.correction_sd.copy()
    shown = np.maximum(1.0 - (sd / found.prior_sd) ** 2, LEAST_SHOWN)
    value, variance = correction / shown, sd**2 / shown
    common = False
    for each in range(int(size_class.max()) + 1):
        rows = np.flatnonzero((size_class == each) & (variance > 0.0))
        if len(rows) < FEWEST:
            continue
        x, v = value[rows], variance[rows]
        mean = float(np.median(x))
        width = float((np.median(np.abs(x - mean)) / NORMAL_MEDIAN) ** 2)
        common |= abs(mean) > COMMON * np.sqrt(width)
        true = max(width - float(np.median(v)), 0.0)
        kept = true / (true + v)
        alike = np.abs(x - mean) <= APART * np.sqrt(true + v)
        shared = np.sqrt(kept * v + (1.0 - kept) ** 2 * width / len(rows))
        correction[rows] = np.where(alike, mean + kept * (x - mean), correction[rows])
        sd[rows] = np.where(alike, shared, sd[rows])
    return replace(found, correction=correction, correction_sd=sd) if common else found


def _is_detectable(evidence: SequenceEvidence) -> bool:
    return evidence.radius_sd > MIN_RADIUS_SD * max(float(np.median(evidence.centre_sd)), evidence.noise.sigma)


def _run_joint_chain(evidence: SequenceEvidence, rows: np.ndarray, rng: np.random.Generator) -> ChainMeans:
    measured = replace(evidence, gap=evidence.unsmoothed)
    frames = [measured.of_frame(int(k)) for k in rows]
    diameter = frames[0].diameter
    gap_law_sd = GAP_LAW_FRACTION * evidence.noise.sigma / diameter
    settings = replace(evidence.settings, gap_law_sd=gap_law_sd, annealing=ANNEALING, kept=KEPT)
    expected = float(sum(each.prior.sum() for each in frames))
    schedule = make_schedule(settings, expected, scale_known=frames[0].known.scale_known)
    pairs, grains = stack_frames(
        [make_sampler_pairs(each) for each in frames], [make_sampler_grains(each) for each in frames]
    )
    return run_chain(pairs, grains, schedule, settings, rng)


def stack_frames(pairs: Sequence[SamplerPairs], grains: Sequence[SamplerGrains]) -> tuple[SamplerPairs, SamplerGrains]:
    """Concatenate frames; each has its own grains and known sums, and all have the same radii."""
    first_grain = np.cumsum([0] + [len(each.lever) for each in grains])
    first_group = np.cumsum([0] + [len(each.group_load) for each in grains])
    shifted_pairs = [
        each._replace(
            i=each.i + first_grain[k],
            j=np.where(each.j >= 0, each.j + first_grain[k], -1),
            group=np.where(each.group >= 0, each.group + first_group[k], -1),
        )
        for k, each in enumerate(pairs)
    ]
    stacked = SamplerGrains(*(np.concatenate(field) for field in zip(*grains, strict=True)))
    return (
        SamplerPairs(*(np.concatenate(field) for field in zip(*shifted_pairs, strict=True))),
        stacked._replace(radius_sd=grains[0].radius_sd),
    )
