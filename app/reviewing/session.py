"""One review of one run: the queue, the evidence for each pair, verdicts, flags and undo, as plain values.

Frames are photographs of the experiment, places are pixels of the photograph. Nothing here depends on HTTP.
"""

from __future__ import annotations

import threading
from dataclasses import asdict, dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Any

import numpy as np

from ..experiment.units import Scale
from ..solver.contacts.contacts import Contacts, measure_pairs
from ..solver.contacts.pairs import Keys, match_values, split_key
from ..verdicts.log import Body, Entry, Flag, Origin, Pair, Verdict, canonical
from ..verdicts.reviewers import reviewer_kappas
from .agreement import detected_by_name
from .judging.candidate_pairs import CandidatePairs, find_candidate_pairs, gap_standard_deviation
from .judging.estimate import NO, UNJUDGED, YES, estimate_detector
from .judging.picking import gap_at, nearest_candidate
from .judging.queue import Queue, frame_queue, influence_priority, influence_queue, sampled_queue
from .reviewed_pairs import store_forces
from .reviewed_run import ReviewedRun
from .rounding import rounded, rounded_one

CROP_WIDTHS = (4.4, 2.2, 1.0)  # width of the magnified crop in mean grain diameters, one for each zoom
KEPT_FRAMES = 16  # whose candidate pairs and queues stay in memory
MOST_LISTED = 5000  # candidate pairs in the list of a frame
DIGITS = 5  # of the direction of a pair
_OUTCOMES = {Verdict.CONTACT: YES, Verdict.NO_CONTACT: NO, Verdict.UNSURE: UNJUDGED}
_ESTIMATE_SEED = 7  # the same verdicts give the same interval


class UnknownPair(ValueError):
    """A request names a pair or a frame that does not exist."""


class Order(StrEnum):
    """The order in which pairs come up."""

    INFLUENCE = "influence"  # of one frame: influence on the forces times ambiguity
    FRAME = "frame"  # of one frame: by strata, random inside each
    SAMPLE = "sample"  # of all frames: rounds that sample every stratum


@dataclass(frozen=True, slots=True)
class View:
    """The reviewer and the settings of the page."""

    reviewer: str
    frame: int  # of the experiment
    order: Order = Order.INFLUENCE
    blind: bool = False


class ReviewSession:
    """The review of one run. Keys and rows inside are those of the run, frames counted from 0."""

    def __init__(self, run: ReviewedRun, scale: Scale) -> None:
        """scale: of the photographs, with the run's calibration, or of the plain ground where there are none."""
        self.run, self.scale, self.results = run, scale, run.results
        self.log = run.log
        self.bodies = run.bodies
        self._rows = self.bodies.rows()
        self.candidates = lru_cache(KEPT_FRAMES)(self._find_candidates)  # of a frame of the run
        self._queue_of = lru_cache(KEPT_FRAMES)(self._make_queue)
        self._detected: dict[int, dict[Pair, bool]] = {}
        self._lock = threading.RLock()

    def status(self, view: View) -> dict[str, Any]:
        """Describe progress, flags of the frame, the estimated accuracy so far, and the agreement of judges.

        In blind mode everything that reveals the detector's answers is left out.
        """
        self._frame(view.frame)
        queue, places = self._queue(view)
        judged = self._judged(view.reviewer)
        flags = [
            entry.flag.value for entry in self.log.latest_entries(view.reviewer)
            if entry.flag and entry.on and entry.frame == view.frame
        ]  # fmt: skip
        values: dict[str, Any] = {
            "judged": sum(pair in places for pair in judged), "total": queue.count, "judged_in_run": len(judged),
            "flags": flags, "damaged_lines": self.log.damaged_lines,
            "first": self.run.photographs().start, "stop": self.run.photographs().stop,
        }  # fmt: skip
        if not view.blind:
            values["estimate"] = self._estimate(view, judged)
            values["sampled"] = sum(entry.origin is Origin.QUEUE for pair, entry in judged.items() if pair in places)
            values["kappas"] = self.kappas()
        return values

    def kappas(self) -> list[dict[str, Any]]:
        """Compute Cohen's κ of every two judges; the detector is one of them."""
        detected: dict[Pair, bool] = {}
        for number in {pair[0] for pair, _ in self.log.verdicts()}:
            if number in self.run.photographs():
                detected |= self._detected_by_name(number)
        return [_without_nan(asdict(each)) for each in reviewer_kappas(self.log, detected)]

    def next_pair(self, view: View, after: tuple[int, int] | None = None) -> dict[str, Any] | None:
        """Describe the next pair without a verdict; None if all are judged.

        after: frame of the run and key of the pair from which on the queue is searched.
        """
        queue, _ = self._queue(view)
        place = queue.next_place(self._judged(view.reviewer), after)
        if place is None:
            return None
        origin = Origin.QUEUE if queue.random else Origin.CLICK
        return self.describe(view, int(queue.frame[place]), int(queue.key[place]), origin)

    def describe(self, view: View, frame: int, key: int, origin: Origin) -> dict[str, Any]:
        """Describe a pair in a frame of the run; in blind mode without the detector's answer."""
        pair = self._measure(frame, key)
        i, j = int(pair.i[0]), int(pair.j[0])
        tracks, n = self.results.tracks, self.results.grains.count
        entry = self._judged(view.reviewer).get((frame, key))
        place = self.scale.to_pixels(pair.point[0])
        size = float(self.scale.size_at(place[None])[0])  # [m] of a pixel there
        circles = [
            [*self.scale.to_pixels(tracks.position[frame, row]).round(2).tolist(), float(tracks.radius[row]) / size]
            for row in (i, j) if row < n
        ]  # fmt: skip
        values: dict[str, Any] = {
            "frame": frame + self.run.first_frame, "i": self.bodies.name(i), "j": self.bodies.name(j),
            "point": place.round(2).tolist(), "circles": circles,
            "wall": self.scale.to_pixels(self.results.walls.outlines(frame)[j - n]).tolist() if j >= n else None,
            "crop_widths": [2.0 * each * float(tracks.radius.mean()) / size for each in CROP_WIDTHS],
            "verdict": entry.verdict.value if entry is not None and entry.verdict is not None else None,
            "origin": origin.value,
        }  # fmt: skip
        if not view.blind:
            values |= self._evidence(frame, key, pair)
        return values

    def pair_at(self, view: View, x: float, y: float) -> dict[str, Any]:
        """Select the candidate pair at a pixel, or add the contact that was missed there."""
        frame = self._frame(view.frame)
        point = self.scale.to_world(np.array([x, y]))
        candidates = self.candidates(frame)
        row = nearest_candidate(candidates, point, float(self.results.grains.radius.mean()))
        if row is not None:
            key = int(candidates.key[row])
            return {"pair": self.describe(view, frame, key, Origin.CLICK), "added": False}
        bodies = gap_at(self.results, frame, point)
        if bodies is None:
            return {"pair": None, "added": False}
        key = self.bodies.key(*bodies)
        added = (frame, key) not in self._judged(view.reviewer)
        if added:
            self._append(view, frame, key, Verdict.CONTACT, 0.0, Origin.ADDED)
        return {"pair": self.describe(view, frame, key, Origin.ADDED), "added": added}

    def pair_named(self, view: View, a: Body, b: Body) -> dict[str, Any]:
        """Select a pair by the names of its bodies, whether or not it is a candidate pair."""
        frame = self._frame(view.frame)
        key = self.key_of(frame, a, b)
        known = key in self.candidates(frame).key
        return self.describe(view, frame, key, Origin.CLICK if known else Origin.ADDED)

    def key_of(self, frame: int, a: Body, b: Body) -> int:
        """Return the key of a pair in a frame of the run by the names of its bodies.

        Raises
        ------
        UnknownPair
            There is no such pair, or one of its grains is lost in the frame.
        """
        i, j = self._row(a), self._row(b)
        n = self.results.grains.count
        if i is None or j is None or i == j or min(i, j) >= n:
            raise UnknownPair(f"there is no pair {a} {b}")
        if not all(row >= n or self.results.tracks.present_in(frame)[row] for row in (i, j)):
            raise UnknownPair(f"a grain of the pair {a} {b} is lost in this frame")
        return self.bodies.key(i, j)

    def judge(
        self, view: View, pair: tuple[int, Body, Body], verdict: Verdict, seconds: float, origin: Origin
    ) -> dict[str, Any] | None:
        """Write a verdict on a pair (frame of the experiment, two bodies); describe the next pair or return None.

        The next pair is part of the answer: one request for one key.
        """
        frame = self._frame(pair[0])
        key = self.key_of(frame, pair[1], pair[2])
        self._append(view, frame, key, verdict, seconds, origin)
        return self.next_pair(view, (frame, key))

    def flag(self, view: View, flag: Flag, on: bool) -> None:
        """Set or clear a flag of the frame."""
        self._frame(view.frame)
        self.log.append(Entry(view.frame, view.reviewer, flag=flag, on=on))

    def undo(self, view: View) -> dict[str, Any]:
        """Undo the reviewer's last verdict or flag, and describe its pair."""
        entry = self.log.undo(view.reviewer)
        if entry is None:
            return {"undone": None, "pair": None, "frame": None}
        undone = entry.flag.value if entry.flag is not None else str(entry.verdict)
        pair = None
        if entry.pair is not None and entry.frame in self.run.photographs():
            i, j = (self._rows.get(each) for each in entry.pair[1:])
            frame = entry.frame - self.run.first_frame
            if i is not None and j is not None and self._both_present(frame, self.bodies.key(i, j)):
                pair = self.describe(view, frame, self.bodies.key(i, j), entry.origin)
        return {"undone": undone, "pair": pair, "frame": entry.frame}

    def list_pairs(self, view: View) -> list[dict[str, Any]]:
        """List the candidate pairs of a frame and other pairs that this reviewer judged, for the picture.

        They are ordered by influence times ambiguity; in blind mode in random order, with place and verdict only.
        """
        frame = self._frame(view.frame)
        found = self.candidates(frame)
        verdicts = {key: entry.verdict for (k, key), entry in self._judged(view.reviewer).items() if k == frame}
        known = set(found.key.tolist())
        others = [key for key in sorted(verdicts) if key not in known and self._both_present(frame, key)]
        keys = np.concatenate([influence_queue(self.results, found, blind=view.blind).key, others]).astype(np.int64)
        keys = keys[:MOST_LISTED]
        pairs = measure_pairs(
            self.results.grains, self.results.tracks.position[frame], self.results.walls.at_rest(frame), keys
        )
        # measure_pairs sorts its pairs by key
        row = np.searchsorted(pairs.key, keys)
        place = self.scale.to_pixels(pairs.point[row]).round(2).tolist()
        normal = (pairs.normal[row] * (1.0, -1.0)).round(DIGITS).tolist()  # y down
        listed: list[dict[str, Any]] = []
        for k, at in enumerate(row.tolist()):
            verdict = verdicts.get(int(keys[k]))
            listed.append({
                "i": self.bodies.name(int(pairs.i[at])), "j": self.bodies.name(int(pairs.j[at])),
                "point": place[k], "normal": normal[k],
                "verdict": None if verdict is None else verdict.value,
            })  # fmt: skip
        if not view.blind:
            for values, more in zip(listed, self._detector_answers(found, keys), strict=True):
                values |= more
        return listed

    def _find_candidates(self, frame: int) -> CandidatePairs:
        return find_candidate_pairs(self.results, frame, self.run.threshold)

    def _append(self, view: View, frame: int, key: int, verdict: Verdict, seconds: float, origin: Origin) -> None:
        """Write a verdict to the log, and the force of its pair beside it."""
        pair = self._measure(frame, key)
        number, a, b = self._names(frame, int(pair.i[0]), int(pair.j[0]))
        entry = Entry(number, view.reviewer, a, b, verdict, seconds=seconds, origin=origin, blind=view.blind)
        store_forces(self.run, [self.log.append(entry)])

    def _queue(self, view: View) -> tuple[Queue, dict[tuple[int, int], int]]:
        """The queue of a frame or of the sample, with the place of every pair in it."""
        return self._queue_of(view.order, None if view.order is Order.SAMPLE else self._frame(view.frame), view.blind)

    def _make_queue(self, order: Order, frame: int | None, blind: bool) -> tuple[Queue, dict[tuple[int, int], int]]:
        if frame is None:
            every = [self._find_candidates(k) for k in range(len(self.results.frames))]
            queue = sampled_queue(every, blind=blind)
        elif order is Order.FRAME:
            queue = frame_queue(self.candidates(frame), blind=blind)
        else:
            queue = influence_queue(self.results, self.candidates(frame), blind=blind)
        pairs = zip(queue.frame.tolist(), queue.key.tolist(), strict=True)
        return queue, {pair: place for place, pair in enumerate(pairs)}

    def _detected_by_name(self, photograph: int) -> dict[Pair, bool]:
        with self._lock:
            if photograph not in self._detected:
                found = self.candidates(photograph - self.run.first_frame)
                self._detected[photograph] = detected_by_name(self.run, photograph, found)
            return self._detected[photograph]

    def _judged(self, reviewer: str) -> dict[tuple[int, int], Entry]:
        """The reviewer's last verdict on every pair of the run, by frame of the run and key."""
        found = {}
        for (number, a, b), entry in self.log.verdicts(reviewer):
            i, j = self._rows.get(a), self._rows.get(b)
            if i is not None and j is not None and number in self.run.photographs():
                found[(number - self.run.first_frame, self.bodies.key(i, j))] = entry
        return found

    def _estimate(self, view: View, judged: dict[tuple[int, int], Entry]) -> dict[str, Any]:
        """Precision and recall of the detector on the pairs of the queue."""
        queue, places = self._queue(view)
        frame = None if view.order is Order.SAMPLE else self._frame(view.frame)
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

    def _evidence(self, frame: int, key: int, pair: Contacts) -> dict[str, Any]:
        candidates, forces = self.candidates(frame), self.results.frames[frame]
        row = np.flatnonzero(candidates.key == key)
        known = len(row) > 0
        position_sd = float(self.results.tracks.frame(frame).position_sigma[0])
        fn = match_values(np.array([key], np.int64), forces.contacts.key, forces.fn, fill=np.nan)
        return _without_nan({
            "gap_um": 1e6 * float(pair.gap[0]),
            "gap_sd_um": 1e6 * float(gap_standard_deviation(pair, position_sd)[0]),
            "threshold_um": 1e6 * candidates.threshold,
            "detected": bool(candidates.detected[row[0]]) if known else False,
            "probability": float(candidates.probability[row[0]]) if known else None,
            "fn": rounded_one(float(fn[0])),
            "priority": rounded_one(float(influence_priority(self.results, candidates)[row[0]])) if known else None,
        })  # fmt: skip

    def _detector_answers(self, found: CandidatePairs, keys: Keys) -> list[dict[str, Any]]:
        """Detection, probability, priority and f_n of pairs of a frame."""
        forces = self.results.frames[found.frame]
        detected = match_values(keys, found.key, found.detected, fill=False)
        probability, priority = (
            rounded(match_values(keys, found.key, each, fill=np.nan))
            for each in (found.probability, influence_priority(self.results, found))
        )
        fn = rounded(match_values(keys, forces.contacts.key, forces.fn, fill=np.nan))
        return [
            {"detected": bool(detected[k]), "probability": probability[k], "priority": priority[k], "fn": fn[k]}
            for k in range(len(keys))
        ]

    def _measure(self, frame: int, key: int) -> Contacts:
        i, j = split_key(key, self.bodies.count)
        if not 0 <= i < min(j, self.results.grains.count) or not self._both_present(frame, key):
            raise UnknownPair(f"there is no pair {key} in frame {frame}")
        position, walls = self.results.tracks.position[frame], self.results.walls.at_rest(frame)
        return measure_pairs(self.results.grains, position, walls, np.array([key], np.int64))

    def _both_present(self, frame: int, key: int) -> bool:
        """Both bodies have a pose in the frame."""
        n = self.results.grains.count
        present = self.results.tracks.present_in(frame)
        return all(row >= n or bool(present[row]) for row in split_key(key, self.bodies.count))

    def _row(self, name: Body) -> int | None:
        """Row of a body by a typed name; the name of a wall takes precedence over the id of a grain."""
        if name in self._rows or isinstance(name, int):
            return self._rows.get(name)
        digits = name.lstrip("-")
        return self._rows.get(int(name)) if digits.isdecimal() and len(digits) <= 18 else None

    def _names(self, frame: int, i: int, j: int) -> Pair:
        a = self.bodies.name(i)
        assert isinstance(a, int)
        return canonical((frame + self.run.first_frame, a, self.bodies.name(j)))

    def _frame(self, photograph: int) -> int:
        """The frame of the run that a photograph is."""
        if photograph not in self.run.photographs():
            raise UnknownPair(f"there is no frame {photograph}")
        return photograph - self.run.first_frame


def _without_nan(values: dict[str, Any]) -> dict[str, Any]:
    """JSON has no NaN."""
    return {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in values.items()}
