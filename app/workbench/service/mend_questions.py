"""Questions of mending: where rods are, one correlated again from a hand's pose, what has been corrected."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError
from ...experiment.tables import read_table
from ...results.hdf5.store import load_tracks
from ...run_folder import TRACKS
from ...tracks import Tracks
from ..inspecting import found as inspecting
from ..mending import corrections
from ..mending.mender import Mender
from .bench import Bench
from .project import Project
from .questions import Number, Text, Whole, question

DETECTIONS = "detections.csv"


@question
def poses(bench: Bench, at: Text, frame: Whole) -> dict[str, Any]:
    """The rods of a photograph as they were tracked, lost ones where they were seen last, and all corrections."""
    opened = bench.project(at)
    tracks, scale = _tracks(opened), opened.given_scale()
    if frame >= tracks.frame_count:
        raise InputError(opened.results, f"photograph {frame}", f"is not tracked yet: {tracks.frame_count} are")
    seen = inspecting.rods_of(tracks, frame, scale)
    lost = []
    for row in np.flatnonzero(~tracks.present[frame]):
        before = np.flatnonzero(tracks.present[: frame + 1, row])
        if len(before):
            last = inspecting.rods_of(tracks, int(before[-1]), scale)
            k = last["id"].index(int(tracks.id[row]))
            lost.append({"frame": int(before[-1]), **{key: last[key][k] for key in ("id", "x", "y", "r", "angle")}})
    return {"frame": frame, "rods": seen, "lost": lost, "corrections": told_corrections(opened)}


@question
def correlate(bench: Bench, at: Text, frame: Whole, id: Whole, x: Number, y: Number, angle: Number) -> dict[str, Any]:
    """Fit a rod from where a hand puts it; nothing is written. angle [rad]: of the picture, clockwise as seen."""
    opened = bench.project(at)
    return _correlated(opened, frame, id, (x, y, angle))


@question
def mend(bench: Bench, at: Text, frame: Whole, id: Whole, x: Number, y: Number, angle: Number) -> dict[str, Any]:
    """The same, and the pose that is found is a correction that the next run obeys."""
    opened = bench.project(at)
    if frame == 0:
        raise InputError("photograph 0", "", "is the first photograph: mend its rods in step Rods")
    mended = _correlated(opened, frame, id, (x, y, angle))
    theta = float(opened.given_scale().angle_to_world(np.array(mended["angle"])))
    pose = (mended["x"], mended["y"], theta)
    corrections.correct(opened.draft, opened.understood(), corrections.Correction(frame, id, pose))
    return {"mended": mended, "corrections": told_corrections(opened), "project": opened.describe()}


@question
def mark_lost(bench: Bench, at: Text, frame: Whole, id: Whole) -> dict[str, Any]:
    """Say that a rod is not to be seen in a photograph."""
    opened = bench.project(at)
    if frame == 0:
        raise InputError("photograph 0", "", "is the first photograph: mend its rods in step Rods")
    corrections.correct(opened.draft, opened.understood(), corrections.Correction(frame, id, None))
    return {"corrections": told_corrections(opened), "project": opened.describe()}


@question
def take_back(bench: Bench, at: Text, frame: Whole, id: Whole) -> dict[str, Any]:
    opened = bench.project(at)
    corrections.take_back(opened.draft, opened.understood(), frame, id)
    return {"corrections": told_corrections(opened), "project": opened.describe()}


def told_corrections(opened: Project) -> list[dict[str, Any]]:
    """The corrections as plain values, angles of the picture."""
    told = []
    for each in corrections.corrections_of(opened.understood()):
        x, y, theta = each.pose if each.pose is not None else (None, None, None)
        told.append({"frame": each.frame, "id": each.id, "x": x, "y": y, "angle": None if theta is None else -theta})
    return told


def _correlated(opened: Project, frame: int, name: int, pose: tuple[float, float, float]) -> dict[str, Any]:
    mender = opened.mender(lambda: _make(opened))
    try:
        found = mender.correlate(frame, name, pose)
        x, y, radius = mender.circle(name)
    except KeyError:
        raise InputError("rods", f"id = {name}", "is not the id of a rod") from None
    numbers = {
        key: inspecting.plain([getattr(found, key)])[0]
        for key in ("zncc", "residual", "zncc_before", "residual_before", "sigma")
    }
    return {"x": found.x, "y": found.y, "angle": found.angle, "found": found.found, **numbers, "first": [x, y, radius]}


def _make(opened: Project) -> Mender:
    table = read_table(opened.results / DETECTIONS, ("id", "x", "y", "radius"))
    circles = np.stack([table.numbers(name) for name in ("x", "y", "radius")], axis=1)
    return Mender(table.integers("id"), circles, opened.photograph)


def _tracks(opened: Project) -> Tracks:
    if not (opened.results / TRACKS).is_file():
        raise InputError(opened.results, "", "holds no tracks yet: run the experiment, at least to the end of tracking")
    return load_tracks(opened.results / TRACKS)[0]
