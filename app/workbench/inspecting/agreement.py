"""How far people agree, with one another and with the program: a table by frames, κ, and the pairs they disagree on."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ...review.judging.candidate_pairs import CandidatePairs, find_candidate_pairs
from ...review.judging.estimate import Interval
from ...review.judging.scoring import score_verdicts
from ...review.reviewed_run import Reviewed
from ...verdicts.log import Pair, Verdict, VerdictLog, canonical
from ...verdicts.reviewers import reviewer_kappas
from .found import plain

NARROW = 0.2  # an interval that is wider says too little to be shown
MOST = 100  # pairs of a list


def agreement(reviewed: Reviewed) -> dict[str, Any]:
    """What the log of a run says of people and program; frames are photographs.

    frames: of every frame with a verdict, and total: contacts that both see, that the program alone sees, that the eye
    alone sees, and that neither sees. precision, recall: of the program, None while the interval is too wide.
    """
    score = score_verdicts(reviewed)
    told: dict[str, Any] = {"frames": [], "total": None, "precision": None, "recall": None, "disputed": []}
    if score is not None:
        told["frames"] = [asdict(each) for each in score.frames]
        told["total"] = asdict(score.total)
        told |= {"precision": _shown(score.estimate.precision), "recall": _shown(score.estimate.recall)}
    log = reviewed.log
    detected: dict[Pair, bool] = {}
    for number in sorted({pair[0] for pair, _ in log.verdicts()}):
        if 0 <= number - reviewed.first_frame < len(reviewed.results.frames):
            found = find_candidate_pairs(reviewed.results, number - reviewed.first_frame, reviewed.threshold)
            detected |= _detected(reviewed, number, found)
    kappas = reviewer_kappas(log, detected)
    told["judges"] = [
        {"first": each.first, "second": each.second, "count": each.count, "observed": plain([each.observed])[0],
         "kappa": plain([each.kappa])[0], "standard_error": plain([each.standard_error])[0]}
        for each in kappas
    ]  # fmt: skip
    told["disputed"] = [
        {"frame": pair[0], "i": pair[1], "j": pair[2], "said": said} for pair, said in disputes(log)[:MOST]
    ]
    return told


def disputes(log: VerdictLog) -> list[tuple[Pair, dict[str, str]]]:
    """The pairs that one reviewer takes for a contact and another does not, with who says what."""
    said: dict[Pair, dict[str, str]] = {}
    for pair, entry in log.verdicts():
        if entry.verdict is not None:
            said.setdefault(canonical(pair), {})[entry.reviewer] = entry.verdict.value
    both = {Verdict.CONTACT.value, Verdict.NO_CONTACT.value}
    return [(pair, words) for pair, words in said.items() if both <= set(words.values())]


def _detected(reviewed: Reviewed, number: int, found: CandidatePairs) -> dict[Pair, bool]:
    """What the program says of a frame's candidates, by name."""
    name, told = reviewed.bodies.name, {}
    for i, j, yes in zip(found.contacts.i.tolist(), found.contacts.j.tolist(), found.detected.tolist(), strict=True):
        a = name(i)
        assert isinstance(a, int)  # the first body of a pair is a grain
        told[canonical((number, a, name(j)))] = bool(yes)
    return told


def _shown(interval: Interval) -> dict[str, float] | None:
    return asdict(interval) if interval.high - interval.low < NARROW else None
