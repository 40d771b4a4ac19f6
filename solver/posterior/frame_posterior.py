"""Posterior of one frame from positions and balance alone: bearing probabilities, forces, centre and radius errors.

The posterior's mean is better than its mode: where evidence is weak it has small forces instead of one choice. It is
sampled by chains from the same start with different random numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from ..bodies.grains import Array
from ..contacts.contacts import Contacts
from ..parallel import parallel_map
from ..statistics.agreement import pearson
from .frame_evidence import FrameEvidence
from .posterior_settings import PosteriorSettings
from .sampler.chain import ChainMeans, make_sampler_grains, make_sampler_pairs, make_schedule, run_chain

# Over the draws' standard deviation: covers 68/95 % of f_n, apart from its scale, on simulated packings (median of 14).
COVERAGE_FACTOR = 2.2


@dataclass(frozen=True, slots=True)
class FringeEvidence:
    """Pressures of discs by their fringes, which a posterior has used."""

    pressure: Float[Array, " n"]  # [N] sum of the normal forces on a disc, NaN: not measured
    scale: float  # of these pressures over one unit of all frames; NaN: a load or weight determines the scale
    correlation: float  # with the true pressures, by the scatter about the curve


@dataclass(frozen=True, slots=True)
class FramePosterior:
    """Means over the draws of all chains, with standard deviations.

    The ratio of stresses along free walls to those under loads is not determined well: the pattern of forces is more
    certain than their scale.
    """

    contacts: Contacts
    fn: Float[Array, " c"]  # [N] E[z f], over draws with z = 1 and z = 0
    ft: Float[Array, " c"]  # [N]
    fn_sd: Float[Array, " c"]  # [N]
    ft_sd: Float[Array, " c"]  # [N]
    bearing_probability: Float[Array, " c"]  # E[z], P(bears force): less than P(touches)
    centre_error: Float[Array, "n 2"]  # [m] measured minus true centre
    radius_error: Float[Array, " n"]  # [m] true minus given radius
    overlap: float  # [m] of a contact with the mean force, linear
    offset: float  # [m] by which all gaps are too large
    offset_sd: float  # [m]
    trust: float  # correlation with the truth that the posterior itself expects
    agreement: float  # correlation of two chains; NaN with one
    pressure: Float[Array, " n"]  # [N] sum of the normal forces on a grain
    pressure_sd: Float[Array, " n"]  # [N] over the draws
    fringes: FringeEvidence | None = None  # None: no photoelastic photographs
    stress_factor: Float[Array, " c"] | None = None  # of the forces in a mixture, see `stress_matching`; None: 1


def infer_frame(
    evidence: FrameEvidence, settings: PosteriorSettings, rng: np.random.Generator, workers: int | None = None
) -> FramePosterior:
    """Sample the posterior of one frame.

    Parameters
    ----------
    evidence : FrameEvidence
        Gaps, prior probabilities, standard deviations of errors and known loads of the frame.
    settings : PosteriorSettings
        Parameters of the posterior and numbers of sweeps.
    rng : numpy.random.Generator
        Spawns one generator per chain: the same generator gives the same bits for any number of workers.
    workers : int, optional
        Threads that the chains share; None: one for every core.

    Returns
    -------
    FramePosterior
        Means over the kept sweeps of all chains.

    Notes
    -----
    The posterior stands in `sampler.gibbs_sweeps`. With z, f and t of its draws and the force unit U [N],

        fn = U E[z f],  ft = U E[z t],  fn_sd = 2.2 U √Var(z f),  ft_sd = 2.2 U √Var(z t),
        trust = √(V / (V + ⟨Var(z f)⟩)),  V = variance of E[z f] over the pairs,

    where 2.2 is COVERAGE_FACTOR. The overlap is κ times the mean force of bearing contacts.
    """
    pairs, grains = make_sampler_pairs(evidence), make_sampler_grains(evidence)
    schedule = make_schedule(settings, float(evidence.prior.sum()), scale_known=evidence.known.scale_known)
    tasks = [partial(run_chain, pairs, grains, schedule, settings, each) for each in rng.spawn(settings.chains)]
    return _summarise(evidence, parallel_map(tasks, workers))


def _summarise(evidence: FrameEvidence, chains: list[ChainMeans]) -> FramePosterior:
    unit, diameter = evidence.known.unit, evidence.diameter
    pair = np.mean([chain.pair for chain in chains], axis=0)
    error = np.mean([chain.error for chain in chains], axis=0)
    kappa, _, offset, offset2 = np.mean([chain.common for chain in chains], axis=0)
    bearing_probability, fn, ft = pair[:, 0], pair[:, 1], pair[:, 2]
    variance = np.maximum(pair[:, 3] - fn**2, 0.0)
    variance_t = np.maximum(pair[:, 4] - ft**2, 0.0)
    between_pairs = float(fn.var())
    total = between_pairs + float(variance.mean())
    mean_force = float(fn.sum() / max(bearing_probability.sum(), 1e-12))
    return FramePosterior(
        contacts=evidence.contacts,
        fn=unit * fn,
        ft=unit * ft,
        fn_sd=COVERAGE_FACTOR * unit * np.sqrt(variance),
        ft_sd=COVERAGE_FACTOR * unit * np.sqrt(variance_t),
        bearing_probability=bearing_probability,
        centre_error=diameter * error[:, :2],
        radius_error=diameter * error[:, 2],
        overlap=diameter * kappa * mean_force,
        offset=diameter * offset,
        offset_sd=diameter * float(np.sqrt(max(offset2 - offset**2, 0.0))),
        trust=float(np.sqrt(between_pairs / total)) if total > 0.0 else 0.0,
        agreement=_agreement(chains),
        pressure=unit * error[:, 4],
        pressure_sd=unit * np.sqrt(np.maximum(error[:, 5] - error[:, 4] ** 2, 0.0)),
        fringes=_fringes(evidence),
    )


def _fringes(evidence: FrameEvidence) -> FringeEvidence | None:
    if evidence.pressure is None:
        return None
    return FringeEvidence(evidence.pressure, evidence.pressure_scale, evidence.pressure_correlation)


def _agreement(chains: list[ChainMeans]) -> float:
    """Compute the mean correlation of normal forces between successive chains."""
    if len(chains) < 2:
        return float("nan")
    return float(np.mean([pearson(a.pair[:, 1], b.pair[:, 1]) for a, b in pairwise(chains)]))
