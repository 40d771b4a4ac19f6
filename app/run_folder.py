"""One run: an experiment, the folder of its results, the files in it and their provenance."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import time
import traceback
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from . import __version__
from .compilation.ahead import SOLVER_KERNELS, TRACKING_KERNELS, KernelsAhead
from .experiment.config.experiment_file import as_toml
from .experiment.experiment import CONFIG_NAME, Experiment, Stamp, checksums, stamp_of_input
from .experiment.reading.input_files import regular
from .process.atomic import PART
from .process.errors import InputError
from .process.frame_range import ALL_FRAMES, FrameRange
from .process.links import refuse_file, refuse_link
from .process.lock import hold_folder
from .process.progress import Progress, no_progress
from .process.sources import hash_of_code
from .process.stages import Stage
from .process.version import library_versions
from .results.checkpoint import Checkpoint
from .results.hdf5.provenance import Provenance
from .results.manifest import MANIFEST, NAMES, Manifest
from .verdicts.log import VerdictLog, fingerprint

if TYPE_CHECKING:  # the first photograph is read before they are imported
    from .results.results import Results
    from .solver.frame_forces import FrameForces
    from .solver.statistics.frame_statistics import FrameStatistics

TRACKS, RESULTS, RECORDING, SUMMARY = "tracks.h5", "results.h5", "recording.rrd", "summary.json"
REPORT = "tracking_report.html"
LATER = re.compile(r"recording-part-\d+\.rrd")  # later parts of a long recording, which opens as one by its first file
SIDE = "recording-sweeps.rrd"  # every sweep of some frames; opens together with the recording
FAILURES = "failures.log"  # tracebacks of failed frames
OWN = (
    TRACKS, RESULTS, RECORDING, f"{RECORDING}.whole", SUMMARY, REPORT, SIDE, MANIFEST, "detections.csv",
    "tracked_walls.csv",
)  # fmt: skip
SAMPLED = 8  # input files, about, that are compared to recognise an experiment in another place
UNFINISHED = ".unfinished"  # folder of checkpoints
TRACKED = ".tracked"  # folder of the frames of a finished tracking, for the next one with other corrections
# Settings that leave tracks and forces as they are.
ERROR_BARS = {"solver": {"ensemble_size", "workers"}, "tracking": {"workers"}}
BY_HAND = {"photographs": {"corrections"}}  # settings that change only some frames of the tracks


@dataclass(slots=True)
class Timings:
    """Duration of each stage [s]; 0 where its result existed already."""

    seconds: dict[str, float] = field(default_factory=dict)

    def add(self, stage: str, since: float) -> None:
        """Add the time since `since`, a value of time.perf_counter, to a stage."""
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - since


class RunObserver(Protocol):
    """Receiver of the frames of a run while it is solved."""

    def start(self, run: Results) -> None:
        """Receive bodies, motion and settings before the first frame."""

    def frame(self, forces: FrameForces, statistics: FrameStatistics) -> None:
        """Receive the next solved frame."""


@dataclass(frozen=True, slots=True)
class Run:
    """One experiment and the folder its results go to."""

    experiment: Experiment
    folder: Path
    frames: FrameRange = ALL_FRAMES
    progress: Progress = no_progress
    timings: Timings = field(default_factory=Timings)
    watch: RunObserver | None = None  # receives every solved frame
    max_size: int | None = None  # [bytes] of the recording
    full_frames: tuple[int, ...] = ()  # frames whose every sweep is written to a side file; the recording is thinned
    notes: list[str] = field(default_factory=list)  # sentences for the user
    keep_old: bool = False  # results of other code are used as they are
    stamps: dict[str, Stamp] = field(default_factory=dict)  # of input files by name, before they were read
    kernels: KernelsAhead = field(default_factory=KernelsAhead)

    def compiling(self) -> AbstractContextManager[None]:
        """Compile kernels inside the block, where they are missing, for stages that wait for them."""
        photographs = self.experiment.config.photographs is not None
        stages = (TRACKING_KERNELS, SOLVER_KERNELS) if photographs else (SOLVER_KERNELS,)
        return self.kernels.compiling(stages, self.progress)

    def check_photographs(self) -> None:
        """Read every photograph once, unless tracks are stored, before the libraries of the stages are loaded."""
        if self.experiment.config.photographs is not None and not self.file(TRACKS).exists():
            self.experiment.photographs().check()

    def file(self, name: str) -> Path:
        """Return the path of a file in the run's folder."""
        return self.folder / name

    def frame_range(self, count: int) -> tuple[int, int, int]:
        """Return the first frame, the end and the step, of `count` existing frames. Raises InputError."""
        start, stop, step = self.frames
        stop = count if stop is None else stop
        if not 0 <= start < stop <= count:
            raise InputError("--frames", f"{start}:{stop}", f"is not a range of the frames 0:{count}")
        return start, stop, step

    def note_failure(self, stage: str, frame: int, error: Exception) -> None:
        """Log the traceback of a failed frame; frame: of the experiment while tracking, else of the run."""
        frame = frame if stage in ("tracking", "walls") else self.frames.number(frame)
        self.folder.mkdir(parents=True, exist_ok=True)
        with self.file(FAILURES).open("a", encoding="utf-8") as log:
            log.write(f"{datetime.now(UTC).isoformat(timespec='seconds')} {stage}, frame {frame}\n")
            log.write("".join(traceback.format_exception(error)) + "\n")

    def origin(self, stage: Stage, log: VerdictLog | None = None, *, corrected: bool = True) -> Provenance:
        """Return the provenance of a result: code, configuration, all input files, and reviewers' verdicts.

        corrected=False leaves out poses entered by hand.
        """
        without = ERROR_BARS if corrected else ERROR_BARS | BY_HAND
        config = self.experiment.config.model_dump(mode="json", include=set(stage.sections), exclude=without)
        for file, name in self.experiment.named_inputs().items():
            if name not in self.stamps:
                with suppress(OSError):  # it is missing, which the next line reports
                    self.stamps[name] = stamp_of_input(file)
        sums = checksums(self.experiment, corrected=corrected)
        verdicts = fingerprint(log) if log is not None else ""
        inputs = _hash_of([config, sums, self.frames.stored, verdicts])
        code, libraries = hash_of_code(stage.code, stage.alone), library_versions()
        whole = _hash_of([inputs, code, libraries])
        return Provenance(whole, self.experiment.file.name, self.frames, sums, inputs, code, libraries)

    def claim(self) -> None:
        """State in the folder which experiment it belongs to, before anything is written to it."""
        if not isinstance(self.manifest.fact("experiment"), str):
            self.manifest.store(self._ownership())

    def _ownership(self) -> dict[str, str]:
        file = self.experiment.file.resolve()
        relative = Path(os.path.relpath(file, self.folder.resolve())).as_posix()
        return {"name": self.experiment.name, "experiment": relative, "place": os.fspath(file)}

    def state_of_input(self, log: VerdictLog) -> dict[str, Any]:
        """Return what results were made from, as the manifest stores it beside them."""
        return {
            "files": checksums(self.experiment),
            "stamps": {
                name: self.stamps[name] for name in self.experiment.named_inputs().values() if name in self.stamps
            },
            "file_settings": self.experiment.file_settings,
            "verdicts": fingerprint(log),
            "photographs": self.experiment.photograph_names(),
        }

    @property
    def manifest(self) -> Manifest:
        """The manifest of the stored files."""
        return Manifest(self.folder)

    def write_manifest(self, log: VerdictLog | None = None) -> None:
        """Write the provenance of the run beside its results; log: the verdicts that it uses."""
        experiment = self.experiment
        verdicts = {}
        if log is not None:
            lines = [entry.line for entry in log.entries()]
            verdicts = {"verdicts": {"sha256": fingerprint(log), "lines": lines}}
        self.manifest.store({
            "rodsight_version": __version__,
            **self._ownership(),
            "inputs": _inputs_of(experiment),
            "settings": as_toml(experiment.config),
            "photographs": experiment.photograph_names(),
            "frames": [self.frames.start, self.frames.stop, *([self.frames.step] if self.frames.step != 1 else [])],
            **verdicts,
        })  # fmt: skip

    def has(self, name: str, origin: Provenance) -> bool:
        """Whether a stored file has this provenance and is unchanged; a note reports a damaged one, or other code."""
        if not self.manifest.lists(name, origin.fingerprint) and not self._keeps_old(name, origin):
            return False
        if self.manifest.is_whole(name):
            return True
        self.notes.append(f"{name} is damaged or was changed: it is made again.")
        return False

    def _keeps_old(self, name: str, origin: Provenance) -> bool:
        """Whether a stored file of the same input but of another program is to be used; a note states the program."""
        other = describe_program(self.manifest.piece(name), origin)
        if not other:
            return False
        if self.keep_old:
            note = f"The results are old, made by {other}: they are shown as they are (--keep-old)."
        else:
            note = (
                f"The stored results were made by {other}: they are computed anew (--keep-old shows them as they are)."
            )
        if note not in self.notes:
            self.notes.append(note)
        return self.keep_old

    def forget(self, *stages: str) -> None:
        """Remove the checkpoints that a killed process left of stages whose results exist."""
        for stage in stages:
            shutil.rmtree(self.folder / UNFINISHED / stage, ignore_errors=True)
        with suppress(OSError):  # not empty, or missing
            (self.folder / UNFINISHED).rmdir()

    def set_aside(self, stage: str) -> None:
        """Keep the frames of a finished stage, which is repeated in part after corrections."""
        aside, checkpoint = self.folder / TRACKED / stage, self.folder / UNFINISHED / stage
        shutil.rmtree(aside, ignore_errors=True)
        aside.parent.mkdir(exist_ok=True)
        if checkpoint.is_dir():
            checkpoint.rename(aside)
        self.forget(stage)

    def aside(self, stage: str, fingerprint: str) -> Checkpoint:
        """Return the frames set aside of a stage with this fingerprint, read-only."""
        return Checkpoint(self.folder / TRACKED / stage, fingerprint, read_only=True)

    def drop_aside(self, stage: str) -> None:
        """Remove the frames set aside of a stage."""
        shutil.rmtree(self.folder / TRACKED / stage, ignore_errors=True)

    def checkpoint(self, stage: str, fingerprint: str) -> Checkpoint:
        """Return the finished frames of an unfinished stage with this fingerprint, or those set aside before."""
        self.claim()
        aside, place = self.folder / TRACKED / stage, self.folder / UNFINISHED / stage
        if aside.is_dir() and not place.exists():
            place.parent.mkdir(exist_ok=True)
            aside.rename(place)
        return Checkpoint(self.folder / UNFINISHED / stage, fingerprint, self.notes)


def describe_program(stored: dict[str, Any], origin: Provenance) -> str:
    """Describe the program that made a file from the same input, such as "other code"; empty: this one, or other input.

    stored: the entry of the file in the manifest.
    """
    if not stored or stored.get("made_from") == origin.fingerprint:
        return ""
    if "inputs" not in stored:
        return "an earlier version, which did not store its code"
    if stored["inputs"] != origin.inputs:
        return ""
    parts = ["other code"] if stored.get("code") != origin.code else []
    former = stored.get("libraries")
    former = former if isinstance(former, dict) else {}
    for library, version in origin.libraries.items():
        if former.get(library) != version:
            parts.append(f"{library} {former.get(library) or '(unknown)'} instead of {version or '(unknown)'}")
    return ", ".join(parts)


def _hash_of(facts: list[Any]) -> str:
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


@contextmanager
def hold_run(run: Run) -> Iterator[Run]:
    """Give the run while no other process works in its folder; partly written files of a stopped one are removed.

    Raises RunError while another process works in the folder, and InputError where it belongs to another experiment, is
    itself one, or cannot be a folder.
    """
    refuse_file(run.folder)
    if (run.folder / CONFIG_NAME).is_file():
        own = f"is the folder of an experiment, with its {CONFIG_NAME}: choose another one for the results with --out"
        raise InputError(run.folder, "", own)
    refuse_foreign_folder(run.folder, run.experiment)
    for name in (UNFINISHED, TRACKED):  # they are emptied
        refuse_link(run.folder / name)
    with hold_folder(run.folder, run.notes.append):
        refuse_foreign_folder(run.folder, run.experiment)  # claimed meanwhile
        for part in (*run.folder.glob(f"*{PART}"), *(run.folder / UNFINISHED).rglob(f"*{PART}")):
            name = part.name.removesuffix(PART)
            if part.parent != run.folder or name in OWN or LATER.fullmatch(name):
                part.unlink(missing_ok=True)
        with run.compiling():
            yield run


def refuse_foreign_folder(folder: Path, experiment: Experiment) -> None:
    """Raise InputError where a run's folder belongs to another experiment."""
    owner = owner_of(folder)
    if owner is None or is_same_file(owner, experiment.file):
        return
    if not owner.is_file():  # moved or renamed: the same input is the same experiment
        inputs = Manifest(folder).fact("inputs")
        with suppress(InputError, OSError):  # of a missing file
            if not isinstance(inputs, dict) or inputs == _inputs_of(experiment):
                return
    raise InputError(
        folder,
        "",
        f"holds the run of another experiment, {owner}, and not of {experiment.file.resolve()}: "
        "choose another folder with --out, or another name",
    )


def owner_of(folder: Path) -> Path | None:
    """Return the experiment file that a run's folder belongs to, whether or not it exists; None: it is free.

    Where the folder was copied or moved, the experiment at the same relative place is the owner if its input is that of
    the run; else it is still the one at its former place.
    """
    manifest = Manifest(folder)
    stored, place = manifest.fact("experiment"), manifest.fact("place")
    if not isinstance(stored, str):
        return None
    beside = Path(os.path.normpath(folder.resolve() / _file_name(stored)))
    former = Path(_file_name(place)) if isinstance(place, str) else beside
    inputs = manifest.fact("inputs")
    if is_same_file(beside, former) or not isinstance(inputs, dict) or has_input(beside, inputs):
        return beside
    return former


def _file_name(text: str) -> str:
    """The name that this process gives to a file named in a manifest, which is UTF-8 whatever names of files are."""
    return os.fsdecode(text.encode("utf-8", NAMES))


def has_input(file: Path, sums: dict[str, str]) -> bool:
    """Whether an experiment file has the input of a run, of which some may have changed.

    Parameters
    ----------
    file : Path
        The experiment file.
    sums : dict
        SHA-256 of the run's input by name, of the experiment file or of half of a sample of the other files.
    """
    if _hash_of_file(file) == sums.get(file.name, ""):
        return True
    inside = [name for name in sorted(sums) if name != file.name and ".." not in Path(name).parts]
    sample = [file.parent / name for name in inside[:: len(inside) // SAMPLED + 1]]
    alike = sum(_hash_of_file(each) == sums[each.relative_to(file.parent).as_posix()] for each in sample)
    return file.is_file() and 2 * alike >= len(sample) > 0


def _hash_of_file(file: Path) -> str | None:
    try:
        return hashlib.sha256(regular(file).read_bytes()).hexdigest()
    except (OSError, ValueError, InputError):  # ValueError: a name that no file can have
        return None


def is_same_file(one: Path, other: Path) -> bool:
    """Whether two paths lead to one file, or would."""
    if one.resolve() == other.resolve():
        return True
    try:
        return one.samefile(other)
    except OSError:  # one of them is missing
        return False


def _inputs_of(experiment: Experiment) -> dict[str, str]:
    """Checksums of all input by name, the experiment file included."""
    return {experiment.file.name: experiment.inputs.checksum(experiment.file), **checksums(experiment)}


def find_experiment(results: Path, origin: Provenance) -> Path:
    """Return the experiment file of results, by the folder's manifest or else by the results themselves.

    Without a manifest the name of a file is not enough: what it names must have the input of the results.
    """
    if not origin.experiment:
        raise InputError(results, "", "this run was solved in memory: it has no experiment to be solved again")
    file = owner_of(results.parent)
    if file is None and has_input(Path(origin.experiment), origin.checksums):
        file = Path(origin.experiment)
    if file is None or not file.is_file():
        raise InputError(
            results,
            f"experiment {file or origin.experiment}",
            "is not at hand, or was moved: run it again with this --out",
        )
    return file.resolve()
