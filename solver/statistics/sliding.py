"""Probability that a contact that bears force slides, for unbiased counts.

The reported forces are a mean over several ensemble members, which moves forces from the Coulomb cone to its inside:
counting forces on the cone finds hardly any sliding contact. The measured sliding displacement is stronger evidence
than the forces, above all for soft grains, whose overlaps do not depend on friction. The weight matters, too: in a
heap that comes to rest, contacts that slid a moment before leave the cone. All probabilities are logistic functions
fitted on discrete-element simulations (`rodsight study numbers` compares statistics weighted with them on other
simulations).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..contacts.contacts import ContactState
from .bearing import logistic

# Coefficients of the log odds: constant, (|f_t| / μ f_n)², fraction of the convex members on the cone, of the chains on
# it; measured sliding against f_t, with scales SLIDING_SD and LARGE_SLIDING_SD; sliding with scale SLIDING_SCALE;
# weight; weight of the position-only estimate for soft and for hard grains. Fitted on seeds 4 to 6 of fifteen test
# cases of 300 rods at their true fractions of sliding contacts.
SLIDING = (-4.35, 1.03, 1.99, 1.09, 1.92, -1.72, 1.40, -3.01, 0.91, 0.51)
SLIDING_SD = 4.0  # [σ] sliding at which its term is one half
LARGE_SLIDING_SD = 12.0  # [σ] the same for large sliding, as by a jump between distant photographs
SLIDING_SCALE = 1.0  # of the displacement scale: sliding at which its term is one half
WEIGHT_SCALE = 0.1  # of the mean force: weight at which its term is one half
SLIDING_AT_FIRST = (-6.10, 2.29, 9.60)  # constant, (|f_t| / μ f_n)², Σ|f_t| / Σ μ f_n; weight as above
SLIDING_WITHOUT_MEMBERS = (-3.84, 1.68, 2.34)  # constant, (|f_t| / μ f_n)², (|f_t| / μ f_n)⁸
FRICTION_POWER = 1.0  # power of given over true friction in the odds
LEAST_COMPLEMENT = 1e-9  # lower bound of 1 − P(slides)
EVEN = 0.5  # P(slides) above which a contact counts as sliding
ON_CONE = 0.995  # |f_t| / (μ f_n) above which the force of a member is on the Coulomb cone


@dataclass(frozen=True, slots=True)
class SlidingEvidence:
    """Evidence of sliding at contacts (c,), in addition to the reported force."""

    cone_fraction: Array  # (c, 2) fractions of convex members and of chains whose force is on the Coulomb cone
    slip: Array  # (c,) measured sliding over its standard deviation, positive against f_t; 0 where unknown
    relative_slip: Array  # (c,) measured sliding over the displacement scale
    weight: Array  # (c,) of the heavier grain, over the mean f_n
    position_weight: float  # of the position-only estimate in the reported field
    soft: bool  # whether forces were derived from overlaps
    mobilised_friction: float | None = None  # Σ|f_t| / Σ μ f_n of a frame without motion before it; otherwise None


def sliding_probability(mobilised: Array, evidence: SlidingEvidence | None) -> Array:
    """Return P(slides) of contacts that bear force.

    Parameters
    ----------
    mobilised : (c,)
        |f_t| / (μ f_n) of the reported forces.
    evidence
        Further evidence; None without ensemble members.

    Returns
    -------
    (c,)
        Probability.

    Notes
    -----
    A logistic function of the terms of SLIDING. In a frame without motion before it, the sliding afterwards is no
    evidence: the mobilised friction of the whole field distinguishes a sheared packing from a fresh one.
    """
    used = np.minimum(mobilised, 1.0)
    if evidence is None:
        constant, square, eighth = SLIDING_WITHOUT_MEMBERS
        return logistic(constant + square * used**2 + eighth * used**8)
    weight = SLIDING[7] * evidence.weight / (evidence.weight + WEIGHT_SCALE)
    if evidence.mobilised_friction is not None:
        constant, square, mean = SLIDING_AT_FIRST
        return logistic(constant + square * used**2 + mean * evidence.mobilised_friction + weight)
    constant, square, convex, chains, slides, slides_far, relative, _, of_soft, of_hard = SLIDING
    slip = np.maximum(evidence.slip, 0.0)
    odds = constant + square * used**2 + convex * evidence.cone_fraction[:, 0] + chains * evidence.cone_fraction[:, 1]
    odds += (
        slides * _saturating(slip, SLIDING_SD)
        + slides_far * _saturating(slip, LARGE_SLIDING_SD)
        + relative * _saturating(evidence.relative_slip, SLIDING_SCALE)
    )
    return logistic(odds + weight + (of_soft if evidence.soft else of_hard) * evidence.position_weight)


def sliding_probability_at(sliding: Array, given: float, friction: float, motion_weight: float = 1.0) -> Array:
    """Return P(slides) for another friction than the one that the forces were computed with.

    Parameters
    ----------
    sliding : (c,)
        P(slides) with the given friction.
    given
        Friction that the forces were computed with.
    friction
        True friction.
    motion_weight
        Weight w of the motion estimate in the reported field; the position-only estimate does not depend on friction.

    Notes
    -----
    p' / (1 − p') = p / (1 − p) · (μ_given / μ)^w.
    """
    odds = (
        sliding / np.maximum(1.0 - sliding, LEAST_COMPLEMENT) * (given / friction) ** (FRICTION_POWER * motion_weight)
    )
    return odds / (1.0 + odds)


def contact_state(fn: Array, sliding: Array) -> NDArray[np.uint8]:
    """Return the ContactState of contacts with forces fn (c,) [N] and P(slides) (c,)."""
    state = np.where(sliding > EVEN, ContactState.SLIDING, ContactState.STICKING).astype(np.uint8)
    state[fn <= 0] = ContactState.OPEN
    return state


def cone_fraction(fn: Array, ft: Array, friction: Array, convex: NDArray[np.bool_]) -> Array:
    """Return the fractions of the convex members and of the others whose force is on the Coulomb cone (c, 2).

    fn, ft (m, c) [N] of the members; friction (c,); convex (m,). A kind without members has fraction 0.
    """
    bearing = fn > 0
    on = bearing & (np.abs(ft) >= ON_CONE * friction * fn)
    kinds = [on[convex], on[~convex]]
    return np.column_stack([each.mean(axis=0) if len(each) else np.zeros(fn.shape[1]) for each in kinds])


def _saturating(value: Array, half: float) -> Array:
    """Return x² / (x² + half²), from 0 to 1."""
    return value**2 / (value**2 + half**2)
