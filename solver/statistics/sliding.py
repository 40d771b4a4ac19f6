"""Which of the contacts that bear force slide: probabilities, so that counts are not biased.

A reported field is a mean of several, which takes forces that are on the Coulomb cone a little off it: counting what
is on the cone counts hardly any that slide. What the photographs show of the sliding itself tells more than the
forces that were made of it, above all where grains are soft, for overlaps know nothing of friction. Weight tells,
too: a heap that comes to rest takes its contacts off the cone by which they slid a moment before. All probabilities
are logistic functions fitted on discrete-element truths (`rodsight study numbers` prints how statistics weighted with
them do on others).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.contacts import ContactState
from solver.statistics.bearing import logistic

# Log odds: constant, (|f_t| / μ f_n)², share of the convex members on the cone, of the chains on it; sliding seen
# against f_t, and seen by much; sliding far; weight; share of the positions of soft grains, and of hard ones. Fitted on
# seeds 4 to 6 of fifteen worlds of 300 rods, the share that slides held in each.
SLIDING = (-4.35, 1.03, 1.99, 1.09, 1.92, -1.72, 1.40, -3.01, 0.91, 0.51)
SEEN = 4.0  # standard deviations of a sliding at which it counts half
MUCH = 12.0  # the same of what may be over: a leap within the interval, where photographs are far apart
FAR = 1.0  # of what neighbours move by: the same of its size
HEAVY = 0.1  # of the mean force: the same of weight
SLIDING_AT_FIRST = (-6.10, 2.29, 9.60)  # constant, (|f_t| / μ f_n)², Σ|f_t| / Σ μ f_n; weight as above
SLIDING_WITHOUT_MEMBERS = (-3.84, 1.68, 2.34)  # constant, (|f_t| / μ f_n)², (|f_t| / μ f_n)⁸
TOLD_WRONG = 1.0  # power of the friction told over the true one in the odds of what was found with it
LEAST_DOUBT = 1e-9
EVEN = 0.5  # P(slides) above which a contact counts as sliding
ON_THE_CONE = 0.995  # of μ f_n: a member's force is there


@dataclass(frozen=True, slots=True)
class SlidingSigns:
    """What tells of contacts (c,) whether they slide, beside the reported force."""

    cone_share: Array  # (c, 2) of the convex members and of the chains whose force is on the Coulomb cone
    slip: Array  # (c,) measured sliding over its standard deviation, positive against f_t; 0 where it is unknown
    reach: Array  # (c,) measured sliding over what neighbours move by
    weight: Array  # (c,) of the heavier grain, over the mean f_n
    positions_share: float  # of the positions in the reported field
    soft: bool  # whether positions told forces by overlaps
    borne: float | None = None  # Σ|f_t| / Σ μ f_n of a frame that no motion leads to; None: one does


def sliding_probability(mobilised: Array, signs: SlidingSigns | None) -> Array:
    """P(slides) of contacts (c,) that bear force, from |f_t| / (μ f_n) of the reported field.

    signs: None where there are no members. In a frame that no motion leads to, what slides afterwards need not slide
    yet: it is the friction of the whole field that tells a packing that was sheared before from one that is fresh.
    """
    used = np.minimum(mobilised, 1.0)
    if signs is None:
        constant, square, eighth = SLIDING_WITHOUT_MEMBERS
        return logistic(constant + square * used**2 + eighth * used**8)
    heavy = SLIDING[7] * signs.weight / (signs.weight + HEAVY)
    if signs.borne is not None:
        constant, square, borne = SLIDING_AT_FIRST
        return logistic(constant + square * used**2 + borne * signs.borne + heavy)
    constant, square, convex, chains, against, much, far, _, of_soft, of_hard = SLIDING
    slip = np.maximum(signs.slip, 0.0)
    odds = constant + square * used**2 + convex * signs.cone_share[:, 0] + chains * signs.cone_share[:, 1]
    odds += against * _saturating(slip, SEEN) + much * _saturating(slip, MUCH) + far * _saturating(signs.reach, FAR)
    return logistic(odds + heavy + (of_soft if signs.soft else of_hard) * signs.positions_share)


def slides_at(slides: Array, told: float, friction: float, share: float = 1.0) -> Array:
    """P(slides) (c,) where forces were found with a friction that was told, but another one holds.

    share: of the motion in the reported field, for it alone needs a friction.
    """
    odds = slides / np.maximum(1.0 - slides, LEAST_DOUBT) * (told / friction) ** (TOLD_WRONG * share)
    return odds / (1.0 + odds)


def contact_state(fn: Array, slides: Array) -> NDArray[np.uint8]:
    """ContactState of forces fn (c,) [N] that slide with a probability (c,)."""
    state = np.where(slides > EVEN, ContactState.SLIDING, ContactState.STICKING).astype(np.uint8)
    state[fn <= 0] = ContactState.OPEN
    return state


def cone_share(fn: Array, ft: Array, friction: Array, convex: NDArray[np.bool_]) -> Array:
    """Shares of the convex members and of the others whose force is on the Coulomb cone (c, 2).

    fn, ft (m, c) [N] of the members; friction (c,); convex (m,). A kind without members has share 0.
    """
    bearing = fn > 0
    on = bearing & (np.abs(ft) >= ON_THE_CONE * friction * fn)
    kinds = [on[convex], on[~convex]]
    return np.column_stack([each.mean(axis=0) if len(each) else np.zeros(fn.shape[1]) for each in kinds])


def _saturating(value: Array, half: float) -> Array:
    """From 0 to 1, a half at `half`."""
    return value**2 / (value**2 + half**2)
