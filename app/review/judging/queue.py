"""The queue: in which order a person meets the candidates, so that an hour of judging tells the most.

Candidates fall into strata by how doubtful they are and whether they were detected. Inside a stratum the order is
random, drawn once from the frame's number: so what was judged so far is a fair sample of each stratum, whatever the
order of the strata. A whole frame is judged stratum by stratum, most doubtful first. In sampled mode every round
takes some of each stratum, more where strata are large and doubtful, and goes through its frames in their order.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from .candidate_pairs import CandidatePairs

DOUBT_EDGES = np.array([0.002, 0.02, 0.1, 0.3, 0.6])  # between strata
STRATUM_COUNT = 2 * (len(DOUBT_EDGES) + 1)
ROUND = 48  # candidates of one round of the sampled mode
LEAST_VARIANCE = 0.02  # of a stratum's verdicts, where the detector claims to be sure
_SEED = 20150  # of the order inside strata: the same queue in every session


@dataclass(frozen=True, slots=True)
class Queue:
    """Candidates of one or many frames in the order in which they are to be judged."""

    frame: NDArray[np.int64]  # (q,) of the run
    key: NDArray[np.int64]  # (q,)
    stratum: NDArray[np.int64]  # (q,)
    detected: NDArray[np.bool_]  # (q,)
    probability: Array  # (q,) P(touch) by the detector

    @property
    def count(self) -> int:
        return len(self.key)

    def following(self, judged: Collection[tuple[int, int]], after: tuple[int, int] | None = None) -> int | None:
        """Place of the first candidate not judged yet; of the first behind `after`, round and round, where given.

        None where everything was judged.
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
    """Stratum of every candidate (c,); 0 and 1 hold the most doubtful, the odd ones those detected."""
    doubt = len(DOUBT_EDGES) - np.searchsorted(DOUBT_EDGES, candidates.doubt, side="right")
    return 2 * doubt + candidates.detected


def frame_queue(candidates: CandidatePairs) -> Queue:
    """Queue a whole frame, most doubtful first."""
    stratum = strata(candidates)
    return _queue([candidates], [stratum], np.lexsort((_random(candidates), stratum)))


def sampled_queue(frames: Sequence[CandidatePairs]) -> Queue:
    """Queue the candidates of many frames in rounds that sample every stratum."""
    stratum = [strata(each) for each in frames]
    drawn = np.concatenate([_random(each) for each in frames])
    frame = np.concatenate([np.full(each.count, each.frame) for each in frames])
    probability = np.concatenate([each.probability for each in frames])
    every = np.concatenate(stratum)
    turn = np.empty(len(every), np.int64)  # the round in which a candidate comes up
    share = _allocation(every, probability)
    for h in range(STRATUM_COUNT):
        rows = np.flatnonzero(every == h)
        turn[rows[np.argsort(drawn[rows], kind="stable")]] = np.arange(len(rows)) // max(share[h], 1)
    return _queue(frames, stratum, np.lexsort((drawn, every, frame, turn)))


def _allocation(stratum: NDArray[np.int64], probability: Array) -> NDArray[np.int64]:
    """How many of every stratum one round takes: in proportion to size times deviation (Neyman, 1934)."""
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


def _queue(frames: Sequence[CandidatePairs], stratum: Sequence[NDArray[np.int64]], order: NDArray[np.int64]) -> Queue:
    return Queue(
        np.concatenate([np.full(each.count, each.frame, np.int64) for each in frames])[order],
        np.concatenate([each.key for each in frames])[order],
        np.concatenate(stratum)[order],
        np.concatenate([each.detected for each in frames])[order],
        np.concatenate([each.probability for each in frames])[order],
    )
