"""One review of one run: what the page asks, answered in plain values. Knows nothing of HTTP."""

from __future__ import annotations

import threading
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from solver.contacts.contacts import Contacts, measure_pairs
from solver.contacts.pairs import split_key

from ... import __version__
from ...recording.review_layer import (
    CONTACT,
    DETECTED,
    HIDDEN,
    NO_CONTACT,
    UNDETECTED,
    UNSURE,
    Marked,
)
from ...results.results import Results
from ...verdicts.decisions import Bodies
from ...verdicts.log import Entry, Flag, Origin, Pair, Verdict, VerdictLog, canonical
from ...verdicts.reviewers import reviewer_kappas
from ..judging.candidate_pairs import CandidatePairs, find_candidate_pairs, gap_sigma, walls_at
from ..judging.estimate import NO, UNJUDGED, YES, estimate_detector
from ..judging.queue import Queue, frame_queue, sampled_queue
from .picking import gap_at, nearest_candidate
from .picture import Picture

_KINDS = {Verdict.CONTACT: CONTACT, Verdict.NO_CONTACT: NO_CONTACT, Verdict.UNSURE: UNSURE}
_OUTCOMES = {Verdict.CONTACT: YES, Verdict.NO_CONTACT: NO, Verdict.UNSURE: UNJUDGED}
_ESTIMATE_SEED = 7  # the same verdicts give the same interval


class BadRequest(ValueError):
    """The page asked for something that does not exist."""


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """Who asks, and how they work."""

    reviewer: str
    frame: int  # of the run
    sampled: bool = False
    blind: bool = False


class ReviewSession:
    """Frames here count from 0 in the run; the log's frames are those of the experiment."""

    def __init__(
        self, results: Results, picture: Picture, log: VerdictLog, *, first_frame: int = 0,
        threshold: float | None = None,
    ) -> None:  # fmt: skip
        self.results, self.picture, self.log = results, picture, log
        self.first_frame = first_frame
        self.bodies = Bodies.of(results.tracks, results.walls)
        self._rows = self.bodies.rows()
        self._threshold = threshold
        self._candidates: dict[int, CandidatePairs] = {}
        self._queues: dict[int | None, tuple[Queue, dict[tuple[int, int], int]]] = {}
        self._detections: dict[int, dict[Pair, bool]] = {}
        self._lock = threading.RLock()

    def opening(self) -> dict[str, Any]:
        """What the page needs once."""
        return {
            "name": self.results.name, "version": __version__, "first_frame": self.first_frame,
            "frame_count": len(self.results.frames), "photographs": self.picture.photograph is not None,
            "grain_count": self.results.grains.count,
        }  # fmt: skip

    def status(self, view: Viewpoint) -> dict[str, Any]:
        """Progress, the estimate so far, agreement and flags."""
        self._check(view.frame)
        queue, places = self._queue(view)
        judged = self._judged(view.reviewer)
        flags = [e.flag.value for e in self.log.last_words(view.reviewer) if e.flag and e.on and self._here(e, view)]
        told: dict[str, Any] = {
            "judged": sum(pair in places for pair in judged),
            "total": queue.count,
            "flags": flags,
            "spoken": len(judged),
            "torn": self.log.torn,
        }
        if not view.blind:
            told["estimate"] = self._estimate(queue, places, judged, None if view.sampled else view.frame)
            told["agreement"] = self.agreement()
        return told

    def agreement(self) -> list[dict[str, Any]]:
        """Cohen's κ between all judges."""
        detected: dict[Pair, bool] = {}
        for frame in {pair[0] - self.first_frame for pair, _ in self.log.verdicts()}:
            if 0 <= frame < len(self.results.frames):
                detected |= self._detection(frame)
        return [_finite(asdict(each)) for each in reviewer_kappas(self.log, detected)]

    def following(self, view: Viewpoint, after: tuple[int, int] | None = None) -> dict[str, Any] | None:
        """The next doubtful candidate, None when all are judged."""
        queue, _ = self._queue(view)
        place = queue.following(self._judged(view.reviewer), after)
        if place is None:
            return None
        return self.describe(view, int(queue.frame[place]), int(queue.key[place]), Origin.QUEUE)

    def describe(self, view: Viewpoint, frame: int, key: int, origin: Origin) -> dict[str, Any]:
        """All that the page shows of one pair. In blind mode nothing that tells the detector's answer."""
        pair = self._measure(frame, key)
        i, j = int(pair.i[0]), int(pair.j[0])
        canvas, tracks = self.picture.canvas, self.results.tracks
        said = self._judged(view.reviewer).get((frame, key))
        circles = [
            [*canvas.points(tracks.position[frame, row]).tolist(), float(canvas.lengths(tracks.radius[row]))]
            for row in (i, j)
            if row < self.results.grains.count
        ]
        wall = None
        if j >= self.results.grains.count:
            wall = canvas.points(self.results.walls.outlines(frame)[j - self.results.grains.count]).tolist()
        told: dict[str, Any] = {
            "frame": frame, "key": str(key), "a": self.bodies.name(i), "b": self.bodies.name(j),
            "point": canvas.points(pair.point[0]).tolist(), "circles": circles, "wall": wall,
            "windows": [asdict(each) for each in self.picture.windows(pair.point[0])],
            "verdict": said.verdict.value if said is not None and said.verdict is not None else None,
            "origin": origin.value,
        }  # fmt: skip
        if not view.blind:
            told |= self._measured(frame, key, pair)
        return told

    def pick(self, view: Viewpoint, x: float, y: float) -> dict[str, Any]:
        """Answer a click at a pixel of the picture: select a candidate, or add the contact that was missed there."""
        self._check(view.frame)
        canvas = self.picture.canvas
        point = canvas.scale.to_world(np.array([x, y]) - 0.5)
        candidates = self.candidates(view.frame)
        row = nearest_candidate(candidates, point, float(self.results.grains.radius.mean()))
        if row is not None:
            key = int(candidates.key[row])
            return {"pair": self.describe(view, view.frame, key, Origin.CLICK), "added": False}
        bodies = gap_at(self.results, view.frame, point)
        if bodies is None:
            return {"pair": None, "added": False}
        key = self.bodies.key(*bodies)
        if (view.frame, key) in self._judged(view.reviewer):
            return {"pair": self.describe(view, view.frame, key, Origin.ADDED), "added": False}
        self.judge(view, view.frame, key, Verdict.CONTACT, 0.0, Origin.ADDED)
        return {"pair": self.describe(view, view.frame, key, Origin.ADDED), "added": True}

    def named(self, view: Viewpoint, a: str, b: str) -> dict[str, Any]:
        """Select a pair by the names of its bodies, whether or not it is a candidate."""
        i, j = self._row(a), self._row(b)
        present = self.results.tracks.present[self._check(view.frame)]
        n = self.results.grains.count
        if i is None or j is None or i == j or min(i, j) >= n:
            raise BadRequest(f"there is no pair {a} {b}")
        if not all(row >= n or present[row] for row in (i, j)):
            raise BadRequest(f"a grain of the pair {a} {b} is lost in this frame")
        key = self.bodies.key(i, j)
        known = key in self.candidates(view.frame).key
        return self.describe(view, view.frame, key, Origin.CLICK if known else Origin.ADDED)

    def judge(
        self, view: Viewpoint, frame: int, key: int, verdict: Verdict, seconds: float, origin: Origin
    ) -> dict[str, Any]:
        """Write a verdict down."""
        pair = self._measure(frame, key)
        number, a, b = self._pair(frame, int(pair.i[0]), int(pair.j[0]))
        entry = self.log.append(
            Entry(number, view.reviewer, a, b, verdict, seconds=seconds, origin=origin, blind=view.blind)
        )
        return {"line": entry.line}

    def flag(self, view: Viewpoint, flag: Flag, on: bool) -> None:
        self.log.append(Entry(self._check(view.frame) + self.first_frame, view.reviewer, flag=flag, on=on))

    def undo(self, view: Viewpoint) -> dict[str, Any]:
        """Take the reviewer's last line back, and show the pair it was about."""
        entry = self.log.undo(view.reviewer)
        if entry is None:
            return {"undone": None, "pair": None}
        frame = entry.frame - self.first_frame
        if entry.pair is None:
            return {"undone": entry.flag.value if entry.flag else None, "pair": None, "frame": frame}
        i, j = (self._rows.get(each) for each in entry.pair[1:])
        if i is None or j is None or not 0 <= frame < len(self.results.frames):
            return {"undone": str(entry.verdict), "pair": None}
        pair = self.describe(view, frame, self.bodies.key(i, j), entry.origin)
        return {"undone": str(entry.verdict), "pair": pair, "frame": frame}

    def marks(self, view: Viewpoint, chosen: int | None) -> bytes:
        """The frame's candidates and this reviewer's verdicts, for the viewer."""
        found = self.candidates(self._check(view.frame))
        said = {key: entry for (frame, key), entry in self._judged(view.reviewer).items() if frame == view.frame}
        extra = [key for key in sorted(set(said) - set(found.key.tolist())) if self._can_be_seen(view.frame, key)]
        contacts, more = found.contacts, self._measure_all(view.frame, extra)
        kind = np.where(found.detected, DETECTED, UNDETECTED) if not view.blind else np.full(found.count, HIDDEN)
        kind = np.concatenate([kind, np.zeros(len(extra), np.int64)])
        keys = [*found.key.tolist(), *extra]
        for row, key in enumerate(keys):
            verdict = said[key].verdict if key in said else None
            if verdict is not None:
                kind[row] = _KINDS[verdict]
        point = np.concatenate([contacts.point, more.point])
        normal = np.concatenate([contacts.normal, more.normal])
        pair, at = None, None
        if chosen is not None:
            one = self._measure(view.frame, chosen)
            pair, at = (int(one.i[0]), int(one.j[0])), one.point[0]
        return self.picture.marks(Marked(point, normal, kind), pair, view.frame, at)

    def point_of(self, frame: int, key: int) -> np.ndarray:
        """Contact point of a pair (2,) [m]."""
        return self._measure(frame, key).point[0]

    def candidates(self, frame: int) -> CandidatePairs:
        with self._lock:
            if frame not in self._candidates:
                self._candidates[frame] = find_candidate_pairs(self.results, frame, self._threshold)
            return self._candidates[frame]

    def _queue(self, view: Viewpoint) -> tuple[Queue, dict[tuple[int, int], int]]:
        """The queue of a frame or of the sample, with every candidate's place in it."""
        which = None if view.sampled else self._check(view.frame)
        with self._lock:
            if which not in self._queues:
                every = [self.candidates(k) for k in range(len(self.results.frames))] if which is None else []
                queue = sampled_queue(every) if which is None else frame_queue(self.candidates(which))
                pairs = zip(queue.frame.tolist(), queue.key.tolist(), strict=True)
                self._queues[which] = queue, {pair: place for place, pair in enumerate(pairs)}
            return self._queues[which]

    def _detection(self, frame: int) -> dict[Pair, bool]:
        """What the detector said of a frame's candidates, by name."""
        with self._lock:
            if frame not in self._detections:
                found = self.candidates(frame)
                rows = zip(found.contacts.i.tolist(), found.contacts.j.tolist(), found.detected.tolist(), strict=True)
                self._detections[frame] = {self._pair(frame, i, j): yes for i, j, yes in rows}
            return self._detections[frame]

    def _judged(self, reviewer: str) -> dict[tuple[int, int], Entry]:
        """The reviewer's last word on every pair of the run, by frame and key."""
        found = {}
        for (number, a, b), entry in self.log.verdicts(reviewer):
            frame, i, j = number - self.first_frame, self._rows.get(a), self._rows.get(b)
            if i is not None and j is not None and 0 <= frame < len(self.results.frames):
                found[(frame, self.bodies.key(i, j))] = entry
        return found

    def _estimate(
        self,
        queue: Queue,
        places: dict[tuple[int, int], int],
        judged: dict[tuple[int, int], Entry],
        frame: int | None,
    ) -> dict[str, Any]:
        outcome = np.full(queue.count, UNJUDGED)
        chosen = np.zeros(queue.count, np.bool_)
        missed = 0
        for pair, entry in judged.items():
            assert entry.verdict is not None
            place = places.get(pair)
            if place is not None:
                outcome[place] = _OUTCOMES[entry.verdict]
                chosen[place] = entry.origin is Origin.QUEUE
            elif entry.verdict is Verdict.CONTACT and (frame is None or pair[0] == frame):
                missed += 1
        rng = np.random.default_rng(_ESTIMATE_SEED)
        return asdict(estimate_detector(queue.stratum, queue.detected, queue.probability, outcome, chosen, missed, rng))

    def _measured(self, frame: int, key: int, pair: Contacts) -> dict[str, Any]:
        candidates = self.candidates(frame)
        row = np.flatnonzero(candidates.key == key)
        deviation = float(self.results.tracks.position_sigma[frame])
        return _finite({
            "gap_um": 1e6 * float(pair.gap[0]),
            "sigma_um": 1e6 * float(gap_sigma(pair, deviation)[0]),
            "threshold_um": 1e6 * candidates.threshold,
            "detected": bool(candidates.detected[row[0]]) if len(row) else False,
            "probability": float(candidates.probability[row[0]]) if len(row) else None,
        })  # fmt: skip

    def _measure(self, frame: int, key: int) -> Contacts:
        i, j = split_key(key, self.bodies.count)
        self._check(frame)
        if not 0 <= i < min(j, self.results.grains.count) or not self._can_be_seen(frame, key):
            raise BadRequest(f"there is no pair {key} in frame {frame}")
        return self._measure_all(frame, [key])

    def _can_be_seen(self, frame: int, key: int) -> bool:
        """Whether both bodies have a pose in the frame."""
        n = self.results.grains.count
        here = self.results.tracks.present[frame]
        return all(row >= n or bool(here[row]) for row in split_key(key, self.bodies.count))

    def _measure_all(self, frame: int, keys: list[int]) -> Contacts:
        position, walls = self.results.tracks.position[frame], walls_at(self.results, frame)
        return measure_pairs(self.results.grains, position, walls, np.array(keys, np.int64))

    def _row(self, name: str) -> int | None:
        """Row of a body by what a person calls it; a wall's name goes before a grain's id."""
        if name in self._rows:
            return self._rows[name]
        return self._rows.get(int(name)) if name.lstrip("-").isdecimal() else None

    def _pair(self, frame: int, i: int, j: int) -> Pair:
        a = self.bodies.name(i)
        assert isinstance(a, int)
        return canonical((frame + self.first_frame, a, self.bodies.name(j)))

    def _here(self, entry: Entry, view: Viewpoint) -> bool:
        return entry.frame == view.frame + self.first_frame

    def _check(self, frame: int) -> int:
        if not 0 <= frame < len(self.results.frames):
            raise BadRequest(f"there is no frame {frame}")
        return frame


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    """JSON has no NaN."""
    return {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in values.items()}
