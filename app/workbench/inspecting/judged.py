"""What a pair carried when it was judged, kept beside the verdicts: once a run has obeyed, its card shows both."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from solver.contacts.pairs import recall

from ...results.results import Results
from ...run_folder import RESULTS
from ...verdicts.decisions import Bodies
from ...verdicts.log import Body, Verdict, VerdictLog, canonical
from .found import plain

JUDGED = "judged_forces.csv"
COLUMNS = ("line", "fn", "ft")  # the line of verdicts.jsonl; newtons, empty where the pair was no contact
Force = tuple[float | None, float | None]


@dataclass(frozen=True, slots=True)
class Spoken:
    """A verdict and what became of the pair's force: before it, and in the results that are there."""

    frame: int  # of the run
    i: int
    j: Body
    verdict: str
    before: Force | None  # None: nothing was kept
    now: Force
    obeyed: bool  # whether the results are newer than the verdict, and do what it says

    def told(self, first: int) -> dict[str, Any]:
        """As plain values; first: the photograph of the run's frame 0."""
        before = None if self.before is None else dict(zip(("fn", "ft"), self.before, strict=True))
        return {
            "frame": self.frame + first, "i": self.i, "j": self.j, "verdict": self.verdict, "before": before,
            "now": dict(zip(("fn", "ft"), self.now, strict=True)), "obeyed": self.obeyed,
        }  # fmt: skip


def force_of(results: Results, frame: int, i: Body, j: Body) -> Force:
    """f_n and f_t [N] of a pair in a frame of the run; None: it is no contact there."""
    bodies = Bodies.of(results.tracks, results.walls)
    rows = bodies.rows()
    if i not in rows or j not in rows or i == j:
        return None, None
    forces = results.frames[frame]
    key = np.array([bodies.key(*sorted((rows[i], rows[j])))], np.int64)
    fn, ft = (plain(recall(key, forces.contacts.key, each, fill=np.nan))[0] for each in (forces.fn, forces.ft))
    return fn, ft


def keep_force(run: Path, line: str, force: Force) -> None:
    """Note what the pair of a verdict's line carries now."""
    file = run / JUDGED
    new = not file.exists()
    with file.open("a", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        if new:
            writer.writerow(COLUMNS)
        writer.writerow((line, *("" if each is None else each for each in force)))


def spoken_of(run: Path, results: Results, log: VerdictLog, reviewer: str, first: int) -> list[Spoken]:
    """A reviewer's last words on pairs of the run, the latest first; first: the photograph of its frame 0."""
    kept = _kept(run / JUDGED)
    solved = (run / RESULTS).stat().st_mtime
    told = []
    for pair, entry in sorted(log.verdicts(reviewer), key=lambda each: each[1].time, reverse=True):
        number, i, j = canonical(pair)
        frame = number - first
        if entry.verdict is None or not 0 <= frame < len(results.frames):
            continue
        now = force_of(results, frame, i, j)
        borne = {Verdict.CONTACT: now[0] is not None, Verdict.NO_CONTACT: not now[0]}.get(entry.verdict, True)
        newer = datetime.fromisoformat(entry.time).timestamp() < solved
        told.append(Spoken(frame, i, j, entry.verdict.value, kept.get(entry.line), now, newer and borne))
    return told


def _kept(file: Path) -> dict[str, Force]:
    if not file.is_file():
        return {}
    with file.open(newline="") as stream:
        return {row["line"]: (_number(row["fn"]), _number(row["ft"])) for row in csv.DictReader(stream)}


def _number(text: str | None) -> float | None:
    return float(text) if text else None
