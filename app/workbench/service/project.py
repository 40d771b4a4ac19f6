"""One experiment that is open in the workbench: its draft, its validation, its photographs as pictures, its run."""

from __future__ import annotations

import math
import threading
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...experiment.pictures.image import Image
from ...experiment.reading.input_files import InputFiles
from ...experiment.units import Scale
from ...out_of_date import recording_out_of_date
from ...prediction import measure_photographs
from ...process.errors import InputError
from ...process.links import refuse_links
from ...process.machine.free_memory import release_free_memory
from ...results.manifest import MANIFEST
from ...reviewing.reviewed_run import ReviewedRun
from ...reviewing.session import ReviewSession
from ...run_folder import RESULTS, SUMMARY, is_same_file, owner_of
from ...tracking.picture_quality import PictureQuality
from ...verdicts.log import VERDICTS, VerdictLog
from ..correcting.pose_editor import PoseEditor
from ..inspecting.photograph_store import WHOLE, Name, Part, PhotographStore
from ..inspecting.run_data import RunData, read_finished_run, read_run, run_stamp
from ..inspecting.run_overview import run_overview
from ..inspecting.run_scene import Scene, run_scene, tracks_scale
from ..running.job import Job
from ..setup.description import coarse_size, describe_rods, describe_tables, describe_walls, table_names
from ..setup.draft import Draft, stamp_of
from ..setup.experiment_folders import run_folder, valid_name
from ..setup.journal import PLACE, Action, Journal
from ..setup.photograph_series import describe_series
from ..setup.validation import Mark, ValidationResult, outside_walls, validate

NOT_OWN = "of_another_experiment"  # below the run's folder of another experiment: nothing is there


class Project:
    """An experiment's folder under the folder that the workbench was opened on."""

    def __init__(self, root: Path, folder: Path, run: Path | None = None) -> None:
        """Open the experiment of a folder; run: folder of its results, default runs/<name> below the root."""
        self.root, self.folder, self._run = root, folder, run
        self.draft = Draft(folder, Journal(folder / PLACE), root=root)
        self.lock = threading.RLock()
        self.editing = threading.RLock()  # held from what an edit reads to what it writes
        self._photographs = PhotographStore()
        self._stamp: Any = None
        self._validation: ValidationResult | None = None
        self._job: Job | None = None
        self._run_data: tuple[Any, RunData | None] = (None, None)
        self._finished: tuple[Any, RunData | None] = (None, None)
        self._editor: tuple[Any, PoseEditor] | None = None
        self._making_editor = threading.Lock()
        self._session: tuple[Any, ReviewSession] | None = None
        self._quality: tuple[Any, PictureQuality] | None = None
        self._measuring = threading.Lock()
        self._outdated: tuple[str, list[str]] | None = None
        self._owner_read: tuple[Any, Path | None] | None = None

    @property
    def key(self) -> str:
        """The experiment in requests: its path from the root."""
        return self.folder.relative_to(self.root).as_posix()

    def refuse_links(self) -> None:
        """Raise InputError where files of the program's own, in the experiment or its run, are links to the outside."""
        refuse_links(self.folder / PLACE, self.root)
        refuse_links(self.run_folder, self.root if self._run is None else self._run)

    def validation(self) -> ValidationResult:
        """Validate the files; they are read again only where one has changed."""
        with self.lock:
            data = self.draft.data()
            stamp = self.draft.stamps(table_names(data)), self._pattern_stamp(data)
            if self._validation is None or stamp != self._stamp:
                self._stamp, self._validation = stamp, validate(self.draft)
                release_free_memory()  # of tables
            return self._validation

    def quality(self) -> PictureQuality:
        """Measure the photographs; again only where photographs, region, channel or rods change."""
        found = self.validation()
        if found.experiment is None or found.shape is None:
            raise InputError(self.draft.file, "key photographs", "names no photograph that can be measured yet")
        section, rods = found.data.get("photographs", {}), found.rods
        settings = tuple(str(section.get(key)) for key in ("channel", "region", "mask", "follow"))
        stamp = found.files, self._pattern_stamp(found.data), settings, coarse_size(rods)
        with self._measuring:  # not the other lock: pictures are served meanwhile
            if self._quality is None or self._quality[0] != stamp:
                self._quality = stamp, measure_photographs(found.experiment, rods)
            return self._quality[1]

    def photograph(self, frame: int) -> Image:
        """Read one photograph, grey; those used last are kept."""
        return self._photographs.measured(self._photograph_name(frame))

    def used_photograph(self, frame: int) -> Image:
        """Read one photograph without what lies outside its region, or under its mask."""
        image, experiment = self.photograph(frame), self.validation().experiment
        section = None if experiment is None else experiment.config.photographs
        if experiment is None or section is None:
            return image
        return replace(experiment.selection(experiment.photographs().files[0]), rotation=0).cut(image)

    def _photograph_name(self, frame: int) -> Name:
        """A name of a photograph that changes with its file and the channel. Raises InputError."""
        found = self.validation()
        if not 0 <= frame < len(found.files):
            raise InputError(self.draft.file, f"photograph {frame}", f"is not there: {len(found.files)} are")
        file, section = found.files[frame], found.data.get("photographs", {})
        InputFiles(self.root).refuse_outside(file)  # also where it was exchanged for a link since
        rotation = section.get("rotation", 0)
        return file, hash(stamp_of(file)), section.get("channel", "grey"), rotation if rotation in (90, 180, 270) else 0

    def picture(self, frame: int, widest: int, part: Part = WHOLE) -> bytes:
        """Encode rows and columns of a photograph as JPEG, no wider or higher than so many pixels."""
        picture = self._photographs.picture(self._photograph_name(frame), widest, part)
        if picture is None:
            raise InputError(self.draft.file, f"photograph {frame}", "has no such part")
        return picture

    def crop(self, frame: int, place: tuple[float, float], width: float, shape: tuple[int, int]) -> bytes:
        """Encode a part of a photograph as JPEG: its centre and width [px], rows and columns of what is sent."""
        return self._photographs.crop(self._photograph_name(frame), place, width, shape)

    @property
    def name(self) -> str:
        name = self.draft.data().get("name")
        if isinstance(name, str) and valid_name(name) == name:  # no path leads out of runs/
            return name
        return valid_name(self.folder.name)

    @property
    def run_folder(self) -> Path:
        """The folder that a run writes to."""
        if self._run is not None:
            return self._run
        folder = run_folder(self.root, self.name)
        if not folder.resolve().is_relative_to(self.root.resolve()):
            raise InputError(folder, "", f"leads outside of {self.root}: open the folder that holds both")
        return folder

    @property
    def results(self) -> Path:
        """The folder of its run; where another experiment has that folder, one that does not exist."""
        folder = self.run_folder
        owner = self._owner(folder)
        own = owner is None or is_same_file(owner, self.draft.file) or not owner.is_file()  # moved
        return folder if own else folder / NOT_OWN

    def _owner(self, folder: Path) -> Path | None:
        """The experiment that a run's folder belongs to; read again only where that has changed."""
        stamp = folder, stamp_of(folder / MANIFEST)
        if self._owner_read is None or self._owner_read[0] != stamp:
            self._owner_read = stamp, owner_of(folder)
        return self._owner_read[1]

    def photograph_count(self) -> int:
        """Count the photographs that are there now."""
        return len(self.validation().files)

    def frame_count(self) -> int:
        """Count the photographs, or, where tracks are given, the frames of the run."""
        count = self.photograph_count()
        data = None if count else self.run_data()
        return count if data is None else data.stop

    @property
    def job(self) -> Job:
        """The runs of the experiment, one at a time."""
        with self.lock:
            if self._job is None or (self._job.results != self.results and not self._job.is_running):
                self._job = Job(self.root, self.folder, self.results, self.folder / PLACE)
                self._job.find()
            return self._job

    def run_data(self) -> RunData | None:
        """Read the frames of the run that are solved; again only where one was added."""
        with self.lock:
            stamp = self.results, run_stamp(self.results)
            if self._run_data[0] != stamp:
                former = self._run_data[1] if self._run_data[0] and self._run_data[0][0] == self.results else None
                self._run_data = stamp, read_run(self.results, former)
            return self._run_data[1]

    def reviewed_run(self) -> ReviewedRun:
        """Return the finished results with their experiment; raise InputError where there are none."""
        data, experiment = self._finished_data(), self.validation().experiment
        if data is None or data.results is None:
            raise InputError(self.results, "", "holds no finished results: let the run end first")
        if experiment is None:
            raise InputError(self.draft.file, "", "cannot be read")
        return ReviewedRun(self.results / RESULTS, data.results, experiment, data.first)

    def review_session(self) -> ReviewSession:
        """Return the review of the finished results; a new one where the results or the experiment have changed."""
        with self.lock:
            stamp = self.results, run_stamp(self.results), self.draft.stamps(table_names(self.draft.data()))
            if self._session is None or self._session[0] != stamp:
                self._session = (
                    stamp,
                    ReviewSession(
                        self.reviewed_run(), run_scene(self.validation(), self.results, self._finished_data()).scale
                    ),
                )
            return self._session[1]

    def _finished_data(self) -> RunData | None:
        """The finished results, also while a later run is in progress."""
        with self.lock:
            data = self.run_data()
            if data is not None and data.results is not None:
                return data
            stamp = stamp_of(self.results / RESULTS)
            if self._finished[0] != stamp:
                self._finished = stamp, read_finished_run(self.results)
            return self._finished[1]

    def scene(self) -> Scene:
        """Return scale and size of the picture over which the run is drawn; raise InputError where there is none."""
        return run_scene(self.validation(), self.results, self.run_data())

    @contextmanager
    def with_verdicts(self) -> Iterator[None]:
        """Let verdicts follow their photographs where their order changes inside the block."""
        before = self.photograph_names()
        yield
        VerdictLog(self.results / VERDICTS).reorder(before, self.photograph_names())

    def revert(self, *, back: bool) -> Action | None:
        """Undo the last action, or (back false) repeat the one undone last; None: there is none.

        Verdicts that were undone elsewhere are passed over.
        """
        journal = self.draft.journal
        while (action := journal.last_done() if back else journal.last_undone()) is not None:
            if action.verdict is None:
                with self.with_verdicts():
                    self.draft.revert(action, back=back)
                return action
            log = VerdictLog(self.results / VERDICTS)
            line = str(action.verdict["line"])
            changed = log.undo_line(line) if back else log.repeat(line)
            if back:
                journal.undo(action)
            else:
                journal.redo(action, None if changed is None else {**action.verdict, "line": changed.line})
            if changed is not None:
                return action
        return None

    def photograph_names(self) -> list[str]:
        """Return the names of the photographs in their order."""
        experiment = self.validation().experiment
        return [] if experiment is None else experiment.photograph_names()

    def pose_editor(self, make: Callable[[], PoseEditor]) -> PoseEditor:
        """Return the editor of the rods' poses; a new one where the rods of the run have changed."""
        with self._making_editor:  # not the other lock: pictures are served while it is made
            stamp = self.results, run_stamp(self.results)[1]
            if self._editor is None or self._editor[0] != stamp:
                self._editor = stamp, make()
            return self._editor[1]

    def tracks_scale(self) -> Scale:
        """Return the scale with which the tracks were made, which the experiment may not have any more."""
        return tracks_scale(self.validation(), self.results)

    def stamp(self) -> str:
        """Return a text that changes with every file of the experiment and its run, whoever changed it."""
        data = self.draft.data()
        written = [stamp_of(self.results / name) for name in (VERDICTS, SUMMARY, MANIFEST)]
        stamps = self.draft.stamps(table_names(data)), self._pattern_stamp(data), run_stamp(self.results)[1:]
        return f"{zlib.crc32(repr((stamps, written)).encode()):08x}"

    def out_of_date(self) -> list[str]:
        """Return the reasons for which the results are out of date."""
        with self.lock:
            stamp = self.stamp()
            if self._outdated is None or self._outdated[0] != stamp:
                self._outdated = stamp, recording_out_of_date(self.results, self.root)
            return self._outdated[1]

    def _run_overview(self) -> dict[str, Any] | None:
        return run_overview(self.results, self.out_of_date())

    def close(self) -> None:
        """Pause the run."""
        if self._job is not None:
            self._job.close()

    def overview(self) -> dict[str, Any]:
        """Describe the experiment for the first page."""
        values: dict[str, Any] = {"at": self.key, "name": self.folder.name, "run": None, "steps": [], "frames": 0}
        try:
            found = self.validation()
            return values | {
                "name": self.name, "run": self._run_overview(), "frames": len(found.files),
                "steps": [each["mark"] for each in self._steps(found)],
            }  # fmt: skip
        except (InputError, OSError, RecursionError) as error:
            return values | {"error": str(error) or "is nested too deeply"}

    def describe(self) -> dict[str, Any]:
        """Describe the set-up for the page; places in pixels, everything else in SI units."""
        found = self.validation()
        self.draft.note_shown()
        section = found.data.get("photographs", {})
        height, width = found.shape or (0, 0)
        bounds: tuple[float, ...] | None = None
        if found.tracked and self.run_data() is not None:
            bounds = self.scene().bounds
            width, height = math.ceil(bounds[2] - bounds[0]), math.ceil(bounds[3] - bounds[1])
        return {
            "at": self.key, "stamp": self.stamp(), "name": self.name, "folder": str(self.folder),
            "ready": found.ready and not self._taken(), "steps": self._steps(found),
            "other_messages": found.other_messages, "tracked": found.tracked, "width": width, "height": height,
            "bounds": bounds,
            "files": [file.name for file in found.files], "series": describe_series(found),
            "frames": self.frame_count(), "photographs": section,
            "pixel": None if found.scale is None else found.scale.mean_size,
            "walls": describe_walls(found), "rods": describe_rods(found),
            "outside": outside_walls(found), "material": found.data.get("material", {}),
            "tables": describe_tables(found),
            "undo": None if (done := self.draft.journal.last_done()) is None else done.name,
            "redo": None if (undone := self.draft.journal.last_undone()) is None else undone.name,
            "run": self._run_overview(),
        }  # fmt: skip

    def _steps(self, found: ValidationResult) -> list[dict[str, Any]]:
        steps = [
            {"name": s.name, "mark": s.mark.value, "messages": list(s.messages)} for s in found.steps.values()
        ]  # fmt: skip
        if taken := self._taken():
            steps[0] |= {"mark": Mark.MISSING.value, "messages": [taken, *steps[0]["messages"]]}
        return steps

    def _taken(self) -> str:
        """State that another experiment has the folder of the run, as after a copy; empty: none has."""
        if self.results == (folder := self.run_folder):
            return ""
        owner = self._owner(folder)
        other: Path | str = "another experiment" if owner is None else owner.parent
        if isinstance(other, Path) and other.is_relative_to(self.root.resolve()):
            other = other.relative_to(self.root.resolve())
        return f"runs/{self.name} holds the run of {other}: give this experiment another name to run it."

    def _pattern_stamp(self, data: dict[str, Any]) -> Any:
        section = data.get("photographs", {})
        pattern = section.get("files") if isinstance(section, dict) else None
        if not isinstance(pattern, str):
            return None
        folder = (self.folder / pattern).parent
        try:
            known = () if self._validation is None else self._validation.all_files  # each may be replaced in place
            return folder.stat().st_mtime_ns, hash(tuple(map(stamp_of, known)))
        except (OSError, ValueError):
            return None
