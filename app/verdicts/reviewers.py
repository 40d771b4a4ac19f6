"""Agreement between people, and between people and the detector: Cohen's κ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from .log import Pair, Verdict, VerdictLog, canonical

DETECTOR = "detector"


@dataclass(frozen=True, slots=True)
class Kappa:
    """Agreement of two judges on the pairs that both judged."""

    first: str
    second: str
    count: int  # pairs judged by both, "unsure" left out
    observed: float  # share on which they agree
    kappa: float  # (observed − by chance) / (1 − by chance); NaN where chance alone explains all
    standard_error: float  # large-sample, Cohen (1960) eq. 9


def cohen_kappa(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> tuple[float, float, float]:
    """Measure the agreement of two judges on the same pairs (m,): observed share, κ and its standard error.

    J. Cohen, "A coefficient of agreement for nominal scales", Educ. Psychol. Meas. 20 (1960), eqs. 1 and 9.
    """
    if first.shape != second.shape or first.ndim != 1:
        raise ValueError("both judges must have judged the same pairs")
    m = len(first)
    if m == 0:
        return float("nan"), float("nan"), float("nan")
    observed = float(np.mean(first == second))
    p, q = float(first.mean()), float(second.mean())
    chance = p * q + (1.0 - p) * (1.0 - q)
    if chance >= 1.0:
        return observed, float("nan"), float("nan")
    error = float(np.sqrt(observed * (1.0 - observed) / m)) / (1.0 - chance)
    return observed, (observed - chance) / (1.0 - chance), error


def reviewer_kappas(log: VerdictLog, detected: Mapping[Pair, bool]) -> list[Kappa]:
    """Compare all reviewers with each other and with the detector.

    detected: what the detector said of pairs, named as `canonical` does; of a pair that is not there it saw no contact.
    """
    said: dict[str, dict[Pair, bool]] = {}
    for pair, entry in log.verdicts():
        if entry.verdict is not Verdict.UNSURE:
            said.setdefault(entry.reviewer, {})[canonical(pair)] = entry.verdict is Verdict.CONTACT
    found = [_compare(a, said[a], b, said[b]) for a, b in combinations(sorted(said), 2)]
    for name in sorted(said):
        judged = {pair: bool(detected.get(pair, False)) for pair in said[name]}
        found.append(_compare(name, said[name], DETECTOR, judged))
    return found


def _compare(first: str, one: Mapping[Pair, bool], second: str, other: Mapping[Pair, bool]) -> Kappa:
    both = [pair for pair in one if pair in other]
    a = np.array([one[pair] for pair in both], np.bool_)
    b = np.array([other[pair] for pair in both], np.bool_)
    return Kappa(first, second, len(both), *cohen_kappa(a, b))
