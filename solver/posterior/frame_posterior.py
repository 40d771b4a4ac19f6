"""One frame by itself: which pairs bear, with how much force, where the centres are; from positions and balance alone.

The posterior's mean is better than any most probable field: where evidence is weak it says so by small forces instead
of choosing. It is sampled by chains that start alike and draw other numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts
from solver.posterior.frame_evidence import FrameEvidence
from solver.posterior.sampler.chain import Chain, centres_of, laws_of, pairs_of, run_chain
from solver.posterior.settings import PosteriorSettings
from solver.statistics.agreement import pearson
from solver.together import work_together

# Over the draws' standard deviation: covers 68/95 % of f_n, its scale apart, on simulated packings (median of 14).
HONEST = 2.2


@dataclass(frozen=True, slots=True)
class FramePosterior:
    """Means over the draws of all chains together, and how far the truth may be from them.

    How stresses along free walls compare to those under loads is beyond it: its pattern is surer than its scale.
    """

    contacts: Contacts
    fn: Float[Array, " c"]  # [N] E[z f_n], the mean over draws in which the pair bears and those in which it does not
    ft: Float[Array, " c"]  # [N]
    fn_deviation: Float[Array, " c"]  # [N]
    ft_deviation: Float[Array, " c"]  # [N]
    bears: Float[Array, " c"]  # P(bears force): less than P(touches)
    centre_error: Float[Array, "n 2"]  # [m] measured minus true centre
    radius_error: Float[Array, " n"]  # [m] true minus given radius
    overlap: float  # [m] per mean force, linear
    overlap_deviation: float  # [m]
    offset: float  # [m] that all gaps are too large
    offset_deviation: float  # [m]
    trust: float  # √(var f / (var f + mean sd²)), the correlation with the truth that the posterior itself expects
    agreement: float  # correlation of two chains; NaN of one


def infer_frame(
    evidence: FrameEvidence, settings: PosteriorSettings, rng: np.random.Generator, workers: int | None = None
) -> FramePosterior:
    """Sample the posterior of one frame. The same generator gives the same bits, whatever runs beside it.

    workers: threads that the chains share; None: one for every core.
    """
    pairs, centres = pairs_of(evidence), centres_of(evidence)
    laws = laws_of(settings, float(evidence.prior.sum()), scale_known=evidence.known.fix_the_scale)
    tasks = [partial(run_chain, pairs, centres, laws, settings, each) for each in rng.spawn(settings.chains)]
    return _summarise(evidence, work_together(tasks, workers))


def _summarise(evidence: FrameEvidence, chains: list[Chain]) -> FramePosterior:
    unit, diameter = evidence.known.unit, evidence.diameter
    pair = np.mean([chain.pair for chain in chains], axis=0)
    error = np.mean([chain.error for chain in chains], axis=0)
    kappa, kappa2, offset, offset2 = np.mean([chain.common for chain in chains], axis=0)
    bears, fn, ft = pair[:, 0], pair[:, 1], pair[:, 2]
    variance = np.maximum(pair[:, 3] - fn**2, 0.0)
    variance_t = np.maximum(pair[:, 4] - ft**2, 0.0)
    spread = float(fn.var())
    total = spread + float(variance.mean())
    mean_force = float(fn.sum() / max(bears.sum(), 1e-12))
    return FramePosterior(
        contacts=evidence.contacts,
        fn=unit * fn,
        ft=unit * ft,
        fn_deviation=HONEST * unit * np.sqrt(variance),
        ft_deviation=HONEST * unit * np.sqrt(variance_t),
        bears=bears,
        centre_error=diameter * error[:, :2],
        radius_error=diameter * error[:, 2],
        overlap=diameter * kappa * mean_force,
        overlap_deviation=diameter * mean_force * float(np.sqrt(max(kappa2 - kappa**2, 0.0))),
        offset=diameter * offset,
        offset_deviation=diameter * float(np.sqrt(max(offset2 - offset**2, 0.0))),
        trust=float(np.sqrt(spread / total)) if total > 0.0 else 0.0,
        agreement=_agreement(chains),
    )


def _agreement(chains: list[Chain]) -> float:
    """Mean correlation of a chain's forces with those of the next."""
    if len(chains) < 2:
        return float("nan")
    return float(np.mean([pearson(a.pair[:, 1], b.pair[:, 1]) for a, b in pairwise(chains)]))
