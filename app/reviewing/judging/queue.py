"""The order in which a reviewer judges candidate pairs.

By influence: the pairs of a frame whose verdict may change the forces most come first. Their verdicts count as known,
but are no random sample.

By strata: candidate pairs fall into strata by ambiguity and by whether they were detected. Inside a stratum the order
is random, drawn once from the frame's number: the verdicts at any time are a random sample of each stratum, whatever
the order of the strata, and accuracy is estimated from them. A whole frame is judged stratum by stratum, the most
ambiguous first. The sample of all frames proceeds in rounds; every round takes some of each stratum, more where strata
are large and ambiguous, in the order of the frames.

A blind reviewer gets the pairs in random order: the position in the queue must not reveal the detector's answer.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...results.results import Results
from ...solver.bodies.grains import Array
from ...solver.contacts.pairs import match_values
from .candidate_pairs import CandidatePairs

AMBIGUITY_EDGES = np.array([0.002, 0.02, 0.1, 0.3, 0.6])  # between strata
STRATUM_COUNT = 2 * (len(AMBIGUITY_EDGES) + 1)
ROUND = 48  # candidate pairs of one round of the sample of all frames
LEAST_VARIANCE = 0.02  # of a stratum's verdicts, where the detector claims to be certain
_SEED = 20150  # of the order inside strata: the same queue in every session


@dataclass(frozen=True, slots=True)
class Queue:
    """Candidate pairs of one or many frames in the order in which they are judged."""

    frame: NDArray[np.int64]  # (q,) of the run
    key: NDArray[np.int64]  # (q,)
    stratum: NDArray[np.int64]  # (q,)
    detected: NDArray[np.bool_]  # (q,)
    probability: Array  # (q,) P(touch) by the detector
    random: bool = True  # inside every stratum: verdicts on its first pairs are a random sample

    @property
    def count(self) -> int:
        return len(self.key)

    def next_place(self, judged: Collection[tuple[int, int]], after: tuple[int, int] | None = None) -> int | None:
        """Return the place of the first pair that is not judged yet, None if all are.

        Parameters
        ----------
        judged : collection
            Frame and key of the judged pairs.
        after : tuple of int, optional
            Frame and key of the pair after which the search begins; it continues at the start of the queue.
        """
        places = range(self.count)
        if after is not None:
            at = np.flatnonzero((self.frame == after[0]) & (self.key == after[1]))
            if len(at):
                places = [*range(int(at[0]) + 1, self.count), *range(int(at[0]) + 1)]
        for place in places:
            if (int(self.frame[place]), int(self.key[place])) not in judged:
                return place
        return None


def strata(candidates: CandidatePairs) -> NDArray[np.int64]:
    """Return the stratum of every candidate pair (c,): 0 and 1 are the most ambiguous, odd ones hold detected pairs."""
    level = len(AMBIGUITY_EDGES) - np.searchsorted(AMBIGUITY_EDGES, candidates.ambiguity, side="right")
    return 2 * level + candidates.detected


def influence_priority(results: Results, candidates: CandidatePairs) -> Array:
    """Return ambiguity times influence of every candidate pair (c,) [N]; NaN where the frame has no forces.

    Notes
    -----
    priority = (1 − |2 P(touch) − 1|) F with F = max(f_n, 0) of a contact, and the mean f_n of the frame for a pair that
    is no contact yet.
    """
    forces, mean = results.frames[candidates.frame], results.statistics[candidates.frame].mean_fn
    carried = match_values(candidates.key, forces.contacts.key, forces.fn, fill=np.nan)
    return candidates.ambiguity * np.where(np.isfinite(carried), np.maximum(carried, 0.0), mean)


def influence_queue(results: Results, candidates: CandidatePairs, *, blind: bool = False) -> Queue:
    """Queue a whole frame by influence times ambiguity; in random order for a blind reviewer."""
    priority = np.nan_to_num(influence_priority(results, candidates))
    order = np.argsort(_random(candidates)) if blind else np.lexsort((-candidates.ambiguity, -priority))
    return _queue([candidates], [strata(candidates)], order, random=blind)


def frame_queue(candidates: CandidatePairs, *, blind: bool = False) -> Queue:
    """Queue a whole frame by strata, the most ambiguous first; in random order for a blind reviewer."""
    stratum, drawn = strata(candidates), _random(candidates)
    return _queue([candidates], [stratum], np.argsort(drawn) if blind else np.lexsort((drawn, stratum)))


def sampled_queue(frames: Sequence[CandidatePairs], *, blind: bool = False) -> Queue:
    """Queue the candidate pairs of many frames in rounds that sample every stratum."""
    stratum = [strata(each) for each in frames]
    drawn = np.concatenate([_random(each) for each in frames])
    frame = np.concatenate([np.full(each.count, each.frame) for each in frames])
    probability = np.concatenate([each.probability for each in frames])
    every = np.concatenate(stratum)
    round_number = np.empty(len(every), np.int64)
    size = _round_sizes(every, probability)
    for h in range(STRATUM_COUNT):
        rows = np.flatnonzero(every == h)
        round_number[rows[np.argsort(drawn[rows], kind="stable")]] = np.arange(len(rows)) // max(size[h], 1)
    inside = () if blind else (every,)
    return _queue(frames, stratum, np.lexsort((drawn, *inside, frame, round_number)))


def _round_sizes(stratum: NDArray[np.int64], probability: Array) -> NDArray[np.int64]:
    """Pairs of every stratum in one round: in proportion to its size times standard deviation (Neyman, 1934)."""
    weight = np.zeros(STRATUM_COUNT)
    for h in range(STRATUM_COUNT):
        inside = probability[stratum == h]
        if len(inside):
            mean = inside.mean()
            weight[h] = len(inside) * np.sqrt(max(mean * (1.0 - mean), LEAST_VARIANCE))
    total = weight.sum()
    return np.ceil(ROUND * weight / total).astype(np.int64) if total > 0 else np.zeros(STRATUM_COUNT, np.int64)


def _random(candidates: CandidatePairs) -> Array:
    return np.random.default_rng([_SEED, candidates.frame]).random(candidates.count)


def _queue(
    frames: Sequence[CandidatePairs], stratum: Sequence[NDArray[np.int64]], order: NDArray[np.int64], *,
    random: bool = True,
) -> Queue:  # fmt: skip
    return Queue(
        np.concatenate([np.full(each.count, each.frame, np.int64) for each in frames])[order],
        np.concatenate([each.key for each in frames])[order],
        np.concatenate(stratum)[order],
        np.concatenate([each.detected for each in frames])[order],
        np.concatenate([each.probability for each in frames])[order],
        random,
    )
