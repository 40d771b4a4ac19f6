"""One chain of the sampler: evidence without dimension, the law of each sweep, and the means over those that count."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array
from solver.posterior.frame_evidence import FrameEvidence
from solver.posterior.sampler.kernels import run
from solver.posterior.sampler.records import Centres, Pairs, make_room, start_state
from solver.posterior.settings import PosteriorSettings

EXACT = 1e-7  # mean diameters: what counts as without error
EDGE = 0.01  # balance of a grain at the edge over that of one inside: pushes from outside are a mean force, not a tenth
LEAST_SHARE = 1e-6  # nobody is so sure of a pair that gap and balance could not tell otherwise


@dataclass(frozen=True, slots=True)
class Chain:
    """Means over the kept sweeps of one chain, without dimension."""

    pair: Array  # (c, 5) of z, z f, z t, (z f)², (z t)²
    error: Array  # (m, 4) of ε, δ, δ²
    common: Array  # (4,) of κ, κ², offset, offset²


def run_chain(
    pairs: Pairs, centres: Centres, laws: Array, settings: PosteriorSettings, rng: np.random.Generator
) -> Chain:
    """Sweep once for each of the laws, from a start without errors."""
    state = start_state(pairs, centres, settings.stiffness)
    sums = (np.zeros((len(pairs.i), 5)), np.zeros((len(state.body), 4)), np.zeros(4))
    run(rng, pairs, centres, laws, state, make_room(pairs, centres), settings.kept, sums)
    return Chain(*(each / settings.kept for each in sums))


def pairs_of(evidence: FrameEvidence) -> Pairs:
    """The pairs as the kernels read them."""
    contacts = evidence.contacts
    share = np.clip(evidence.prior, LEAST_SHARE, 1.0 - LEAST_SHARE)
    return Pairs(
        i=contacts.i.astype(np.int64),
        j=np.where(contacts.with_wall, -1, contacts.j).astype(np.int64),
        normal=np.ascontiguousarray(contacts.normal),
        gap=contacts.gap / evidence.diameter,
        odds=np.log(share / (1.0 - share)),
        friction=np.ascontiguousarray(evidence.friction),
        group=evidence.known.group,
        deviation=np.zeros(contacts.count)
        if evidence.gap_deviation is None
        else evidence.gap_deviation / evidence.diameter,
    )


def centres_of(evidence: FrameEvidence) -> Centres:
    """The grains as the kernels read them."""
    contacts, n = evidence.contacts, len(evidence.radius)
    rows, wall = np.arange(contacts.count), contacts.with_wall
    grain = np.concatenate([contacts.i, contacts.j[~wall]])
    order = np.argsort(grain, kind="stable")
    return Centres(
        lever=evidence.radius / evidence.radius.mean(),
        load=evidence.known.weight / evidence.known.unit,
        balanced=_weight_of_balance(evidence),
        deviation=np.maximum(evidence.centre_deviation / evidence.diameter, EXACT),
        radius_deviation=np.maximum(evidence.radius_deviation / evidence.diameter, EXACT),
        start=np.concatenate([[0], np.cumsum(np.bincount(grain, minlength=n))]).astype(np.int64),
        row=np.concatenate([rows, rows[~wall]])[order].astype(np.int64),
        group_load=evidence.known.total / evidence.known.unit,
    )


def _weight_of_balance(evidence: FrameEvidence) -> Array:
    """How strictly every grain is in balance (n,): 1, or 0 where nothing is known, or little at the packing's edge."""
    strict = evidence.balanced.astype(np.float64)
    return strict if evidence.edge is None else np.where(evidence.edge, EDGE, strict)


def laws_of(settings: PosteriorSettings, expected: float, *, scale_known: bool) -> Array:
    """The law of every sweep (sweeps, 11): balance and width are tightened together, then stay."""
    sweeps = settings.annealing + settings.settling + settings.kept
    left = np.clip(1.0 - np.arange(sweeps) / max(settings.annealing, 1), 0.0, 1.0)
    loose = np.array([
        max(settings.start_balance / settings.balance, 1.0), max(settings.start_width / settings.width, 1.0)
    ])  # fmt: skip
    tightened = np.array([settings.balance, settings.width]) * loose ** left[:, None]
    gauge = 0.0 if scale_known else settings.gauge
    rest = [
        settings.shear, settings.open_gap, gauge, settings.gauge, expected,
        settings.stiffness, settings.stiffness_sd, settings.offset_sd, settings.rarity,
    ]  # fmt: skip
    return np.column_stack([tightened, np.tile(rest, (sweeps, 1))])
