"""Questions of inspection and review: a pair's evidence, what is at stake, verdicts, which go to the log as ever."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, StringConstraints

from ...errors import InputError
from ...results.results import Results
from ...review.reviewed_run import Reviewed
from ...run_folder import RESULTS
from ...verdicts.log import VERDICTS, Entry, Origin, Verdict, VerdictLog
from ...verdicts.reviewer_name import account_name
from ..inspecting import found as inspecting
from ..inspecting import pairs
from ..inspecting.agreement import agreement as compare_judges
from ..inspecting.judged import force_of, keep_force, spoken_of
from .bench import Bench
from .project import Project
from .questions import BadRequest, Number, Text, Whole, question
from .run_questions import Name, scale_of

Reviewer = Annotated[str, StringConstraints(min_length=1, max_length=60, strip_whitespace=True)]
LONGEST = 300.0  # [s] of one judgement: beyond it the reviewer was away


@question
def reviewer(bench: Bench) -> dict[str, Any]:
    """Who sits here: who judged last, or whose account it is; empty: the page asks."""
    return {"name": bench.reviewer or account_name()}


@question
def candidates(bench: Bench, at: Text, frame: Whole, reviewer: Text) -> dict[str, Any]:
    """The pairs of a photograph, those first on which most hangs, and what this reviewer has said of them."""
    opened = bench.project(at)
    results, k = _frame(opened, frame)
    said = pairs.verdicts_of(_log(opened), frame, reviewer)
    found = pairs.candidates_of(results, k, _threshold(opened))
    return {"frame": frame, "pairs": pairs.told_candidates(results, found, scale_of(opened), said), "judged": len(said)}


@question
def pair(bench: Bench, at: Text, i: Name, j: Name) -> dict[str, Any]:
    """One pair in every photograph up to the last one that is solved; places in pixels."""
    opened = bench.project(at)
    told = pairs.pair_history(_results(opened), i, j)
    if told is None:
        raise BadRequest(f"there is no pair {i} {j}")
    scale = scale_of(opened)
    told["point"] = [None if p is None else scale.to_pixels(p).round(2).tolist() for p in told["point"]]
    before: list[Any] = [None] * _first(opened)
    return {name: before + values for name, values in told.items()}


@question
def without(bench: Bench, at: Text, frame: Whole, i: Name, j: Name) -> dict[str, Any]:
    """The nearest forces of a photograph in which a contact is not there; nothing is written."""
    results, k = _frame(bench.project(at), frame)
    told = pairs.without_pair(results, k, i, j)
    if told is None:
        raise InputError(f"{i} - {j}", f"photograph {frame}", "is no contact there")
    return told


@question
def rod(bench: Bench, at: Text, id: Whole) -> dict[str, Any]:
    """One rod in every photograph up to the last one that is solved."""
    opened = bench.project(at)
    results = _results(opened)
    tracks = results.tracks
    rows = (tracks.id == id).nonzero()[0]
    if len(rows) != 1:
        raise BadRequest(f"there is no rod {id}")
    row = int(rows[0])
    before: list[Any] = [None] * _first(opened)
    return {
        "radius": float(tracks.radius[row]), "zncc": before + inspecting.plain(tracks.zncc[:, row]),
        "sigma": before + inspecting.plain(tracks.sigma[:, row]),
        "rotation": before + inspecting.plain(tracks.rotation[:, row]),
        "status": before + [inspecting.TrackStatus(each).name.lower() for each in tracks.status[:, row].tolist()],
        "unbalance": before + inspecting.plain([
            float("nan") if f.grain_unbalance is None else f.grain_unbalance[row] for f in results.frames
        ]),
    }  # fmt: skip


@question
def agreement(bench: Bench, at: Text) -> dict[str, Any]:
    """How far people agree with one another and with the program, on what has been judged."""
    opened = bench.project(at)
    results, experiment = _results(opened), opened.understood().experiment
    if experiment is None:
        raise InputError(opened.draft.file, "", "cannot be read")
    return compare_judges(Reviewed(opened.results / RESULTS, results, experiment, _first(opened)))


@question
def judge(
    bench: Bench, at: Text, frame: Whole, i: Name, j: Name, verdict: Verdict | Text, reviewer: Reviewer,
    seconds: Annotated[Number, Field(ge=0.0)] = 0.0, blind: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Write a verdict down; the next run obeys it."""
    opened = bench.project(at)
    results, k = _frame(opened, frame)
    told = pairs.pair_history(results, i, j)
    if told is None or told["gap"][k] is None:
        raise BadRequest(f"there is no pair {i} {j} in frame {frame}")
    try:
        word = Verdict(verdict)
    except ValueError:
        raise BadRequest(f"{verdict} is no verdict") from None
    a, b = (i, j) if isinstance(i, int) else (j, i)
    assert isinstance(a, int)
    if isinstance(b, int) and b < a:
        a, b = b, a
    bench.reviewer = reviewer
    written = _log(opened).append(
        Entry(frame, reviewer, a, b, word, seconds=min(seconds, LONGEST), origin=Origin.CLICK, blind=blind)
    )
    keep_force(opened.results, written.line, force_of(results, k, a, b))
    return {"said": word.value}


@question
def judged(bench: Bench, at: Text, reviewer: Text) -> dict[str, Any]:
    """What this reviewer has said, and what became of the forces: before, and in the results that are there."""
    opened = bench.project(at)
    first = _first(opened)
    spoken = spoken_of(opened.results, _results(opened), _log(opened), reviewer, first)
    return {"pairs": [each.told(first) for each in spoken], "waiting": sum(not each.obeyed for each in spoken)}


@question
def unjudge(bench: Bench, at: Text, reviewer: Reviewer) -> dict[str, Any]:
    """Take the reviewer's last verdict back."""
    opened = bench.project(at)
    entry = _log(opened).undo(reviewer)
    if entry is None or entry.pair is None:
        return {"undone": None}
    return {
        "undone": entry.verdict, "frame": entry.frame, "i": entry.pair[1], "j": entry.pair[2],
    }  # fmt: skip


def _results(opened: Project) -> Results:
    found = opened.found()
    if found is None or found.results is None:
        raise InputError(opened.results, "", "holds no finished results: let the run come to its end")
    return found.results


def _frame(opened: Project, photograph: int) -> tuple[Results, int]:
    """The results, and which of their frames a photograph is."""
    results, frame = _results(opened), photograph - _first(opened)
    if not 0 <= frame < len(results.frames):
        raise InputError(opened.results, f"photograph {photograph}", f"is not there: {len(results.frames)} are")
    return results, frame


def _log(opened: Project) -> VerdictLog:
    return VerdictLog(opened.results / VERDICTS)


def _first(opened: Project) -> int:
    """The photograph of the run's frame 0."""
    found = opened.found()
    return 0 if found is None else found.first


def _threshold(opened: Project) -> float | None:
    experiment = opened.understood().experiment
    return None if experiment is None else experiment.config.contacts.threshold
