"""Questions of mending: where rods are, one correlated again from a hand's pose, what has been corrected."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...experiment.reading.tables import read_table
from ...results.hdf5.store import load_tracks
from ...run_folder import TRACKS
from ...tracks import Tracks, TrackStatus
from ..inspecting import found as inspecting
from ..mending import corrections
from ..mending.correction_log import append_changes, read_changes
from ..mending.following import Tracked, follow_on
from ..mending.mender import Mended, Mender
from .bench import Bench
from .project import Project
from .questions import Number, Text, Whole, edit, question

DETECTIONS = "detections.csv"
WEAK = 0.75  # correlation below which a rod is shown as doubtful
DOUBTFUL = (TrackStatus.SUSPECT, TrackStatus.ROBUST)
OBEYED = 1.0  # [px] between a correction and the track that obeys it
Pose = tuple[float, float, float]


@question
def poses(bench: Bench, at: Text, frame: Whole) -> dict[str, Any]:
    """The rods of a photograph as they were tracked, lost ones where they were seen last, and all corrections."""
    opened = bench.project(at)
    tracks, scale, first = _tracks(opened), opened.given_scale(), _first(opened)
    k = frame - first
    if not 0 <= k < tracks.frame_count:
        raise InputError(opened.results, f"photograph {frame}", f"is not tracked yet: {tracks.frame_count} are")
    seen = inspecting.rods_of(tracks, k, scale)
    lost = []
    for row in np.flatnonzero(~tracks.present[k]):
        before = np.flatnonzero(tracks.present[: k + 1, row])
        if len(before):
            last = inspecting.rods_of(tracks, int(before[-1]), scale)
            n = last["id"].index(int(tracks.id[row]))
            lost.append(
                {"frame": int(before[-1]) + first, **{key: last[key][n] for key in ("id", "x", "y", "r", "angle")}}
            )
    weak = _doubtful(tracks)
    return {
        "frame": frame, "rods": seen, "lost": lost, "corrections": told_corrections(opened),
        "doubtful": tracks.id[weak[k] & tracks.present[k]].tolist(),
        "first": first, "lost_count": [0] * first + (~tracks.present).sum(axis=1).tolist(),
        "doubtful_count": [0] * first + weak.sum(axis=1).tolist(),
    }  # fmt: skip


@question
def make_ready(bench: Bench, at: Text, frame: Whole) -> dict[str, Any]:
    """Prepare a photograph for rods to be correlated in it, so that the first one is answered at once."""
    opened = bench.project(at)
    _exists(opened, frame)
    _mender(opened).prepare(frame - _first(opened))
    return {"ready": frame}


@question
def correlate(bench: Bench, at: Text, frame: Whole, id: Whole, x: Number, y: Number, angle: Number) -> dict[str, Any]:
    """Fit a rod from where a hand puts it; nothing is written. angle [rad]: of the picture, clockwise as seen.

    With pictures, of side `side` and one byte a pixel: the rod on the first photograph; where the hand put it, and what
    that differs by; where it was found, likewise.
    """
    opened = bench.project(at)
    _exists(opened, frame)
    found = _correlated(opened, id, frame, (x, y, angle))
    mender = _mender(opened)
    pictures = mender.pictures(frame - _first(opened), id, [(x, y, angle), (found.x, found.y, found.angle)])
    return _told(found) | {
        "first": mender.circle(id), "side": len(pictures[0]), "pictures": [_as_text(each) for each in pictures],
    }  # fmt: skip


@edit
def mend(
    bench: Bench, at: Text, frame: Whole, id: Whole, x: Number, y: Number, angle: Number, following: bool = False
) -> dict[str, Any]:
    """The same, and the pose that is found is a correction that the next run obeys.

    following: so are those in the photographs after it, until the rod's track holds by itself.
    """
    opened = bench.project(at)
    _exists(opened, frame)
    _not_first(opened, frame)
    found = _correlated(opened, id, frame, (x, y, angle))
    poses, ended = {frame: found}, ""
    if following:
        first = _first(opened)
        by_hand = {each.frame - first for each in corrections.corrections_of(opened.understood()) if each.id == id}
        followed = follow_on(_mender(opened), _tracked(opened), id, (frame - first, found), by_hand.__contains__, first)
        poses |= {k + first: each for k, each in followed.poses.items()}
        ended = followed.ended
    told = [corrections.Correction(k, id, _as_written(opened, each)) for k, each in poses.items()]
    with logged(opened, "followed" if len(told) > 1 else "mended"):
        corrections.correct(opened.draft, opened.understood(), told)
    return _settled(opened) | {"mended": _told(found), "count": len(told), "ended": ended}


@edit
def mark_lost(bench: Bench, at: Text, frame: Whole, id: Whole) -> dict[str, Any]:
    """Say that a rod is not to be seen in a photograph."""
    opened = bench.project(at)
    _exists(opened, frame)
    _not_first(opened, frame)
    with logged(opened, "hidden"):
        corrections.correct(opened.draft, opened.understood(), [corrections.Correction(frame, id, None)])
    return _settled(opened)


@edit
def take_back(bench: Bench, at: Text, frame: Whole, id: Whole) -> dict[str, Any]:
    opened = bench.project(at)
    with logged(opened, "taken back"):
        corrections.take_back(opened.draft, opened.understood(), frame, id)
    return _settled(opened)


@question
def corrections_log(bench: Bench, at: Text) -> dict[str, Any]:
    """What was changed in the table of corrections, the latest first."""
    opened = bench.project(at)
    return {"changes": read_changes(opened.folder)}


@edit
def undo(bench: Bench, at: Text) -> dict[str, Any]:
    """Take the last change of the experiment back, whatever it was."""
    opened = bench.project(at)
    with logged(opened, "undone"):
        if opened.draft.undo() is None:
            raise InputError("undo", "", "nothing is left to be undone")
    return opened.describe()


@edit
def redo(bench: Bench, at: Text) -> dict[str, Any]:
    """Do again what was undone last."""
    opened = bench.project(at)
    with logged(opened, "done again"):
        if opened.draft.redo() is None:
            raise InputError("redo", "", "nothing was undone")
    return opened.describe()


@contextmanager
def logged(opened: Project, how: str) -> Iterator[None]:
    """Write down what happens to the table of corrections meanwhile."""
    before = _readable(opened)
    yield
    append_changes(opened.folder, corrections.differences(before, _readable(opened)), how)


def _readable(opened: Project) -> list[corrections.Correction]:
    """The corrections; none where the table cannot be read, which is complained of elsewhere."""
    try:
        return corrections.corrections_of(opened.understood())
    except InputError:
        return []


def told_corrections(opened: Project) -> list[dict[str, Any]]:
    """The corrections as plain values, angles of the picture; obeyed: the last run did what they say."""
    told: list[dict[str, Any]] = []
    tracked, first = _tracked(opened) if (opened.results / TRACKS).is_file() else None, _first(opened)
    for each in corrections.corrections_of(opened.understood()):
        x, y, theta = each.pose if each.pose is not None else (None, None, None)
        told.append({
            "frame": each.frame, "id": each.id, "x": x, "y": y, "angle": None if theta is None else -theta,
            "obeyed": _obeyed(tracked, each, each.frame - first),
        })  # fmt: skip
    return told


def _obeyed(tracked: Tracked | None, told: corrections.Correction, k: int) -> bool:
    """Whether frame k of the run does what a correction says."""
    rows = np.flatnonzero(tracked.id == told.id) if tracked is not None else ()
    if tracked is None or len(rows) != 1 or not 0 <= k < len(tracked.pose):
        return False
    x, y = tracked.pose[k, rows[0], :2]
    return bool(np.isnan(x)) if told.pose is None else bool(np.hypot(x - told.pose[0], y - told.pose[1]) < OBEYED)


def _settled(opened: Project) -> dict[str, Any]:
    return {"corrections": told_corrections(opened), "project": opened.describe()}


def _exists(opened: Project, frame: int) -> None:
    count = opened.photograph_count()
    if not _first(opened) <= frame < count:
        raise InputError(opened.draft.file, f"photograph {frame}", f"is not there: {count} are")


def _not_first(opened: Project, frame: int) -> None:
    if frame == _first(opened):
        raise InputError(f"photograph {frame}", "", "is the first photograph: mend its rods in step Rods")


def _correlated(opened: Project, name: int, frame: int, pose: Pose) -> Mended:
    try:
        return _mender(opened).correlate(frame - _first(opened), name, pose)
    except KeyError:
        raise InputError("rods", f"id = {name}", "is not the id of a rod") from None


def _told(found: Mended) -> dict[str, Any]:
    keys = ("zncc", "residual", "zncc_before", "residual_before", "sigma")
    numbers = {key: inspecting.plain([getattr(found, key)])[0] for key in keys}
    return {"x": found.x, "y": found.y, "angle": found.angle, "found": found.found, **numbers}


def _as_written(opened: Project, found: Mended) -> Pose:
    return found.x, found.y, float(opened.given_scale().angle_to_world(np.array(found.angle)))


def _as_text(picture: NDArray[np.uint8]) -> str:
    return base64.b64encode(picture.tobytes()).decode("ascii")


def _doubtful(tracks: Tracks) -> NDArray[np.bool_]:
    """Which poses (f, n) a person should look at."""
    return np.isin(tracks.status, DOUBTFUL) | (tracks.zncc < WEAK)


def _tracked(opened: Project) -> Tracked:
    tracks, scale = _tracks(opened), opened.given_scale()
    return Tracked(tracks.id, np.dstack([scale.to_pixels(tracks.position), -tracks.rotation]))


def _mender(opened: Project) -> Mender:
    return opened.mender(lambda: _make(opened))


def _make(opened: Project) -> Mender:
    table = read_table(opened.results / DETECTIONS, ("id", "x", "y", "radius"))
    circles = np.stack([table.numbers(name) for name in ("x", "y", "radius")], axis=1)
    first = _first(opened)
    return Mender(table.integers("id"), circles, lambda frame: opened.photograph(first + frame))


def _tracks(opened: Project) -> Tracks:
    if not (opened.results / TRACKS).is_file():
        raise InputError(opened.results, "", "holds no tracks yet: run the experiment, at least to the end of tracking")
    file = opened.results / TRACKS
    return _read(file, file.stat().st_mtime_ns)


@lru_cache(maxsize=4)
def _read(file: Path, _changed: int) -> Tracks:
    """Tracks, read once as long as their file stays the same."""
    return load_tracks(file)[0]


def _first(opened: Project) -> int:
    """The photograph of the tracks' frame 0."""
    return inspecting.first_photograph(opened.results / TRACKS)
