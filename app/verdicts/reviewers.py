"""Agreement between reviewers, and between reviewers and the detector: Cohen's κ."""

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
    observed: float  # fraction on which they agree
    kappa: float  # (observed − chance) / (1 − chance); NaN where the agreement by chance is complete
    standard_error: float  # large-sample, Cohen (1960) eq. 9


def cohen_kappa(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> tuple[float, float, float]:
    """Return the agreement of two judges on the same pairs (m,): observed fraction, κ and its standard error.

    Notes
    -----
    κ = (p_o − p_c) / (1 − p_c), SE = √(p_o (1 − p_o) / m) / (1 − p_c), with the observed fraction p_o and the fraction
    by chance p_c = p q + (1 − p)(1 − q). J. Cohen, "A coefficient of agreement for nominal scales", Educ. Psychol.
    Meas. 20 (1960), eqs. 1 and 9.
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

    detected: whether the detector found a contact, by pairs in canonical order; a missing pair is no contact.
    """
    verdicts: dict[str, dict[Pair, bool]] = {}
    for pair, entry in log.verdicts():
        if entry.verdict is not Verdict.UNSURE:
            verdicts.setdefault(entry.reviewer, {})[canonical(pair)] = entry.verdict is Verdict.CONTACT
    found = [_compare(a, verdicts[a], b, verdicts[b]) for a, b in combinations(sorted(verdicts), 2)]
    for name in sorted(verdicts):
        judged = {pair: bool(detected.get(pair, False)) for pair in verdicts[name]}
        found.append(_compare(name, verdicts[name], DETECTOR, judged))
    return found


def _compare(first: str, one: Mapping[Pair, bool], second: str, other: Mapping[Pair, bool]) -> Kappa:
    both = [pair for pair in one if pair in other]
    a = np.array([one[pair] for pair in both], np.bool_)
    b = np.array([other[pair] for pair in both], np.bool_)
    return Kappa(first, second, len(both), *cohen_kappa(a, b))
