"""Endpoints of corrections: poses of the rods, correlation from a pose given by hand, the table of corrections."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...experiment.pictures.image import Image
from ...experiment.reading.tables import read_table
from ...experiment.units import Scale
from ...process.errors import InputError
from ...results.hdf5.store import load_tracks
from ...reviewing.rounding import rounded, rounded_one
from ...run_folder import TRACKS
from ...tracking.registration.manual_poses import ManualPoses
from ...tracks import Tracks
from ..correcting import corrections
from ..correcting.correction_log import append_changes, read_changes
from ..correcting.pose_editor import PoseEditor, PoseFit
from ..correcting.proposals import (
    OVERLAP,
    TrackedPoses,
    overlap,
    predict_pose,
    uncertain_poses,
    warnings_of,
    with_corrections,
)
from ..correcting.retracking import changes, track_again, with_frame
from ..correcting.rod_following import follow_rod
from ..inspecting.run_data import first_photograph, list_rods
from .endpoints import Number, Whole, editing_endpoint, endpoint
from .project import Project

DETECTIONS = "detections.csv"
APPLIED = 1.0  # [px] largest distance of a track from a correction that it follows
Pose = tuple[float, float, float]


@endpoint
def poses(opened: Project, frame: Whole) -> dict[str, Any]:
    """List the rods of a photograph as they were tracked, lost ones where they were seen last, and all corrections."""
    tracks, scale, first = _tracks(opened), opened.tracks_scale(), _first(opened)
    k = frame - first
    if not 0 <= k < tracks.frame_count:
        raise InputError(opened.results, f"photograph {frame}", f"is not tracked yet: {tracks.frame_count} are")
    weak = uncertain_poses(tracks)
    return _rods_of(tracks, k, scale, first) | {
        "frame": frame, "corrections": list_corrections(opened), "first": first,
        "lost_count": [0] * first + (~tracks.present).sum(axis=1).tolist(),
        "uncertain_count": [0] * first + weak.sum(axis=1).tolist(),
    }  # fmt: skip


def _rods_of(tracks: Tracks, k: int, scale: Scale, first: int) -> dict[str, Any]:
    """The rods of a frame, lost ones where they were seen last, and the uncertain ones."""
    lost = []
    for row in np.flatnonzero(~tracks.present[k]):
        before = np.flatnonzero(tracks.present[: k + 1, row])
        if len(before):
            last = list_rods(tracks, int(before[-1]), scale)
            n = last["id"].index(int(tracks.id[row]))
            lost.append(
                {"frame": int(before[-1]) + first, **{key: last[key][n] for key in ("id", "x", "y", "r", "angle")}}
            )
    uncertain = tracks.id[uncertain_poses(tracks)[k] & tracks.present[k]].tolist()
    return {"rods": list_rods(tracks, k, scale), "lost": lost, "uncertain": uncertain}


@endpoint
def propose_pose(opened: Project, frame: Whole, id: Whole) -> dict[str, Any]:
    """Propose a pose of a rod: from its last good photograph, by the motion of its neighbours, at all angles.

    A pose on another rod is not proposed: pose None.
    """
    _exists(opened, frame)
    first, tracked = _first(opened), _tracked(opened)
    row, k = _row(tracked, id), frame - first
    predicted = predict_pose(tracked, row, k)
    if predicted is None:
        return {"pose": None, "since": None}
    found = _correlated(opened, tracked, id, k, predicted.pose)
    circle = found.x, found.y, float(tracked.radius[row])
    free = found.found or overlap(circle, tracked.others(k, row))[1] <= OVERLAP
    return {"pose": [found.x, found.y, found.angle] if free else None, "since": first + predicted.since}


@endpoint
def tracked_again(opened: Project, frame: Whole, id: Whole) -> dict[str, Any]:
    """Track a photograph again with its corrections, as the next run will; nothing is written.

    `changes`: the rod and its neighbours before and after, and all whose status has changed.
    """
    _exists(opened, frame)
    _not_first(opened, frame)
    tracks, scale, first = _tracks(opened), opened.tracks_scale(), _first(opened)
    k, editor = frame - first, _editor(opened)
    row_of = {int(name): row for row, name in enumerate(tracks.id)}
    _row(_tracked(opened), id)
    here = (each for each in corrections.corrections_of(opened.validation()) if each.frame == frame)
    given = [each for each in here if each.id in row_of]
    circles = np.array([editor.circle(int(name)) for name in tracks.id])
    places = np.dstack([scale.to_pixels(tracks.position), scale.angle_to_world(tracks.rotation)])
    photograph = _photographs_of(opened, first)
    again = track_again(circles, tracks, places, k, _manual(given, row_of), photograph)
    listed = changes(tracks, places, k, again, circles, row_of[id])
    after = with_frame(tracks, k, again, scale)
    lost = [int((~each.present[k]).sum()) for each in (tracks, after)]
    return _rods_of(after, k, scale, first) | {
        "frame": frame, "id": id, "lost_before": lost[0], "lost_after": lost[1],
        "changes": [
            {"id": each.id, "status": [status.name.lower() for status in each.status], "zncc": rounded(each.zncc),
             "moved": rounded_one(each.moved)}
            for each in listed
        ],
    }  # fmt: skip


def _manual(given: list[corrections.Correction], row_of: dict[int, int]) -> ManualPoses:
    """Corrections of one photograph in the tracker's units."""
    poses = [(np.nan, np.nan, np.nan) if each.pose is None else _in_picture(each.pose) for each in given]
    rows = np.array([row_of[each.id] for each in given], dtype=np.intp)
    return ManualPoses(rows, np.array(poses, dtype=np.float64).reshape(-1, 3))


def _in_picture(pose: tuple[float, float, float | None]) -> Pose:
    """A stored pose with its angle in the picture; NaN: it is to be found."""
    return pose[0], pose[1], float("nan") if pose[2] is None else -pose[2]


@endpoint
def prepare_photograph(opened: Project, frame: Whole) -> dict[str, Any]:
    """Prepare a photograph for correlation, so that the first rod is correlated without delay."""
    _exists(opened, frame)
    _editor(opened).prepare(frame - _first(opened))
    return {"ready": frame}


@endpoint
def correlate(opened: Project, frame: Whole, id: Whole, x: Number, y: Number, angle: Number) -> dict[str, Any]:
    """Fit a rod from a pose given by hand; nothing is written. angle [rad]: in the picture, clockwise as seen.

    `pictures` have `side` × `side` bytes: the rod on the first photograph; at the given pose, and the difference; at
    the fitted pose, and the difference.
    """
    _exists(opened, frame)
    tracked, k = _tracked(opened), frame - _first(opened)
    found = _correlated(opened, tracked, id, k, (x, y, angle))
    pose_editor = _editor(opened)
    pictures = pose_editor.pictures(frame - _first(opened), id, [(x, y, angle), (found.x, found.y, found.angle)])
    return _as_values(found) | {
        "warnings": warnings_of(tracked, _row(tracked, id), k, found, _first(opened)),
        "first": pose_editor.circle(id), "side": len(pictures[0]), "pictures": [_as_text(each) for each in pictures],
    }  # fmt: skip


@editing_endpoint
def correct_pose(
    opened: Project,
    frame: Whole,
    id: Whole,
    x: Number,
    y: Number,
    angle: Number,
    following: bool = False,
) -> dict[str, Any]:
    """Fit a rod from a pose given by hand, and store the result as a correction, which the next run applies.

    following: correct the photographs after it as well, until the track of the rod agrees.
    """
    _exists(opened, frame)
    _not_first(opened, frame)
    tracked = _tracked(opened)
    found = _correlated(opened, tracked, id, frame - _first(opened), (x, y, angle))
    poses, ended = {frame: found}, ""
    if following:
        first = _first(opened)
        by_hand = {each.frame - first for each in corrections.corrections_of(opened.validation()) if each.id == id}
        followed = follow_rod(_editor(opened), tracked, id, (frame - first, found), by_hand.__contains__, first)
        poses |= {k + first: each for k, each in followed.poses.items()}
        ended = followed.ended
    added = [corrections.Correction(k, id, _as_written(opened, each)) for k, each in poses.items()]
    with logged(opened, "followed" if len(added) > 1 else "corrected"):
        corrections.add_corrections(opened.draft, opened.validation(), added)
    return _corrected(opened) | {"fit": _as_values(found), "count": len(added), "ended": ended}


@editing_endpoint
def mark_lost(opened: Project, frame: Whole, id: Whole) -> dict[str, Any]:
    """Mark a rod as not visible in a photograph."""
    _exists(opened, frame)
    _not_first(opened, frame)
    with logged(opened, "hidden"):
        corrections.add_corrections(opened.draft, opened.validation(), [corrections.Correction(frame, id, None)])
    return _corrected(opened)


@editing_endpoint
def undo_correction(opened: Project, frame: Whole, id: Whole) -> dict[str, Any]:
    with logged(opened, "removed"):
        corrections.remove_correction(opened.draft, opened.validation(), frame, id)
    return _corrected(opened)


@endpoint
def corrections_log(opened: Project) -> dict[str, Any]:
    """List the changes of the table of corrections, the latest first."""
    return {"changes": read_changes(opened.folder)}


@editing_endpoint
def undo(opened: Project) -> dict[str, Any]:
    """Undo the last action, whatever it was: a change of any step, or a verdict.

    `undone`: its name; `verdict`: photograph and pair, where it was one.
    """
    with logged(opened, "undone"):
        action = opened.revert(back=True)
    if action is None:
        raise InputError("undo", "", "has no action left to undo")
    return opened.describe() | {"undone": action.name, "verdict": action.verdict}


@editing_endpoint
def redo(opened: Project) -> dict[str, Any]:
    """Repeat the action that was undone last."""
    with logged(opened, "redone"):
        action = opened.revert(back=False)
    if action is None:
        raise InputError("redo", "", "has no undone action to repeat")
    return opened.describe() | {"redone": action.name, "verdict": action.verdict}


@contextmanager
def logged(opened: Project, how: str) -> Iterator[None]:
    """Log the changes of the table of corrections inside the block."""
    before = _readable(opened)
    yield
    append_changes(opened.folder, corrections.differences(before, _readable(opened)), how)


def _readable(opened: Project) -> list[corrections.Correction]:
    """The corrections; none where the table cannot be read: the validation reports that."""
    try:
        return corrections.corrections_of(opened.validation())
    except InputError:
        return []


def list_corrections(opened: Project) -> list[dict[str, Any]]:
    """List the corrections, angles in the picture; applied: the last run used them."""
    listed: list[dict[str, Any]] = []
    tracked, first = _as_tracked(opened) if (opened.results / TRACKS).is_file() else None, _first(opened)
    for each in corrections.corrections_of(opened.validation()):
        x, y, theta = each.pose if each.pose is not None else (None, None, None)
        listed.append({
            "frame": each.frame, "id": each.id, "x": x, "y": y, "angle": None if theta is None else -theta,
            "applied": _applied(tracked, each, each.frame - first),
        })  # fmt: skip
    return listed


def _applied(tracked: TrackedPoses | None, correction: corrections.Correction, k: int) -> bool:
    """Frame k of the run has the pose of a correction."""
    rows = np.flatnonzero(tracked.id == correction.id) if tracked is not None else ()
    if tracked is None or len(rows) != 1 or not 0 <= k < len(tracked.pose):
        return False
    x, y = tracked.pose[k, rows[0], :2]
    if correction.pose is None:
        return bool(np.isnan(x))
    return bool(np.hypot(x - correction.pose[0], y - correction.pose[1]) < APPLIED)


def _corrected(opened: Project) -> dict[str, Any]:
    return {"corrections": list_corrections(opened), "project": opened.describe()}


def _exists(opened: Project, frame: int) -> None:
    count = opened.photograph_count()
    if not _first(opened) <= frame < count:
        raise InputError(opened.draft.file, f"photograph {frame}", f"is not there: {count} are")


def _not_first(opened: Project, frame: int) -> None:
    if frame == _first(opened):
        raise InputError(f"photograph {frame}", "", "is the first photograph: correct its rods in step Rods")


def _correlated(opened: Project, tracked: TrackedPoses, name: int, k: int, pose: Pose) -> PoseFit:
    """Fit a rod in frame k, not on another rod."""
    others = tracked.others(k, _row(tracked, name))
    return _editor(opened).correlate(k, name, pose, lambda x, y, radius: overlap((x, y, radius), others)[1] > OVERLAP)


def _row(tracked: TrackedPoses, name: int) -> int:
    try:
        return tracked.row(name)
    except KeyError:
        raise InputError("rods", f"id = {name}", "is not the id of a rod") from None


def _as_values(found: PoseFit) -> dict[str, Any]:
    keys = ("zncc", "residual", "zncc_before", "residual_before", "sigma")
    numbers = {key: rounded_one(getattr(found, key)) for key in keys}
    return {"x": found.x, "y": found.y, "angle": found.angle, "found": found.found, **numbers}


def _as_written(opened: Project, found: PoseFit) -> Pose:
    return found.x, found.y, float(opened.tracks_scale().angle_to_world(np.array(found.angle)))


def _as_text(picture: NDArray[np.uint8]) -> str:
    return base64.b64encode(picture.tobytes()).decode("ascii")


def _tracked(opened: Project) -> TrackedPoses:
    """The poses as they were tracked, with all corrections."""
    first = _first(opened)
    given = [
        (each.frame - first, each.id, None if each.pose is None else (*each.pose[:2], _angle(each.pose[2])))
        for each in corrections.corrections_of(opened.validation())
    ]
    return with_corrections(_as_tracked(opened), given)


def _angle(theta: float | None) -> float | None:
    return None if theta is None else -theta


def _as_tracked(opened: Project) -> TrackedPoses:
    return TrackedPoses.of(_tracks(opened), opened.tracks_scale())


def _editor(opened: Project) -> PoseEditor:
    return opened.pose_editor(lambda: _make(opened))


def _make(opened: Project) -> PoseEditor:
    table = read_table(opened.results / DETECTIONS, ("id", "x", "y", "radius"))
    circles = np.stack([table.numbers(name) for name in ("x", "y", "radius")], axis=1)
    return PoseEditor(table.integers("id"), circles, _photographs_of(opened, _first(opened)))


def _photographs_of(opened: Project, first: int) -> Callable[[int], Image]:
    """Photographs by the frame of the tracks; 0 is photograph 0, with which every other one is compared."""
    return lambda frame: opened.photograph(first + frame if frame else 0)


def _tracks(opened: Project) -> Tracks:
    if not (opened.results / TRACKS).is_file():
        raise InputError(opened.results, "", "holds no tracks yet: run the experiment, at least to the end of tracking")
    file = opened.results / TRACKS
    return _read(file, file.stat().st_mtime_ns)


@lru_cache(maxsize=4)
def _read(file: Path, _changed: int) -> Tracks:
    """Tracks, read once as long as their file is the same."""
    return load_tracks(file)[0]


def _first(opened: Project) -> int:
    """The photograph of the tracks' frame 0."""
    return first_photograph(opened.results / TRACKS)
