"""The coefficient of friction, estimated from the motion as the minimum of the relative power gap.

Where bodies slide, friction acts at its limit against the sliding. With a coefficient that is too low, force sets in
equilibrium need friction that does not oppose the measured sliding. With one that is too high, friction cannot reach
its limit. The relative power gap of a convex member has its minimum near the true coefficient: on simulated packings
0-12 % below it for coefficients of 0.15 and 0.25, 11-20 % below it for 0.4. The estimate checks an assumed coefficient;
it does not replace a tilt test. The standard deviation over frames does not contain this bias.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..bodies.grains import Array
from ..contacts.contacts import Contacts
from ..nlgs.force_memory import ForceMemory
from ..parallel import parallel_map
from .program import Balance, solve_convex_member

# Of the assumed coefficient; only those about the minimum are tried.
FACTORS = (
    0.12, 0.17, 0.24, 0.32, 0.4, 0.5, 0.6, 0.7, 0.8, 0.88, 0.94, 1.0, 1.06, 1.14, 1.25, 1.45, 1.7, 2.0, 2.4, 2.9, 3.5,
    4.2, 5.0,
)  # fmt: skip
SIDE = 2  # trials on either side of the minimum


@dataclass(frozen=True, slots=True)
class SlidingFrame:
    """Input of a convex member at one frame."""

    balance: Balance  # with the assumed friction
    contacts: Contacts
    slip: Array  # (c,) of `soft_slip`
    probability: Array  # (c,) P(touch)


@dataclass(frozen=True, slots=True)
class FrictionEstimate:
    """Estimated over assumed friction, with the trials."""

    factor: float
    factor_sd: float  # jackknife standard deviation over the frames; NaN with fewer than three frames
    trial: Array  # (q,) trial factors, ascending
    gap: Array  # (q,) relative power gap, mean over the frames
    enclosed: bool  # False: the minimum is at the first or last trial, so friction lies beyond, or nothing slides


def relative_power_gap(slip: Array, friction: Array, fn: Array, ft: Array) -> float:
    """Compute the relative power gap of a force field.

    Parameters
    ----------
    slip : (c,)
        û_t of `soft_slip`.
    friction : (c,)
        Coefficient of friction.
    fn, ft : (c,)
        Forces [N].

    Returns
    -------
    float
        0 if all friction acts at its limit against the sliding, 1 without friction; NaN where nothing slides under
        force.

    Notes
    -----
    gap = 1 + Σ f_t û_t / Σ μ f_n |û_t|
    """
    possible = float(np.sum(friction * fn * np.abs(slip)))
    return 1.0 + float(np.sum(ft * slip)) / possible if possible > 0 else np.nan


def estimate_friction(
    frames: Sequence[SlidingFrame],
    factors: Sequence[float] = FACTORS,
    *,
    of_walls: bool = False,
    workers: int | None = 1,
) -> FrictionEstimate:
    """Estimate the friction from the sliding of consecutive frames, as a factor on the assumed one.

    Every trial solves all frames with its own previous forces. Trials start at the factor nearest to 1 and continue
    until they bracket the minimum.

    Parameters
    ----------
    frames : sequence of SlidingFrame
        Consecutive frames.
    factors : sequence of float
        Trial factors, at least three.
    of_walls : bool
        Scale the friction of walls alone. Otherwise one factor scales all friction; that of walls must not be zero.
    workers : int, optional
        Threads; the result does not depend on their number.

    Raises
    ------
    ValueError
        Without frames or with fewer than three factors.
    """
    trial = np.sort(np.asarray(factors, dtype=np.float64))
    if not len(frames) or len(trial) < 3:
        raise ValueError("friction needs at least one frame and three trial factors")
    trial, gap = _bracket_minimum(trial, lambda factor: np.array(_power_gaps(frames, factor, of_walls)), workers)
    gap = gap[np.isfinite(gap).all(axis=1)]
    if not len(gap):
        return FrictionEstimate(np.nan, np.nan, trial, np.full(len(trial), np.nan), False)
    factor, enclosed = _minimum(trial, gap.mean(axis=0))
    return FrictionEstimate(factor, _jackknife(trial, gap), trial, gap.mean(axis=0), enclosed)


def _bracket_minimum(trial: Array, gaps_of: Callable[[float], Array], workers: int | None = 1) -> tuple[Array, Array]:
    """Evaluate neighbouring trials (q,) until SIDE of them lie on either side of every leave-one-out minimum.

    Returns the evaluated factors (p,) and their gaps (f, p).
    """
    first = last = int(np.argmin(np.abs(np.log(trial))))
    # Nearly every search needs these trials, since it begins downwards: they run in parallel.
    initial = [q for q in (first, first - 1, first - 2, first + 1) if 0 <= q < len(trial)]
    known = dict(zip(initial, parallel_map([partial(gaps_of, float(trial[q])) for q in initial], workers), strict=True))

    def gaps_at(q: int) -> Array:
        return known[q] if q in known else gaps_of(float(trial[q]))

    gap = gaps_at(first)[:, None]
    while True:
        finite = gap[np.isfinite(gap).all(axis=1)]
        if not len(finite):
            break
        least = first + np.argmin([finite.mean(axis=0), *_means_without_one(finite)], axis=1)
        if first > max(int(least.min()) - SIDE, 0):
            first -= 1
            gap = np.column_stack([gaps_at(first), gap])
        elif last < min(int(least.max()) + SIDE, len(trial) - 1):
            last += 1
            gap = np.column_stack([gap, gaps_at(last)])
        else:
            break
    return trial[first : last + 1], gap


def _power_gaps(frames: Sequence[SlidingFrame], factor: float, of_walls: bool) -> list[float]:
    scales = [np.where(frame.contacts.with_wall | (not of_walls), factor, 1.0) for frame in frames]
    return power_gaps(
        replace(frame, balance=replace(frame.balance, friction=scale * frame.balance.friction))
        for frame, scale in zip(frames, scales, strict=True)
    )


def power_gaps(frames: Iterable[SlidingFrame]) -> list[float]:
    """Relative power gaps of the forces of least gap, each frame continuing from the forces of the one before."""
    memory, gaps = ForceMemory.empty(), []
    for frame in frames:
        previous = memory.recall(frame.contacts)
        forces = solve_convex_member(frame.balance, frame.slip, frame.probability, previous[:, 0], previous[:, 1])
        all_present = np.ones(frame.contacts.grain_count, dtype=bool)
        memory = memory.renew(frame.contacts, np.column_stack([forces.fn, forces.ft]), all_present)
        gaps.append(relative_power_gap(frame.slip, frame.balance.friction, forces.fn, forces.ft))
    return gaps


def _minimum(trial: Array, gap: Array) -> tuple[float, bool]:
    """Minimum of the parabola through the smallest gap and its two neighbours, in the logarithm of the factor."""
    q = int(np.argmin(gap))
    if q in (0, len(trial) - 1):
        return float(trial[q]), False
    x, y = np.log(trial[q - 1 : q + 2]), gap[q - 1 : q + 2]
    left, right = (y[1] - y[0]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
    curvature = (right - left) / (x[2] - x[0])
    if curvature <= 0:
        return float(trial[q]), True
    return float(np.exp(0.5 * (x[0] + x[1]) - 0.5 * left / curvature)), True


def _jackknife(trial: Array, gap: Array) -> float:
    count = len(gap)
    if count < 3:
        return np.nan
    without = [_minimum(trial, mean)[0] for mean in _means_without_one(gap)]
    return float(np.sqrt((count - 1) * np.var(without)))


def _means_without_one(gap: Array) -> list[Array]:
    """Leave-one-out mean gaps (q,) of the trials; empty with fewer than three frames."""
    return [np.delete(gap, f, axis=0).mean(axis=0) for f in range(len(gap))] if len(gap) > 2 else []
