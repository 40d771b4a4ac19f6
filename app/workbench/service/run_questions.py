"""Questions of the run: begun, paused, gone on with, cancelled; what it has found so far."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from ...errors import InputError
from ...experiment.scaling import make_scale
from ...experiment.units import Scale
from ...promise import describe_promise, glimpse
from ..inspecting import found as inspecting
from .bench import Bench
from .project import Project
from .questions import Text, Whole, question

Name = Annotated[int, Field(ge=-(2**53), le=2**53)] | Text


@question
def run_start(bench: Bench, at: Text, follow: bool = False) -> dict[str, Any]:
    """Begin or go on, exactly as `rodsight run` would in this folder."""
    opened = bench.project(at)
    found = opened.understood()
    if not found.ready:
        lacks = [sentence for step in found.steps.values() if step.mark == "missing" for sentence in step.says]
        raise InputError("run", "", "cannot begin: " + " ".join([*lacks, *found.others]))
    opened.job.start(*(("--follow",) if follow else ()))
    return opened.job.told()


@question
def promise(bench: Bench, at: Text) -> dict[str, Any]:
    """What the first photographs promise of the forces, as `rodsight check` says it."""
    found = bench.project(at).understood()
    if found.experiment is None or not found.ready:
        raise InputError("check", "", "has nothing to look at yet: something is still missing")
    notes: list[str] = []
    sentences, good = describe_promise(*glimpse(found.experiment, tell=notes.append))
    return {"says": [*notes, *sentences], "mark": "good" if good else "doubtful"}


@question
def run_pause(bench: Bench, at: Text) -> dict[str, Any]:
    opened = bench.project(at)
    opened.job.pause()
    return opened.job.told()


@question
def run_cancel(bench: Bench, at: Text) -> dict[str, Any]:
    """End it, and forget the frames of the unfinished stage."""
    opened = bench.project(at)
    opened.job.pause(forget=True)
    return opened.job.told()


@question
def run_told(bench: Bench, at: Text) -> dict[str, Any]:
    """How the run stands, and what is told of the frames that are solved."""
    opened = bench.project(at)
    found = opened.found()
    facts = None if found is None else inspecting.frame_facts(found)
    return {"job": opened.job.told(), "frames": facts, "files": opened.photograph_count()}


@question
def network(bench: Bench, at: Text, frame: Whole) -> dict[str, Any]:
    opened = bench.project(at)
    found = _found(opened, frame)
    return inspecting.network(found, frame, scale_of(opened))


@question
def contact(bench: Bench, at: Text, i: Name, j: Name) -> dict[str, Any]:
    """One contact over all frames."""
    opened = bench.project(at)
    found = opened.found()
    if found is None:
        raise InputError(opened.results, "", "holds no frame yet: run the experiment first")
    return inspecting.history(found, i, j)


def _found(opened: Project, frame: int) -> inspecting.Found:
    found = opened.found()
    if found is None:
        raise InputError(opened.results, "", "holds no frame yet: run the experiment first")
    if frame >= found.stop:
        raise InputError(opened.results, f"photograph {frame}", f"is not solved yet: {len(found.frames)} are")
    if frame < found.first:
        raise InputError(opened.results, f"photograph {frame}", f"is before the run's first one, {found.first}")
    return found


def scale_of(opened: Project) -> Scale:
    """What a pixel is, with what the run's calibration found of it."""
    told, found = opened.understood(), opened.found()
    results = found.results if found is not None else None
    section = told.experiment.config.photographs if told.experiment is not None else None
    if section is None or told.shape is None:
        raise InputError(opened.draft.file, "photographs", "are not there: forces cannot be drawn over them")
    return make_scale(section, told.shape[0], results.calibration if results is not None else None)
