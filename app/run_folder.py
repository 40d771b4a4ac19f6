"""One run: an experiment, the folder its results go to, what lies in it, and what that was made from."""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from solver.sequence.frame_forces import FrameForces
from solver.statistics.frame_statistics import FrameStatistics

from . import __version__
from .errors import InputError
from .experiment.experiment import Experiment, checksums
from .progress import Progress, silent
from .results.results import Results
from .results.store import Provenance
from .verdicts.decisions import fingerprint
from .verdicts.log import VerdictLog

TRACKS, RESULTS, RECORDING, SUMMARY = "tracks.h5", "results.h5", "recording.rrd", "summary.json"
REPORT = "tracking_report.html"
SIDE = "recording-sweeps.rrd"  # every sweep of some frames; opens as one with the recording
UNFINISHED = ".unfinished"  # folder of checkpoints
ERROR_BARS = {"solver": {"ensemble_size"}}  # settings that leave the forces as they are


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

    def origin(self, sections: tuple[str, ...], log: VerdictLog | None = None) -> Provenance:
        """What a result is made from: these sections of the configuration, all input files, and people's verdicts."""
        config = self.experiment.config.model_dump(mode="json", include=set(sections), exclude=ERROR_BARS)
        sums = checksums(self.experiment)
        told = json.dumps([__version__, config, sums, self.frames], sort_keys=True)
        digest = hashlib.sha256(told.encode()).hexdigest()
        verdicts = fingerprint(log) if log is not None else ""
        if verdicts:  # without any the fingerprint stays what it was
            digest = hashlib.sha256((digest + verdicts).encode()).hexdigest()
        return Provenance(digest, str(self.experiment.file.resolve()), self.frames, sums)
