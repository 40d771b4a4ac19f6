"""Questions of inspection and review: a pair's evidence, what is at stake, verdicts, which go to the log as ever."""

from __future__ import annotations

import getpass
from typing import Annotated, Any

from pydantic import Field, StringConstraints

from ...errors import InputError
from ...results.hdf5.store import read_origin
from ...results.results import Results
from ...review.reviewed_run import Reviewed
from ...run_folder import RESULTS
from ...verdicts.log import VERDICTS, Entry, Origin, Verdict, VerdictLog
from ..inspecting import found as inspecting
from ..inspecting import pairs
from ..inspecting.agreement import agreement as compare_judges
from .bench import Bench
from .project import Project
from .questions import BadRequest, Number, Text, Whole, question
from .run_questions import Name, scale_of

Reviewer = Annotated[str, StringConstraints(min_length=1, max_length=60, strip_whitespace=True)]
LONGEST = 300.0  # [s] of one judgement: beyond it the reviewer was away


@question
def reviewer(bench: Bench) -> dict[str, Any]:
    """Who sits here, as the machine knows."""
    try:
        return {"name": getpass.getuser()}
    except (OSError, KeyError):  # a machine without user names
        return {"name": "reviewer"}


@question
def candidates(bench: Bench, at: Text, frame: Whole, reviewer: Reviewer) -> dict[str, Any]:
    """The pairs of a frame, those first on which most hangs, and what this reviewer has said of them."""
    opened = bench.project(at)
    results = _results(opened, frame)
    said = pairs.verdicts_of(_log(opened), frame + _first(opened), reviewer)
    found = pairs.candidates_of(results, frame, _threshold(opened))
    return {"frame": frame, "pairs": pairs.told_candidates(results, found, scale_of(opened), said), "judged": len(said)}


@question
def pair(bench: Bench, at: Text, i: Name, j: Name) -> dict[str, Any]:
    """One pair in every frame; places in pixels."""
    opened = bench.project(at)
    told = pairs.pair_history(_results(opened, 0), i, j)
    if told is None:
        raise BadRequest(f"there is no pair {i} {j}")
    scale = scale_of(opened)
    told["point"] = [None if p is None else scale.to_pixels(p).round(2).tolist() for p in told["point"]]
    return told


@question
def without(bench: Bench, at: Text, frame: Whole, i: Name, j: Name) -> dict[str, Any]:
    """The nearest forces of a frame in which a contact is not there; nothing is written."""
    told = pairs.without_pair(_results(bench.project(at), frame), frame, i, j)
    if told is None:
        raise InputError(f"{i} - {j}", f"frame {frame}", "is no contact there")
    return told


@question
def rod(bench: Bench, at: Text, id: Whole) -> dict[str, Any]:
    """One rod in every frame."""
    opened = bench.project(at)
    tracks = _results(opened, 0).tracks
    rows = (tracks.id == id).nonzero()[0]
    if len(rows) != 1:
        raise BadRequest(f"there is no rod {id}")
    row = int(rows[0])
    return {
        "radius": float(tracks.radius[row]), "zncc": inspecting.plain(tracks.zncc[:, row]),
        "sigma": inspecting.plain(tracks.sigma[:, row]), "rotation": inspecting.plain(tracks.rotation[:, row]),
        "status": [inspecting.TrackStatus(each).name.lower() for each in tracks.status[:, row].tolist()],
        "unbalance": inspecting.plain([
            float("nan") if f.grain_unbalance is None else f.grain_unbalance[row] for f in _results(opened, 0).frames
        ]),
    }  # fmt: skip


@question
def agreement(bench: Bench, at: Text) -> dict[str, Any]:
    """How far people agree with one another and with the program, on what has been judged."""
    opened = bench.project(at)
    results, experiment = _results(opened, 0), opened.understood().experiment
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
    results = _results(opened, frame)
    told = pairs.pair_history(results, i, j)
    if told is None or told["gap"][frame] is None:
        raise BadRequest(f"there is no pair {i} {j} in frame {frame}")
    try:
        word = Verdict(verdict)
    except ValueError:
        raise BadRequest(f"{verdict} is no verdict") from None
    a, b = (i, j) if isinstance(i, int) else (j, i)
    assert isinstance(a, int)
    if isinstance(b, int) and b < a:
        a, b = b, a
    number = frame + _first(opened)
    _log(opened).append(
        Entry(number, reviewer, a, b, word, seconds=min(seconds, LONGEST), origin=Origin.CLICK, blind=blind)
    )
    return {"said": word.value}


@question
def unjudge(bench: Bench, at: Text, reviewer: Reviewer) -> dict[str, Any]:
    """Take the reviewer's last verdict back."""
    opened = bench.project(at)
    entry = _log(opened).undo(reviewer)
    if entry is None or entry.pair is None:
        return {"undone": None}
    return {
        "undone": entry.verdict, "frame": entry.frame - _first(opened), "i": entry.pair[1], "j": entry.pair[2],
    }  # fmt: skip


def _results(opened: Project, frame: int) -> Results:
    found = opened.found()
    if found is None or found.results is None:
        raise InputError(opened.results, "", "holds no finished results: let the run come to its end")
    if frame >= len(found.frames):
        raise InputError(opened.results, f"frame {frame}", f"is not there: {len(found.frames)} are")
    return found.results


def _log(opened: Project) -> VerdictLog:
    return VerdictLog(opened.results / VERDICTS)


def _first(opened: Project) -> int:
    """The run's first frame among the experiment's."""
    origin = read_origin(opened.results / RESULTS)
    return 0 if origin is None else origin.frames[0]


def _threshold(opened: Project) -> float | None:
    experiment = opened.understood().experiment
    return None if experiment is None else experiment.config.contacts.threshold
