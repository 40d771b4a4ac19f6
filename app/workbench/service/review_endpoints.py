"""Endpoints of the review: the queue, verdicts and flags, undo, the agreement of reviewers."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, StringConstraints

from ...reviewing.agreement import describe_agreement
from ...reviewing.reviewed_pairs import reviewed_pairs as list_reviewed_pairs
from ...reviewing.session import Order, ReviewSession, View
from ...verdicts.log import Entry, Flag, Origin, Verdict
from ...verdicts.reviewer_name import account_name
from ..inspecting.run_data import list_rods
from .endpoints import Name, Number, Text, Values, Whole, endpoint
from .project import Project
from .workbench import Workbench

LONGEST = 300.0  # [s] of one verdict: beyond it the reviewer was away


def _printable(name: str) -> str:
    name = " ".join(name.split())
    if not name or not name.isprintable():
        raise ValueError("a reviewer has a name of 1 to 60 printable characters")
    return name


Reviewer = Annotated[str, StringConstraints(min_length=1, max_length=60), AfterValidator(_printable)]
Seconds = Annotated[Number, Field(ge=0.0)]


class ViewValues(Values):
    """The reviewer and the settings of the page. frame: of the experiment."""

    reviewer: Reviewer
    frame: Whole
    order: Literal["influence", "frame", "sample"] = "influence"
    blind: bool = False

    def view(self) -> View:
        return View(self.reviewer, self.frame, Order(self.order), self.blind)


class PairValues(Values):
    """A pair by frame of the experiment and names of its bodies."""

    frame: Whole
    i: Name
    j: Name


@endpoint
def reviewer(workbench: Workbench) -> dict[str, Any]:
    """Name the last reviewer, or the user of the account; empty: the page requests a name."""
    return {"name": workbench.reviewer or account_name()}


@endpoint
def review_status(opened: Project, view: ViewValues) -> dict[str, Any]:
    """Describe progress, flags, estimated accuracy and agreement."""
    return opened.review_session().status(view.view())


@endpoint
def candidate_pairs(opened: Project, view: ViewValues) -> dict[str, Any]:
    """List rods, walls and candidate pairs of a photograph, by influence times ambiguity, with verdicts."""
    session = opened.review_session()
    listed, frame = session.list_pairs(view.view()), view.frame - session.run.first_frame
    results, scale = session.results, session.scale
    return {
        "frame": view.frame, "pairs": listed, "judged": sum(each["verdict"] is not None for each in listed),
        "rods": list_rods(results.tracks, frame, scale),
        "walls": [scale.to_pixels(line).round(2).tolist() for line in results.walls.outlines(frame)],
    }  # fmt: skip


@endpoint
def next_pair(opened: Project, view: ViewValues, after: PairValues | None = None) -> dict[str, Any]:
    """Describe the next pair without a verdict."""
    session = opened.review_session()
    key = None
    if after is not None:
        frame = after.frame - session.run.first_frame
        key = (frame, session.key_of(frame, after.i, after.j)) if after.frame in session.run.photographs() else None
    return {"pair": session.next_pair(view.view(), key)}


@endpoint
def pair_at(workbench: Workbench, at: Text, view: ViewValues, x: Number, y: Number) -> dict[str, Any]:
    """Select the candidate pair at a pixel, or add the contact that was missed there."""
    workbench.reviewer = view.reviewer
    answer = _session(workbench, at).pair_at(view.view(), x, y)
    if answer["added"]:
        _record(workbench, at, view.reviewer)
    return answer


@endpoint
def pair_named(opened: Project, view: ViewValues, i: Name, j: Name) -> dict[str, Any]:
    """Select a pair by the names of its bodies."""
    return {"pair": opened.review_session().pair_named(view.view(), i, j)}


@endpoint
def judge(
    workbench: Workbench, at: Text, view: ViewValues, pair: PairValues,
    verdict: Literal["contact", "no contact", "unsure"], seconds: Seconds = 0.0,
    origin: Literal["queue", "click", "added"] = "click",
) -> dict[str, Any]:  # fmt: skip
    """Write a verdict, which the next run applies; describe the next pair."""
    workbench.reviewer = view.reviewer
    following = _session(workbench, at).judge(
        view.view(), (pair.frame, pair.i, pair.j), Verdict(verdict), min(seconds, LONGEST), Origin(origin)
    )
    _record(workbench, at, view.reviewer)
    return {"verdict": verdict, "pair": following}


@endpoint
def flag_frame(
    workbench: Workbench, at: Text, view: ViewValues, flag: Literal["rearrangement", "reset", "ignore"], on: bool
) -> dict[str, Any]:
    """Set or clear a flag of the photograph."""
    workbench.reviewer = view.reviewer
    _session(workbench, at).flag(view.view(), Flag(flag), on)
    _record(workbench, at, view.reviewer)
    return {"flag": flag, "on": on}


@endpoint
def undo_verdict(opened: Project, view: ViewValues) -> dict[str, Any]:
    """Undo the reviewer's last verdict or flag."""
    return opened.review_session().undo(view.view())


@endpoint
def reviewed_pairs(opened: Project, reviewer: Text) -> dict[str, Any]:
    """List this reviewer's verdicts with the forces before them and in the present results."""
    session = opened.review_session()
    pairs = list_reviewed_pairs(session.run, session.log, reviewer)
    return {
        "pairs": [
            {"frame": each.frame, "i": each.i, "j": each.j, "verdict": each.verdict, "applied": each.applied,
             "before": None if each.before is None else dict(zip(("fn", "ft"), each.before, strict=True)),
             "now": dict(zip(("fn", "ft"), each.now, strict=True))}
            for each in pairs
        ],
        "waiting": sum(not each.applied for each in pairs),
    }  # fmt: skip


@endpoint
def agreement(opened: Project) -> dict[str, Any]:
    """Compare the verdicts of all reviewers with each other and with the detector."""
    return describe_agreement(opened.review_session().run)


def _record(workbench: Workbench, at: str, reviewer: str) -> None:
    """Record the reviewer's last line in the journal of the experiment."""
    opened = workbench.project(at)
    entry = opened.review_session().log.last_line(reviewer)
    if entry is not None:
        opened.draft.journal.record_verdict(
            describe_line(entry), {"line": entry.line, "frame": entry.frame, "i": entry.a, "j": entry.b}
        )


def describe_line(entry: Entry) -> str:
    """Describe a line of the verdict log for its undo."""
    if entry.flag is not None:
        return f"photograph {entry.frame}: {entry.flag.value} {'set' if entry.on else 'cleared'}"
    pair = f"rods {entry.a} – {entry.b}" if isinstance(entry.b, int) else f"rod {entry.a} – {entry.b}"
    return f"photograph {entry.frame}, {pair}: {entry.verdict}"


def _session(workbench: Workbench, at: str) -> ReviewSession:
    return workbench.project(at).review_session()
