"""Endpoints of the run: start, pause, resume, cancel; its state and the frames that are solved."""

from __future__ import annotations

from typing import Any

from ...drawing.force_range import THICKEST, THINNEST
from ...drawing.ramps import FORCE_RAMP
from ...experiment.plausibility import check_packing
from ...prediction import predict_accuracy, track_first_photographs
from ...process.errors import InputError
from ...recording.look.colours import DIFFERENCE_RAMP, GAP_RAMP, OPEN, PROBABILITY_RAMP, UNCERTAINTY_RAMP, WEAK
from ...run_folder import refuse_foreign_folder
from ..inspecting.run_data import RunData, contact_history, frame_network, frame_summaries
from .endpoints import Name, Whole, endpoint
from .project import Project
from .workbench import Workbench


@endpoint
def run_start(opened: Project, follow: bool = False) -> dict[str, Any]:
    """Start or resume the run, exactly as `rodsight run` does in this folder."""
    validation = opened.validation()
    if not validation.ready:
        missing = [text for step in validation.steps.values() if step.mark == "missing" for text in step.messages]
        raise InputError("run", "", "cannot begin: " + " ".join([*missing, *validation.other_messages]))
    assert validation.experiment is not None
    refuse_foreign_folder(opened.run_folder, validation.experiment)
    opened.job.start(*(("--follow",) if follow else ()))
    return opened.job.as_values()


@endpoint
def prediction(opened: Project) -> dict[str, Any]:
    """Predict the accuracy of the forces from the first photographs, as `rodsight check` does."""
    validation = opened.validation()
    if validation.experiment is None or not validation.ready:
        raise InputError("check", "", "needs a complete set-up: something is still missing")
    notes: list[str] = []
    tracks, walls = track_first_photographs(validation.experiment, notify=notes.append)
    if walls is not None:
        notes += check_packing(validation.experiment, tracks, walls)
    found = predict_accuracy(validation.experiment.config, tracks, walls)
    verdict, *details = found.describe()
    return {"messages": [verdict, *notes, *details], "mark": "good" if found.good else "doubtful"}


@endpoint
def run_pause(opened: Project) -> dict[str, Any]:
    opened.job.pause()
    return opened.job.as_values()


@endpoint
def run_cancel(opened: Project) -> dict[str, Any]:
    """End the run, and remove the frames of its unfinished stage."""
    opened.job.pause(discard=True)
    return opened.job.as_values()


@endpoint
def run_state(opened: Project) -> dict[str, Any]:
    """Describe the run, and the frames that are solved."""
    data = opened.run_data()
    frames = None if data is None else frame_summaries(data)
    return {"job": opened.job.as_values(), "frames": frames, "files": opened.photograph_count()}


@endpoint
def force_look(workbench: Workbench) -> dict[str, Any]:
    """Return colours and widths of forces, as the recording draws them."""
    ramps = {
        "force": FORCE_RAMP, "uncertainty": UNCERTAINTY_RAMP, "probability": PROBABILITY_RAMP, "gap": GAP_RAMP,
        "difference": DIFFERENCE_RAMP,
    }  # fmt: skip
    single = {"weak": WEAK, "open": OPEN}
    return {
        "ramps": {name: ["#" + bytes(each[:3]).hex() for each in ramp.tolist()] for name, ramp in ramps.items()},
        **{name: f"rgba({red},{green},{blue},{alpha / 255:.2f})" for name, (red, green, blue, alpha) in single.items()},
        "thinnest": 2.0 * THINNEST, "thickest": 2.0 * THICKEST,
    }  # fmt: skip


@endpoint
def network(opened: Project, frame: Whole) -> dict[str, Any]:
    """Describe contacts, forces and rods of a photograph."""
    return frame_network(_data_with(opened, frame), frame, opened.scene().scale)


@endpoint
def contact(opened: Project, i: Name, j: Name) -> dict[str, Any]:
    """Describe one contact in all frames."""
    return contact_history(_data(opened), i, j)


def _data(opened: Project) -> RunData:
    data = opened.run_data()
    if data is None:
        raise InputError(opened.results, "", "holds no frame yet: run the experiment first")
    return data


def _data_with(opened: Project, frame: int) -> RunData:
    """The run, where it has a photograph."""
    data = _data(opened)
    if frame >= data.stop:
        raise InputError(opened.results, f"photograph {frame}", f"is not solved yet: {len(data.frames)} are")
    if frame < data.first:
        raise InputError(opened.results, f"photograph {frame}", f"is before the run's first one, {data.first}")
    return data
