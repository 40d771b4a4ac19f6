"""Agreement of reviewers with one another and with the detector: counts by frame, Cohen's κ, disputed pairs."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ..process.errors import InputError
from ..verdicts.log import Pair, Verdict, VerdictLog, canonical
from ..verdicts.reviewers import reviewer_kappas
from .judging.candidate_pairs import CandidatePairs, find_candidate_pairs
from .judging.estimate import Interval
from .judging.scoring import VerdictScore, fit_to_verdicts, score_verdicts
from .reviewed_run import ReviewedRun
from .rounding import rounded_one

NARROW = 0.2  # a wider interval of precision or recall is not reported
MOST_DISPUTED = 100  # pairs in the list


def describe_agreement(run: ReviewedRun) -> dict[str, Any]:
    """Compare the verdicts of a run with each other and with the detector; frames are those of the experiment.

    Returns
    -------
    dict
        `frames` and `total`: counts of contacts that both see (hits), that only the detector sees (false), that only
        the reviewers see (missed) and that neither sees (rejected), for frames with a verdict. `precision`, `recall`:
        of the detector, None while the interval is wider than NARROW. `threshold`: the gap threshold that the verdicts
        recommend, None while they are too few. `kappas`: agreement of every two judges. `disputed`: pairs on which
        reviewers disagree, with the verdict of each.
    """
    score = score_verdicts(run)
    answer: dict[str, Any] = {"frames": [], "total": None, "precision": None, "recall": None, "threshold": None}
    if score is not None:
        answer["frames"] = [asdict(each) for each in score.frames]
        answer["total"] = asdict(score.total)
        answer |= {"precision": _narrow(score.estimate.precision), "recall": _narrow(score.estimate.recall)}
        answer["threshold"] = _recommended_threshold(run, score)
    log = run.log
    detected: dict[Pair, bool] = {}
    for number in sorted({pair[0] for pair, _ in log.verdicts()}):
        if number in run.photographs():
            found = find_candidate_pairs(run.results, number - run.first_frame, run.threshold)
            detected |= detected_by_name(run, number, found)
    answer["kappas"] = [
        {"first": each.first, "second": each.second, "count": each.count, "observed": rounded_one(each.observed),
         "kappa": rounded_one(each.kappa), "standard_error": rounded_one(each.standard_error)}
        for each in reviewer_kappas(log, detected)
    ]  # fmt: skip
    answer["disputed"] = [
        {"frame": pair[0], "i": pair[1], "j": pair[2], "verdicts": verdicts}
        for pair, verdicts in disputed_pairs(log)[:MOST_DISPUTED]
    ]
    return answer


def disputed_pairs(log: VerdictLog) -> list[tuple[Pair, dict[str, str]]]:
    """List the pairs that one reviewer judges a contact and another no contact, with all verdicts by reviewer."""
    verdicts: dict[Pair, dict[str, str]] = {}
    for pair, entry in log.verdicts():
        if entry.verdict is not None:
            verdicts.setdefault(canonical(pair), {})[entry.reviewer] = entry.verdict.value
    both = {Verdict.CONTACT.value, Verdict.NO_CONTACT.value}
    return [(pair, given) for pair, given in verdicts.items() if both <= set(given.values())]


def detected_by_name(run: ReviewedRun, photograph: int, found: CandidatePairs) -> dict[Pair, bool]:
    """Map the candidate pairs of a frame, by name, to whether the detector found them."""
    name, detected = run.bodies.name, {}
    for i, j, yes in zip(found.contacts.i.tolist(), found.contacts.j.tolist(), found.detected.tolist(), strict=True):
        a = name(i)
        assert isinstance(a, int)  # the first body of a pair is a grain
        detected[canonical((photograph, a, name(j)))] = bool(yes)
    return detected


def _recommended_threshold(run: ReviewedRun, score: VerdictScore) -> dict[str, float | None] | None:
    """The threshold [µm] that fits the verdicts best, and the change of all radii [µm]; None: too few verdicts."""
    try:
        fitted = fit_to_verdicts(run, score)
    except InputError:
        return None
    return {
        "threshold_um": rounded_one(1e6 * fitted.threshold),
        "radius_change_um": rounded_one(1e6 * fitted.radius_change),
        "radius_change_sd_um": rounded_one(1e6 * fitted.radius_change_sd),
    }  # fmt: skip


def _narrow(interval: Interval) -> dict[str, float] | None:
    return asdict(interval) if interval.high - interval.low < NARROW else None
