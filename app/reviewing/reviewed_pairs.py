"""Forces of pairs when they were judged, stored beside the verdicts and compared with the present results."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..results.results import Results
from ..solver.contacts.pairs import match_values
from ..verdicts.decisions import BodyNames
from ..verdicts.log import Body, Entry, Verdict, VerdictLog, canonical
from .reviewed_run import ReviewedRun
from .rounding import rounded_one

JUDGED = "judged_forces.csv"
COLUMNS = ("line", "fn", "ft")  # the line of verdicts.jsonl; newtons, empty where the pair was no contact
Force = tuple[float | None, float | None]  # f_n and f_t [N]; None: the pair is no contact


@dataclass(frozen=True, slots=True)
class ReviewedPair:
    """A verdict, and the force of the pair before it and in the present results."""

    frame: int  # of the experiment
    i: int
    j: Body
    verdict: str
    before: Force | None  # None: nothing was stored
    now: Force
    applied: bool  # the results are newer than the verdict and comply with it


class ForceLookup:
    """f_n and f_t of pairs by the names of their bodies; the frame used last is kept."""

    def __init__(self, results: Results) -> None:
        self._bodies = BodyNames.of(results.tracks, results.walls)
        self._rows = self._bodies.rows()
        self._frame = lru_cache(1)(lambda frame: results.frames[frame])

    def __call__(self, frame: int, i: Body, j: Body) -> Force:
        """Look up the force [N] of a pair in a frame of the run; None where it is no contact."""
        rows = self._rows
        if i not in rows or j not in rows or i == j:
            return None, None
        forces = self._frame(frame)
        key = np.array([self._bodies.key(*sorted((rows[i], rows[j])))], np.int64)
        fn, ft = (rounded_one(match_values(key, forces.contacts.key, each, fill=np.nan)[0])
                  for each in (forces.fn, forces.ft))  # fmt: skip
        return fn, ft


def store_forces(run: ReviewedRun, entries: Sequence[Entry]) -> None:
    """Append the present force of every judged pair to the table beside the verdicts.

    Every way to give a verdict (the page, an imported table) calls this after the verdict is logged. Entries are those
    that the log returned, with the names of their lines.
    """
    rows, lookup = [], ForceLookup(run.results)
    for entry in entries:
        if entry.pair is None or entry.frame not in run.photographs():
            continue
        force = lookup(entry.frame - run.first_frame, entry.pair[1], entry.pair[2])
        rows.append((entry.line, *("" if each is None else each for each in force)))
    if not rows:
        return
    file = run.folder / JUDGED
    new = not file.exists()
    with file.open("a", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        if new:
            writer.writerow(COLUMNS)
        writer.writerows(rows)


def reviewed_pairs(run: ReviewedRun, log: VerdictLog, reviewer: str) -> list[ReviewedPair]:
    """List a reviewer's last verdicts on pairs of the run, the latest first."""
    stored = _stored_forces(run.folder / JUDGED)
    solved = run.file.stat().st_mtime
    pairs, lookup = [], ForceLookup(run.results)
    for pair, entry in sorted(log.verdicts(reviewer), key=lambda each: each[1].time, reverse=True):
        number, i, j = canonical(pair)
        if entry.verdict is None or number not in run.photographs():
            continue
        now = lookup(number - run.first_frame, i, j)
        complies = {Verdict.CONTACT: now[0] is not None, Verdict.NO_CONTACT: not now[0]}.get(entry.verdict, True)
        newer = datetime.fromisoformat(entry.time).timestamp() < solved
        pairs.append(ReviewedPair(number, i, j, entry.verdict.value, stored.get(entry.line), now, newer and complies))
    return pairs


def _stored_forces(file: Path) -> dict[str, Force]:
    if not file.is_file():
        return {}
    with file.open(newline="") as stream:
        return {row["line"]: (_number(row["fn"]), _number(row["ft"])) for row in csv.DictReader(stream)}


def _number(text: str | None) -> float | None:
    return float(text) if text else None
