"""One run: an experiment, the folder its results go to, what lies in it, and what that was made from."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

from solver.sequence.frame_forces import FrameForces
from solver.statistics.frame_statistics import FrameStatistics

from . import __version__
from .atomic import PART
from .errors import InputError
from .experiment.config.experiment_file import as_toml
from .experiment.experiment import Experiment, checksums
from .lock import holding
from .progress import Progress, silent
from .results.checkpoint import Checkpoint
from .results.hdf5.store import Provenance
from .results.manifest import MANIFEST, Manifest
from .results.results import Results
from .verdicts.decisions import fingerprint
from .verdicts.log import VerdictLog

TRACKS, RESULTS, RECORDING, SUMMARY = "tracks.h5", "results.h5", "recording.rrd", "summary.json"
REPORT = "tracking_report.html"
LATER = re.compile(r"recording-part-\d+\.rrd")  # of a long recording, which opens as one by its first file
SIDE = "recording-sweeps.rrd"  # every sweep of some frames; opens as one with the recording
FAILURES = "failures.log"  # tracebacks of what failed a frame
OWN = (
    TRACKS, RESULTS, RECORDING, f"{RECORDING}.whole", SUMMARY, REPORT, SIDE, MANIFEST, "detections.csv",
    "tracked_walls.csv",
)  # fmt: skip
UNFINISHED = ".unfinished"  # folder of checkpoints
TRACKED = ".tracked"  # folder of the frames of a finished tracking, for the next one, which obeys other corrections
ERROR_BARS = {"solver": {"ensemble_size", "workers"}}  # settings that leave the forces as they are
BY_HAND = {"photographs": {"corrections"}}  # what changes some frames of the tracks alone


@dataclass(slots=True)
class Timings:
    """Seconds that each stage took; 0 where its result was already there."""

    seconds: dict[str, float] = field(default_factory=dict)

    def add(self, stage: str, since: float) -> None:
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - since


class Watch(Protocol):
    """Somebody who is told what has been solved, while it is."""

    def start(self, run: Results) -> None:
        """Bodies, motion and settings; the frames are still to come."""

    def frame(self, forces: FrameForces, statistics: FrameStatistics) -> None:
        """The next frame is there."""


@dataclass(frozen=True, slots=True)
class Run:
    """One experiment and the folder its results go to."""

    experiment: Experiment
    folder: Path
    frames: tuple[int, int | None] = (0, None)
    progress: Progress = silent
    timings: Timings = field(default_factory=Timings)
    watch: Watch | None = None  # hears every frame as it is solved
    max_size: int | None = None  # [bytes] of the recording
    full_frames: tuple[int, ...] = ()  # whose every sweep goes to a side file, the recording then being thinned
    notes: list[str] = field(default_factory=list)  # sentences for the user

    def file(self, name: str) -> Path:
        return self.folder / name

    def frame_range(self, count: int) -> tuple[int, int]:
        """First frame and end, of `count` that there are. Raises InputError."""
        start, stop = self.frames
        stop = count if stop is None else stop
        if not 0 <= start < stop <= count:
            raise InputError("--frames", f"{start}:{stop}", f"is not a range of the frames 0:{count}")
        return start, stop

    def note_failure(self, stage: str, frame: int, error: Exception) -> None:
        """Keep the traceback of what failed a frame; frame: of the experiment's while tracking, else of the run's."""
        frame += 0 if stage in ("tracking", "walls") else self.frames[0]
        self.folder.mkdir(parents=True, exist_ok=True)
        with self.file(FAILURES).open("a", encoding="utf-8") as log:
            log.write(f"{datetime.now(UTC).isoformat(timespec='seconds')} {stage}, frame {frame}\n")
            log.write("".join(traceback.format_exception(error)) + "\n")

    def origin(self, sections: tuple[str, ...], log: VerdictLog | None = None, *, corrected: bool = True) -> Provenance:
        """What a result is made from: these sections of the configuration, all input files, and people's verdicts.

        corrected=False: the same whatever poses are told by hand.
        """
        without = ERROR_BARS if corrected else ERROR_BARS | BY_HAND
        config = self.experiment.config.model_dump(mode="json", include=set(sections), exclude=without)
        sums = checksums(self.experiment, corrected=corrected)
        told = json.dumps([__version__, config, sums, self.frames], sort_keys=True)
        digest = hashlib.sha256(told.encode()).hexdigest()
        verdicts = fingerprint(log) if log is not None else ""
        if verdicts:  # without any the fingerprint stays what it was
            digest = hashlib.sha256((digest + verdicts).encode()).hexdigest()
        return Provenance(digest, self.experiment.file.name, self.frames, sums)

    @property
    def manifest(self) -> Manifest:
        """What is told of the stored pieces."""
        return Manifest(self.folder)

    def tell_manifest(self, log: VerdictLog | None = None) -> None:
        """Write what the run is made from beside its results; log: the verdicts that it obeys."""
        experiment = self.experiment
        file = Path(os.path.relpath(experiment.file.resolve(), self.folder.resolve()))
        verdicts = {}
        if log is not None:
            lines = [entry.line for entry in log.entries()]
            verdicts = {"verdicts": {"sha256": fingerprint(log), "lines": lines}}
        self.manifest.tell({
            "rodsight_version": __version__,
            "experiment": file.as_posix(),
            "inputs": {experiment.file.name: experiment.inputs.checksum(experiment.file), **checksums(experiment)},
            "settings": as_toml(experiment.config),
            "frames": list(self.frames),
            **verdicts,
        })  # fmt: skip

    def has(self, name: str, origin: Provenance) -> bool:
        """Whether a stored piece was made from this and is what it was then; a damaged one is told."""
        if not self.manifest.lists(name, origin.fingerprint):
            return False
        if self.manifest.is_whole(name):
            return True
        self.notes.append(f"{name} is damaged or was changed: it is made again.")
        return False

    def forget(self, *stages: str) -> None:
        """Remove what a process that was killed left of stages whose results are there."""
        for stage in stages:
            shutil.rmtree(self.folder / UNFINISHED / stage, ignore_errors=True)
        with suppress(OSError):  # not empty, or not there
            (self.folder / UNFINISHED).rmdir()

    def set_aside(self, stage: str) -> None:
        """Keep the frames of a stage that is finished, for it is to be done again where somebody corrects it."""
        aside, place = self.folder / TRACKED / stage, self.folder / UNFINISHED / stage
        shutil.rmtree(aside, ignore_errors=True)
        aside.parent.mkdir(exist_ok=True)
        if place.is_dir():
            place.rename(aside)
        self.forget(stage)

    def aside(self, stage: str, fingerprint: str) -> Checkpoint:
        """What is set aside of a stage that was made from this, to look at."""
        return Checkpoint(self.folder / TRACKED / stage, fingerprint, looks_on=True)

    def drop_aside(self, stage: str) -> None:
        """Remove what is set aside of a stage."""
        shutil.rmtree(self.folder / TRACKED / stage, ignore_errors=True)

    def checkpoint(self, stage: str, fingerprint: str) -> Checkpoint:
        """Finished frames of an unfinished stage that is made from this; of a stage not begun, those set aside."""
        aside, place = self.folder / TRACKED / stage, self.folder / UNFINISHED / stage
        if aside.is_dir() and not place.exists():
            place.parent.mkdir(exist_ok=True)
            aside.rename(place)
        return Checkpoint(self.folder / UNFINISHED / stage, fingerprint, self.notes)


@contextmanager
def owned(run: Run) -> Iterator[Run]:
    """The run, while no other process works in its folder; what a stopped one was writing is removed.

    Raises RunError while another process does.
    """
    with holding(run.folder, run.notes.append):
        for part in (*run.folder.glob(f"*{PART}"), *(run.folder / UNFINISHED).rglob(f"*{PART}")):
            name = part.name.removesuffix(PART)
            if part.parent != run.folder or name in OWN or LATER.fullmatch(name):
                part.unlink(missing_ok=True)
        yield run


def find_experiment(results: Path, origin: Provenance) -> Path:
    """The experiment file that results were made from: the folder's manifest tells, else the results themselves."""
    told = Manifest(results.parent).fact("experiment")
    file = results.parent / told if isinstance(told, str) else Path(origin.experiment)
    if not file.is_file():
        raise InputError(
            results, f"experiment {file}", "is not there: its folder was moved; run it again with this --out"
        )
    return file.resolve()
