"""One chain of the sampler: dimensionless evidence, the annealing schedule, and means over the kept sweeps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...bodies.grains import Array
from ..frame_evidence import FrameEvidence
from ..posterior_settings import PosteriorSettings
from .gibbs_sweeps import run
from .records import SamplerGrains, SamplerPairs
from .state import start_chain

EXACT = 1e-7  # mean diameters: standard deviation of an error that counts as exact
EDGE_WEIGHT = 0.01  # balance weight at the edge: unknown outside forces are of the mean force's size, not a tenth of it
PROBABILITY_MARGIN = 1e-6  # prior probabilities stay this far from 0 and 1, so that gap and balance can overrule them


@dataclass(frozen=True, slots=True)
class ChainMeans:
    """Means over the kept sweeps of one chain, dimensionless."""

    pair: Array  # (c, 5) of z, z f, z t, (z f)², (z t)²
    error: Array  # (m, 6) of ε, δ, δ², Σ f, (Σ f)²
    common: Array  # (4,) of κ, κ², offset, offset²


def run_chain(
    pairs: SamplerPairs,
    grains: SamplerGrains,
    schedule: Array,
    settings: PosteriorSettings,
    rng: np.random.Generator,
) -> ChainMeans:
    """Run one sweep for each row of the schedule (sweeps, 11), from a state without errors."""
    chain = start_chain(pairs, grains, settings.compliance, rng)
    by_pair, by_grain, common = np.zeros((len(chain.state.fn), 5)), np.zeros((len(grains.lever), 6)), np.zeros(4)
    run(chain, schedule, settings.kept, (by_pair, by_grain, common))
    return ChainMeans(*(each / settings.kept for each in (by_pair[chain.pairs.place], by_grain, common)))


def make_sampler_pairs(evidence: FrameEvidence) -> SamplerPairs:
    """Convert the pairs of a frame to lengths in mean diameters."""
    contacts = evidence.contacts
    probability = np.clip(evidence.prior, PROBABILITY_MARGIN, 1.0 - PROBABILITY_MARGIN)
    return SamplerPairs(
        i=contacts.i.astype(np.int64),
        j=np.where(contacts.with_wall, -1, contacts.j).astype(np.int64),
        normal=np.ascontiguousarray(contacts.normal),
        gap=contacts.gap / evidence.diameter,
        odds=np.log(probability / (1.0 - probability)),
        friction=np.ascontiguousarray(evidence.friction),
        group=evidence.known.group,
        gap_sd=np.zeros(contacts.count) if evidence.gap_sd is None else evidence.gap_sd / evidence.diameter,
        factor=np.ones(contacts.count) if evidence.known.factor is None else evidence.known.factor,
    )


def make_sampler_grains(evidence: FrameEvidence) -> SamplerGrains:
    """Convert the grains of a frame to lengths in mean diameters and forces in force units."""
    return SamplerGrains(
        lever=evidence.radius / evidence.radius.mean(),
        load=evidence.known.weight / evidence.known.unit,
        balance_weight=_balance_weight(evidence),
        centre_sd=np.maximum(evidence.centre_sd / evidence.diameter, EXACT),
        radius_sd=np.maximum(evidence.radius_sd / evidence.diameter, EXACT),
        group_load=evidence.known.total / evidence.known.unit,
        **_measured_pressures(evidence),
    )


def _measured_pressures(evidence: FrameEvidence) -> dict[str, Array]:
    """Measured sums of normal forces in force units, with their inverse variances (n,)."""
    if evidence.pressure is None or evidence.pressure_sd is None:
        none = np.zeros(len(evidence.radius))
        return {"pressure": none, "pressure_weight": none}
    known = np.isfinite(evidence.pressure) & (evidence.pressure_sd > 0.0)
    sd = np.where(known, evidence.pressure_sd / evidence.known.unit, 1.0)
    return {
        "pressure": np.where(known, evidence.pressure / evidence.known.unit, 0.0),
        "pressure_weight": np.where(known, sd**-2.0, 0.0),
    }


def _balance_weight(evidence: FrameEvidence) -> Array:
    """Weight of every grain's force balance (n,): 1 inside, 0 where forces are missing, small at the packing's edge."""
    strict = evidence.balanced.astype(np.float64)
    return strict if evidence.edge is None else np.where(evidence.edge, EDGE_WEIGHT, strict)


def make_schedule(settings: PosteriorSettings, expected_count: float, *, scale_known: bool) -> Array:
    """Build the model parameters of every sweep (sweeps, 11).

    Parameters
    ----------
    settings : PosteriorSettings
        Final parameters and numbers of sweeps.
    expected_count : float
        Sum of the prior probabilities of all pairs.
    scale_known : bool
        Whether a load or the grains' weight determines the scale of forces; else the mean force is held at the unit.

    Notes
    -----
    Sweep k of n annealing sweeps uses s_k = s (s_0/s)^(1 − k/n) and b_k = b (b_0/b)^(1 − k/n); later ones use s and b.
    """
    sweeps = settings.annealing + settings.burn_in + settings.kept
    left = np.clip(1.0 - np.arange(sweeps) / max(settings.annealing, 1), 0.0, 1.0)
    loose = np.array([
        max(settings.start_balance_sd / settings.balance_sd, 1.0),
        max(settings.start_gap_law_sd / settings.gap_law_sd, 1.0),
    ])  # fmt: skip
    annealed = np.array([settings.balance_sd, settings.gap_law_sd]) * loose ** left[:, None]
    mean_gauge = 0.0 if scale_known else settings.gauge
    rest = [
        settings.tangential_sd, settings.mean_open_gap, mean_gauge, settings.gauge, expected_count,
        settings.compliance, settings.compliance_sd, settings.offset_sd, settings.force_rate,
    ]  # fmt: skip
    return np.column_stack([annealed, np.tile(rest, (sweeps, 1))])
