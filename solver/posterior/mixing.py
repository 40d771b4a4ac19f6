"""Forces from motion and forces from positions alone, mixed by how far each is to be believed.

The two err for different reasons. If their errors have nothing in common, their correlation c is the product of what
each has in common with the truth: neither can be worse than c, and where c is less than both claims allow, one claims
too much. That is the posterior, which takes radii, friction and the law of the overlap for granted and is sure of the
rest; motion's trust is fitted on truths. A field from motion without a trust, as that of the first frame, to which no
motion leads, does not count beside one that needs none. A mistake that both make, as of a wall, is seen by neither.

Shares follow from what is to be expected of either, the mixture's trust from what is certain: motion's trust is a bound
that most frames exceed, and a mixture by bounds would take from the better field.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from solver.bodies.grains import Array
from solver.contacts.pairs import Keys, align
from solver.posterior.frame_posterior import FramePosterior
from solver.statistics.agreement import pearson

SELF_CONFIDENCE = 0.95  # what the posterior reaches of what it expects of itself, where nothing it is told is wrong
MOST = 0.995  # trust beyond which a field would rule alone
# Of what a sound frame's trust leaves to doubt, the share that its motion errs by on the average: .33 to .53 between
# trusts of .88 and .97 in sixteen worlds of 300 rods, seed 0. A trust of DOUBTED or less is taken at its word.
USUAL_DOUBT = 0.45
DOUBTED, SOUND = 0.6, 0.85


@dataclass(frozen=True, slots=True)
class ForceField:
    """Forces of one frame, by whichever method."""

    key: Keys  # (c,) ascending
    force: Float[Array, "c 2"]  # [N] f_n, f_t
    trust: float  # bound of the correlation with the truth; NaN: it does not know
    expected: float | None = None  # correlation that is to be expected; None: no more than the bound


@dataclass(frozen=True, slots=True)
class MixedField:
    """Both fields on the pairs of either."""

    key: Keys  # (c,) ascending
    force: Float[Array, "c 2"]  # [N], inside the Coulomb cone if both were
    share: float  # of the posterior in the mixture, 0 … 1
    trust: float  # expected correlation with the truth
    agreement: float  # correlation of both fields' f_n; NaN where either is constant


def mix_fields(motion: ForceField, posterior: FramePosterior, worth: float = 1.0) -> MixedField:
    """Mix a field from motion with a posterior of the same frame.

    worth: of the motion beside what it would be for hard grains, 0 … 1: what grains are pressed hides how they slide.

    Both count over their sums of f_n. The sum of the mixture is motion's: the stress along walls without a load follows
    from sliding, which positions do not show. Errors: ValueError where either field is without any force.
    """
    geometry = np.column_stack([posterior.fn, posterior.ft])
    totals = float(motion.force[:, 0].sum()), float(posterior.fn.sum())
    if not min(totals) > 0.0:
        raise ValueError("a field without forces cannot be mixed")
    key, moved, placed = align(motion.key, motion.force / totals[0], posterior.contacts.key, geometry / totals[1])
    agreement = pearson(moved[:, 0], placed[:, 0])
    claimed = min(posterior.trust, _known(posterior.agreement))
    expected = motion.trust if motion.expected is None else motion.expected
    share = share_of_posterior(*believe(worth * expected, claimed, agreement), worth)
    motion_trust, posterior_trust = believe(worth * motion.trust, claimed, agreement)
    mixed = share * placed + (1.0 - share) * moved
    spread = np.std(moved[:, 0]), np.std(placed[:, 0])
    confirmed = _confirmed(motion_trust, posterior_trust, agreement)
    trust = _expected(motion_trust, confirmed, agreement, share, spread)
    return MixedField(key, totals[0] * mixed, share, trust, agreement)


def expected_correlation(bound: float) -> float:
    """What is to be expected of a field from motion whose trust, a bound, is this; NaN stays."""
    sure = float(np.clip((bound - DOUBTED) / (SOUND - DOUBTED), 0.0, 1.0))
    return 1.0 - (1.0 - bound) * (1.0 - sure * (1.0 - USUAL_DOUBT))


def believe(motion_trust: float, posterior_trust: float, agreement: float) -> tuple[float, float]:
    """Trust in motion and in the posterior when both fields correlate by `agreement`.

    motion_trust, posterior_trust: what each says of itself; motion's may be NaN. NaN agreement says nothing.
    """
    claimed = SELF_CONFIDENCE * posterior_trust
    common = max(agreement, 0.0) if np.isfinite(agreement) else 0.0
    if not np.isfinite(motion_trust):
        return 0.0, min(claimed, MOST)
    if np.isfinite(agreement):
        claimed = min(claimed, common / max(motion_trust, 1e-6))
    return float(np.clip(max(motion_trust, common), 0.0, MOST)), float(np.clip(claimed, 0.0, MOST))


def share_of_posterior(motion_trust: float, posterior_trust: float, worth: float = 1.0) -> float:
    """Share of the posterior in the mixture, by weights T²/(1 − T²); a half where neither is believed."""
    motion, posterior = (trust**2 / (1.0 - trust**2) for trust in (motion_trust, posterior_trust))
    motion *= worth
    return posterior / (posterior + motion) if posterior + motion > 0.0 else 0.5


def _confirmed(motion_trust: float, posterior_trust: float, agreement: float) -> float:
    """What is certain of the posterior: its correlation with the other field, and more only as far as that is believed.

    With doubtful input both are wrong, and nothing but motion's distrust tells.
    """
    common = min(max(agreement, 0.0), posterior_trust) if np.isfinite(agreement) else 0.0
    return common + motion_trust * (posterior_trust - common)


def _expected(
    motion_trust: float, posterior_trust: float, agreement: float, share: float, spread: tuple[np.floating, np.floating]
) -> float:
    """Correlation with the truth of the mixture of two fields that correlate with it by their trusts."""
    one, two = (1.0 - share) * float(spread[0]), share * float(spread[1])
    both = agreement if np.isfinite(agreement) else 0.0
    size = np.sqrt(max(one**2 + two**2 + 2.0 * one * two * both, 1e-300))
    return float(np.clip((one * motion_trust + two * posterior_trust) / size, 0.0, MOST))


def _known(agreement: float) -> float:
    """A single chain has nothing to agree with."""
    return agreement if np.isfinite(agreement) else 1.0
