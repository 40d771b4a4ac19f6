"""The majority decisions of all reviewers: pairs that touch, pairs that do not, and flagged frames."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..process.frame_range import FrameRange
from ..solver.contacts.pairs import make_key
from ..solver.contacts.verdicts import Verdicts
from ..tracks import Tracks, WallTracks
from .log import Body, Flag, Verdict, VerdictLog


@dataclass(frozen=True, slots=True)
class Decisions:
    """Verdicts on the rows of one run: bodies by row, a wall's row after the grains'."""

    contact: frozenset[tuple[int, int]] = frozenset()  # (frame of the run, key of the pair)
    no_contact: frozenset[tuple[int, int]] = frozenset()
    disputed: frozenset[tuple[int, int]] = frozenset()  # equal votes for both, or all unsure
    unknown: int = 0  # verdicts on a frame or a body that the run does not have
    flags: dict[int, frozenset[Flag]] = field(default_factory=dict)  # by frame of the run

    @property
    def count(self) -> int:
        return len(self.contact) + len(self.no_contact)

    def forced(self, frame: int) -> NDArray[np.int64]:
        """Return the keys of the pairs that touch in a frame, ascending."""
        return _keys(self.contact, frame)

    def forbidden(self, frame: int) -> NDArray[np.int64]:
        """Return the keys of the pairs that do not touch in a frame, ascending."""
        return _keys(self.no_contact, frame)

    def for_solver(self) -> dict[int, Verdicts]:
        """Return the constraints for the solver by frame of the run."""
        frames = {frame for frame, _ in self.contact | self.no_contact} | set(self.flags)
        return {
            frame: Verdicts(
                self.forced(frame),
                self.forbidden(frame),
                rearrangement=Flag.REARRANGEMENT in self.flags.get(frame, ()),
                reset=Flag.RESET in self.flags.get(frame, ()),
                ignored=Flag.IGNORE in self.flags.get(frame, ()),
            )
            for frame in sorted(frames)
        }


@dataclass(frozen=True, slots=True)
class BodyNames:
    """The names of grains and walls, and their rows."""

    grains: tuple[int, ...]  # ids
    walls: tuple[str, ...]

    @classmethod
    def of(cls, tracks: Tracks, walls: WallTracks | None) -> BodyNames:
        """Return the names of the bodies of tracks."""
        return cls(tuple(int(each) for each in tracks.id), walls.name if walls is not None else ())

    @property
    def count(self) -> int:
        return len(self.grains) + len(self.walls)

    def rows(self) -> dict[Body, int]:
        """Return the row of every body by its name."""
        by_id: dict[Body, int] = {each: row for row, each in enumerate(self.grains)}
        return by_id | {name: len(self.grains) + row for row, name in enumerate(self.walls)}

    def name(self, row: int) -> Body:
        """Return the name of the body in a row."""
        n = len(self.grains)
        return self.grains[row] if row < n else self.walls[row - n]

    def key(self, i: int, j: int) -> int:
        """Return the key of a pair of rows, in either order."""
        return make_key(i, j, self.count)


def decide(log: VerdictLog, bodies: BodyNames, *, frames: FrameRange, frame_count: int) -> Decisions:
    """Decide every judged pair by the majority of its reviewers, each counted with the latest verdict.

    Parameters
    ----------
    log
        The log; its frames are those of the experiment.
    bodies
        Names and rows of the run's bodies.
    frames, frame_count
        Photographs that the run covers, and their number.
    """
    row_of = {frames.number(row): row for row in range(frame_count)}
    rows = bodies.rows()
    votes: dict[tuple[int, int], Counter[Verdict]] = {}
    unknown = 0
    for (frame, a, b), entry in log.verdicts():
        i, j = rows.get(a), rows.get(b)
        if i is None or j is None or frame not in row_of:
            unknown += 1
            continue
        assert entry.verdict is not None
        votes.setdefault((row_of[frame], bodies.key(i, j)), Counter())[entry.verdict] += 1
    lead = {pair: count[Verdict.CONTACT] - count[Verdict.NO_CONTACT] for pair, count in votes.items()}
    flags: dict[int, set[Flag]] = {}
    for entry in log.latest_entries():
        if entry.flag is not None and entry.on and entry.frame in row_of:
            flags.setdefault(row_of[entry.frame], set()).add(entry.flag)
    return Decisions(
        frozenset(pair for pair, majority in lead.items() if majority > 0),
        frozenset(pair for pair, majority in lead.items() if majority < 0),
        frozenset(pair for pair, majority in lead.items() if majority == 0),
        unknown,
        {frame: frozenset(each) for frame, each in flags.items()},
    )


def _keys(pairs: frozenset[tuple[int, int]], frame: int) -> NDArray[np.int64]:
    return np.array(sorted(key for k, key in pairs if k == frame), np.int64)
