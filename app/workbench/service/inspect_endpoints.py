"""Endpoints of inspection: one pair or rod in all frames, and the forces without a contact."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from ...process.errors import InputError
from ...results.results import Results
from ...reviewing.rounding import rounded, rounded_one
from ...tracks import TrackStatus
from ..inspecting.grain_motion import grain_motion
from ..inspecting.pair_history import forces_without, pair_history
from .endpoints import BadRequest, Name, Whole, endpoint
from .project import Project


@endpoint
def pair(opened: Project, i: Name, j: Name) -> dict[str, Any]:
    """Describe one pair in every photograph up to the last one that is solved; places in pixels."""
    results, first = _results(opened)
    history = pair_history(results, i, j)
    if history is None:
        raise BadRequest(f"there is no pair {i} {j}")
    scale = opened.scene().scale
    history["point"] = [None if p is None else scale.to_pixels(p).round(2).tolist() for p in history["point"]]
    before: list[Any] = [None] * first
    return {name: before + values for name, values in history.items()}


@endpoint
def without_contact(opened: Project, frame: Whole, i: Name, j: Name) -> dict[str, Any]:
    """Compute the nearest forces of a photograph without a contact; nothing is written."""
    answer = forces_without(*_frame_of(opened, frame), i, j)
    if answer is None:
        raise InputError(f"{i} - {j}", f"photograph {frame}", "is no contact there")
    return answer


@endpoint
def motion(opened: Project, frame: Whole, since: Whole | None = None) -> dict[str, Any]:
    """Describe how the rods of a photograph have moved, and what they carry.

    since: a photograph; None: over the window of the results.
    """
    run = opened.reviewed_run()
    first, stop = run.first_frame, run.first_frame + len(run.results.frames)
    for photograph in (frame, frame if since is None else since):
        if not first <= photograph < stop:
            raise InputError(opened.results, f"photograph {photograph}", f"is not solved: {first} to {stop - 1} are")
    data = opened.run_data()
    assert data is not None
    return grain_motion(data, frame, since, opened.scene().scale, run.experiment.config.material.length)


@endpoint
def figure(opened: Project, frame: Whole) -> dict[str, Any]:
    """Draw the forces of a photograph as SVG, as `rodsight export figures` does."""
    from ...figures.figure_style import paper_style  # drawing is imported where it is used
    from ...figures.force_network import draw_forces

    results, row = _frame_of(opened, frame)
    stream = io.StringIO()
    with paper_style():
        draw_forces(results, row, "double").savefig(stream, format="svg", metadata={"Date": None})
    return {"svg": stream.getvalue()}


@endpoint
def rod(opened: Project, id: Whole) -> dict[str, Any]:
    """Describe one rod in every photograph up to the last one that is solved."""
    results, first = _results(opened)
    tracks = results.tracks
    rows = (tracks.id == id).nonzero()[0]
    if len(rows) != 1:
        raise BadRequest(f"there is no rod {id}")
    row = int(rows[0])
    before: list[Any] = [None] * first
    seen = tracks.present[:, row]
    place = opened.scene().scale.to_pixels(tracks.position[:, row]).round(2).tolist()
    moved = np.linalg.norm(tracks.position[:, row] - tracks.position[np.argmax(seen), row], axis=1)
    return {
        "place": before + [each if seen[k] else None for k, each in enumerate(place)],
        "displacement": before + rounded(np.where(seen, moved, np.nan)),
        "radius": float(tracks.radius[row]), "zncc": before + rounded(tracks.zncc[:, row]),
        "sigma": before + rounded(tracks.sigma[:, row]), "rotation": before + rounded(tracks.rotation[:, row]),
        "centre_sigma": None if tracks.centre_sigma is None else rounded_one(float(tracks.centre_sigma[row])),
        "status": before + [TrackStatus(each).name.lower() for each in tracks.status[:, row].tolist()],
        "unbalance": before + rounded([
            float("nan") if f.grain_unbalance is None else f.grain_unbalance[row] for f in results.frames
        ]),
    }  # fmt: skip


def _frame_of(opened: Project, photograph: int) -> tuple[Results, int]:
    """Finished results, and the row of a photograph in them; raises InputError where it is not there."""
    results, first = _results(opened)
    if not first <= photograph < first + len(results.frames):
        raise InputError(opened.results, f"photograph {photograph}", f"is not there: {len(results.frames)} are")
    return results, photograph - first


def _results(opened: Project) -> tuple[Results, int]:
    """Finished results, and the photograph of their frame 0."""
    run = opened.reviewed_run()
    return run.results, run.first_frame
