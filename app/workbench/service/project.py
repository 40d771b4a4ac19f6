"""One experiment that is open in the workbench: its draft, what is understood of it, its photographs as pictures."""

from __future__ import annotations

import threading
import zlib
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ...errors import InputError
from ...experiment.experiment import GrainGuess
from ...experiment.photographs import Channel, Image, read_photograph
from ...experiment.units import Scale
from ...promise import measure_photographs
from ...run_folder import SUMMARY
from ...tracking.picture_quality import PictureQuality
from ...verdicts.log import VERDICTS
from ..inspecting.found import Found, find_run, run_stamp
from ..mending.mender import Mender
from ..running.job import Job
from ..setup.circles import circles_of
from ..setup.draft import Draft, stamp_of
from ..setup.edits import TABLES
from ..setup.folder import run_facts, run_folder
from ..setup.steps import Understood, judge

KEPT = 6  # photographs in memory: the one shown, two to either side, the first
KEPT_PICTURES, SMALL_PICTURE = 32, 2_000_000  # of them as they were sent; [bytes]
QUALITY = 90  # of JPEG
CROP = 240  # [px] of a crop as it is sent


def as_jpeg(image: Image, widest: int) -> bytes:
    """A photograph as JPEG, no wider or higher than so many pixels."""
    shrink = min(1.0, widest / max(image.shape))
    small = cv2.resize(image, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA) if shrink < 1.0 else image
    grey = np.clip(np.rint(small), 0, 255).astype(np.uint8)
    return cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()


class Project:
    """An experiment's folder under the folder that the workbench was opened on."""

    def __init__(self, root: Path, folder: Path) -> None:
        self.root, self.folder = root, folder
        self.draft = Draft(folder)
        self.lock = threading.RLock()
        self.editing = threading.RLock()  # held from what an edit reads to what it writes
        self._photographs: OrderedDict[tuple[Path, int, Channel], Image] = OrderedDict()
        self._pictures: OrderedDict[tuple[Path, int, Channel, int], bytes] = OrderedDict()
        self._stamp: Any = None
        self._understood: Understood | None = None
        self._job: Job | None = None
        self._found: tuple[Any, Found | None] = (None, None)
        self._mender: tuple[Any, Mender] | None = None
        self._mending = threading.Lock()
        self._quality: tuple[Any, PictureQuality] | None = None
        self._measuring = threading.Lock()

    @property
    def key(self) -> str:
        """How the page calls it: the path from the root."""
        return self.folder.relative_to(self.root).as_posix()

    def understood(self) -> Understood:
        """What the files say now; read again only where one has changed."""
        with self.lock:
            data = self.draft.data()
            stamp = self.draft.stamps(_tables(data)), self._pattern_stamp(data)
            if self._understood is None or stamp != self._stamp:
                self._stamp, self._understood = stamp, judge(self.draft)
            return self._understood

    def quality(self) -> PictureQuality:
        """What the photographs are good for; measured again only where photographs, region, channel or rods change."""
        found = self.understood()
        if found.experiment is None or found.shape is None:
            raise InputError(self.draft.file, "key photographs", "names nothing that can be looked at yet")
        section, rods = found.data.get("photographs", {}), found.rods
        told = tuple(str(section.get(key)) for key in ("channel", "region", "follow"))
        stamp = found.files, self._pattern_stamp(found.data), told, _size_of(rods)
        with self._measuring:  # not the other lock: pictures are answered meanwhile
            if self._quality is None or self._quality[0] != stamp:
                self._quality = stamp, measure_photographs(found.experiment, rods)
            return self._quality[1]

    def photograph(self, frame: int) -> Image:
        """One photograph, grey; those looked at last are kept."""
        key = self._photograph_key(frame)
        with self.lock:
            if key in self._photographs:
                self._photographs.move_to_end(key)
                return self._photographs[key]
        image = read_photograph(key[0], channel=key[2])
        with self.lock:
            self._photographs[key] = image
            while len(self._photographs) > KEPT:
                self._photographs.popitem(last=False)
        return image

    def _photograph_key(self, frame: int) -> tuple[Path, int, Channel]:
        """What a photograph is, as long as its file and the channel stay the same. Raises InputError."""
        found = self.understood()
        if not 0 <= frame < len(found.files):
            raise InputError(self.draft.file, f"photograph {frame}", f"is not there: {len(found.files)} are")
        file, section = found.files[frame], found.data.get("photographs", {})
        return file, file.stat().st_mtime_ns, section.get("channel", "grey")

    def picture(self, frame: int, widest: int) -> bytes:
        """One photograph as JPEG, no wider or higher than so many pixels; small ones that were sent last are kept."""
        key = *self._photograph_key(frame), widest
        with self.lock:
            if key in self._pictures:
                self._pictures.move_to_end(key)
                return self._pictures[key]
        picture = as_jpeg(self.photograph(frame), widest)
        if len(picture) <= SMALL_PICTURE:
            with self.lock:
                self._pictures[key] = picture
                while len(self._pictures) > KEPT_PICTURES:
                    self._pictures.popitem(last=False)
        return picture

    @property
    def name(self) -> str:
        told = self.draft.data().get("name")
        return told if isinstance(told, str) else self.folder.name

    @property
    def results(self) -> Path:
        """The folder of its run."""
        return run_folder(self.root, self.name)

    def crop(self, frame: int, x: float, y: float, width: int) -> bytes:
        """A square of a photograph about a place [px], shifted by parts of a pixel, as JPEG of CROP pixels."""
        if not 4 <= width <= 4000:
            raise InputError("crop", f"width = {width}", "is not a width that can be shown")
        image = self.photograph(frame)
        grown = CROP / width
        shift = np.array([[grown, 0.0, 0.5 * CROP - grown * x], [0.0, grown, 0.5 * CROP - grown * y]])
        square = cv2.warpAffine(image, shift, (CROP, CROP), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        grey = np.clip(np.rint(square), 0, 255).astype(np.uint8)
        return cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()

    def photograph_count(self) -> int:
        """How many photographs there are now."""
        return len(self.understood().files)

    @property
    def job(self) -> Job:
        """Its runs, one at a time."""
        with self.lock:
            if self._job is None or (self._job.results != self.results and self._job.process is None):
                self._job = Job(self.root, self.folder, self.results)
            return self._job

    def found(self) -> Found | None:
        """What its run has found so far; read again only where something has come."""
        with self.lock:
            stamp = self.results, run_stamp(self.results)
            if self._found[0] != stamp:
                former = self._found[1] if self._found[0] and self._found[0][0] == self.results else None
                self._found = stamp, find_run(self.results, former)
            return self._found[1]

    def mender(self, make: Callable[[], Mender]) -> Mender:
        """What correlates its rods again; made anew where the run's rods have changed."""
        with self._mending:  # not the other lock: pictures are answered while it is made
            stamp = self.results, run_stamp(self.results)[1]
            if self._mender is None or self._mender[0] != stamp:
                self._mender = stamp, make()
            return self._mender[1]

    def given_scale(self) -> Scale:
        """What a pixel is told to be. Raises InputError where it is not."""
        scale = self.understood().scale
        if scale is None:
            raise InputError(self.draft.file, "key photographs.pixel_size", "is missing: set the scale first")
        return scale

    def stamp(self) -> str:
        """Another text wherever anything of it has changed, whoever changed it."""
        data = self.draft.data()
        told = (self.results / name for name in (VERDICTS, SUMMARY))
        seen = self.draft.stamps(_tables(data)), self._pattern_stamp(data), run_stamp(self.results)[1:]
        return f"{zlib.crc32(repr((seen, [stamp_of(file) for file in told])).encode()):08x}"

    def close(self) -> None:
        """Pause what runs."""
        if self._job is not None:
            self._job.close()

    def glance(self) -> dict[str, Any]:
        """What the first page shows of it."""
        told: dict[str, Any] = {"at": self.key, "name": self.folder.name, "run": None, "steps": [], "frames": 0}
        try:
            found = self.understood()
        except InputError as error:
            return told | {"complaint": str(error)}
        return told | {
            "name": self.name, "run": run_facts(self.results), "frames": len(found.files),
            "steps": [each.mark.value for each in found.steps.values()],
        }  # fmt: skip

    def describe(self) -> dict[str, Any]:
        """All that the page shows of the set-up; places in pixels, everything else in SI units."""
        found = self.understood()
        section = found.data.get("photographs", {})
        height, width = found.shape or (0, 0)
        return {
            "at": self.key, "stamp": self.stamp(), "name": self.name, "folder": str(self.folder), "ready": found.ready,
            "steps": [{"name": s.name, "mark": s.mark.value, "says": s.says} for s in found.steps.values()],
            "others": found.others, "tracked": found.tracked, "width": width, "height": height,
            "files": [file.name for file in found.files], "photographs": section,
            "pixel": None if found.scale is None else found.scale.mean_size,
            "walls": _walls(found), "rods": _rods(found), "material": found.data.get("material", {}),
            "tables": _named_tables(found),
            "undo": self.draft.done[-1].what if self.draft.done else None,
            "redo": self.draft.undone[-1].what if self.draft.undone else None,
            "run": run_facts(self.results),
        }  # fmt: skip

    def _pattern_stamp(self, data: dict[str, Any]) -> Any:
        section = data.get("photographs", {})
        pattern = section.get("files") if isinstance(section, dict) else None
        if not isinstance(pattern, str):
            return None
        folder = (self.folder / pattern).parent
        try:
            return folder.stat().st_mtime_ns
        except OSError:
            return None


def _tables(data: dict[str, Any]) -> list[str]:
    """Names of the tables that an experiment file names, as far as it makes sense."""
    names = []
    for told in data.values():
        if isinstance(told, dict):
            names += [value for value in told.values() if isinstance(value, str) and value.endswith(".csv")]
    return names


def _walls(found: Understood) -> list[dict[str, Any]]:
    if found.walls is None or found.scale is None:
        return []
    ends = found.scale.to_pixels(found.walls.endpoints[0])
    plates = found.data.get("walls", {})
    circles = {each.name: asdict(each) for each in circles_of(found)}
    told = []
    for name, line, pressure in zip(found.walls.name, ends.tolist(), found.walls.pressure.tolist(), strict=True):
        plate = plates.get(name)
        told.append({
            "name": name, "line": line, "circle": circles.get(name),
            "pressure": None if pressure != pressure else pressure,
            "ends": plate.get("ends", "auto") if isinstance(plate, dict) else "auto",
        })  # fmt: skip
    return told


def _size_of(rods: GrainGuess | None) -> tuple[int, int] | None:
    """What a measurement on some of the rods hangs on: a rod that is moved, or ten that are added, changes nothing."""
    return None if rods is None or not len(rods.id) else (len(rods.id) // 10, round(float(np.median(rods.radius))))


def _named_tables(found: Understood) -> dict[str, Any]:
    """Tables from elsewhere that the experiment names, by what they are; None: no such table."""
    sections = {section: found.data.get(section) for section, *_ in TABLES.values()}
    return {
        name: told.get(name) if isinstance(told := sections[section], dict) else None
        for name, (section, *_) in TABLES.items()
    }


def _rods(found: Understood) -> dict[str, Any] | None:
    rods = found.rods
    if rods is None:
        return None
    return {
        "id": rods.id.tolist(), "x": np.round(rods.x, 2).tolist(), "y": np.round(rods.y, 2).tolist(),
        "r": np.round(rods.radius, 3).tolist(),
    }  # fmt: skip
