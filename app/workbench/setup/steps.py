"""What is understood of an experiment that is being set up, and what is good, doubtful or missing in every step.

The sentences are those of `rodsight check`: its own functions are asked, each for the step that it is about.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field
from enum import StrEnum
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...experiment.config.experiment_file import ExperimentFile, find_complaints
from ...experiment.experiment import Experiment, GrainGuess, read_grain_guess, read_times, read_tracks
from ...experiment.image_header import claimed_size
from ...experiment.photographs import Channel, read_photograph
from ...experiment.plausibility import check_inside, check_radii, doubtful_loads, open_sides, rods_beyond_ends
from ...experiment.scaling import make_scale
from ...experiment.units import Scale
from ...experiment.walls import read_walls
from ...tracks import Tracks, TrackStatus, WallTracks
from .draft import Draft

HEADER = 1 << 18  # bytes in which a photograph tells its size
STEPS = ("photographs", "scale", "walls", "rods", "material")
OF_KEYS = {  # the step that a key belongs to: the longest beginning counts
    "photographs": "photographs", "photographs.pixel_size": "scale", "photographs.distance": "scale",
    "photographs.lens": "scale", "photographs.radii": "rods", "photographs.grains": "rods", "walls": "walls",
    "boundary": "walls",
    "material": "material",
}  # fmt: skip
STAND_IN = 1e-4  # [m] of a pixel, and [s] between photographs, while others are judged


class Mark(StrEnum):
    GOOD = "good"
    DOUBTFUL = "doubtful"
    MISSING = "missing"


@dataclass(slots=True)
class Step:
    """One step of the set-up: how it stands, and why."""

    name: str
    mark: Mark = Mark.GOOD
    says: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)  # of what it says, what is told and wrong

    def refuse(self, sentence: str) -> None:
        """What is told cannot be used."""
        self.lack(sentence)
        self.wrong.append(sentence)

    def doubt(self, sentence: str) -> None:
        self.says.append(sentence)
        self.mark = Mark.DOUBTFUL if self.mark is Mark.GOOD else self.mark

    def lack(self, sentence: str) -> None:
        self.says.append(sentence)
        self.mark = Mark.MISSING


@dataclass(slots=True)
class Understood:
    """An experiment as far as it is there; None: not told, or not yet right."""

    steps: dict[str, Step]
    data: dict[str, Any]
    files: tuple[Path, ...] = ()
    shape: tuple[int, int] | None = None  # rows, columns [px]
    scale: Scale | None = None
    walls: WallTracks | None = None  # of frame 0
    rods: GrainGuess | None = None  # [px] on the first photograph
    experiment: Experiment | None = None  # with a scale and a clock put in where they are missing
    others: list[str] = field(default_factory=list)  # complaints that belong to no step

    @property
    def ready(self) -> bool:
        """Whether a run can begin."""
        return not self.others and all(step.mark is not Mark.MISSING for step in self.steps.values())

    @property
    def tracked(self) -> bool:
        """Whether the grains come from another tool's tables."""
        return "tracks" in self.data


def judge(draft: Draft) -> Understood:
    """Read an experiment's files and judge every step. Raises InputError where the experiment file is no TOML."""
    data = draft.data()
    found = Understood({name: Step(name) for name in STEPS}, data)
    filled = _fill_in(found, data)
    for key, complaint in find_complaints(draft.file, filled):
        step = _step_of(key)
        sentence = _without_file(draft.file, complaint)
        if step is None:
            found.others.append(sentence)
        else:
            found.steps[step].refuse(sentence)
    _look(found, draft, filled)
    return found


def _fill_in(found: Understood, data: dict[str, Any]) -> dict[str, Any]:
    """The values with what is not told yet put in, so that the rest can be judged; what was missing is said."""
    filled = deepcopy(data)
    filled.setdefault("name", "unnamed")
    if found.tracked:
        return filled
    section = filled.setdefault("photographs", {})
    steps = found.steps
    if not isinstance(section, dict):
        return filled
    if "files" not in section:
        steps["photographs"].lack("No photographs are named: without them nothing can be tracked.")
        section["files"] = "*.none"
    if "interval" not in section and "times" not in section:
        steps["photographs"].lack("The time between photographs is not told: velocities follow from it.")
        section["interval"] = STAND_IN
    if "pixel_size" not in section and "distance" not in section:
        steps["scale"].lack("What a pixel is in metres is not told: walls, radii and forces need it.")
        section["pixel_size"] = STAND_IN
    if not isinstance(filled.get("walls"), dict) or not filled["walls"].keys() & {"file", "arcs"}:
        if "boundary" not in data:
            steps["walls"].lack("No walls are told: without them grains can be tracked but not solved.")
        filled.pop("walls", None)
    if "material" not in data:
        friction = ExperimentFile.model_fields["material"].default.friction
        steps["material"].doubt(
            f"Nothing is told of the rods: friction {friction:g} is assumed, and too low a friction is the worst "
            "error you can make here."
        )
    return filled


def _look(found: Understood, draft: Draft, filled: dict[str, Any]) -> None:
    """Read what the values name, as far as they can be used."""
    usable = deepcopy(filled)
    for name in ("walls", "material"):
        if found.steps[name].mark is Mark.MISSING:
            usable.pop(name, None)
    if find_complaints(draft.file, usable):
        return
    experiment = Experiment(draft.file, ExperimentFile.model_validate(usable))
    found.experiment = experiment
    if found.tracked:
        _look_at_tracks(found, experiment)
        return
    if not _look_at_photographs(found, experiment):
        return
    section = experiment.config.photographs
    assert section is not None
    assert found.shape is not None
    if found.steps["scale"].mark is not Mark.MISSING:
        found.scale = make_scale(section, found.shape[0])
    rods = _asked(found, "rods", lambda: read_grain_guess(experiment))
    if section.grains is None:
        found.steps["rods"].lack("The rods have not been looked for; a run would find them by itself, unseen by you.")
        found.steps["rods"].mark = Mark.DOUBTFUL
    elif rods is not None:
        found.rods = rods
        _look_at_rods(found, experiment)
    if experiment.config.walls is not None and found.scale is not None:
        found.walls = _asked(found, "walls", lambda: read_walls(experiment, len(found.files)))
        _look_at_walls(found, experiment)
    elif experiment.config.walls is not None:
        found.steps["walls"].lack("Walls are told in metres: set the scale first.")


def _look_at_photographs(found: Understood, experiment: Experiment) -> bool:
    step = found.steps["photographs"]
    try:
        found.files = tuple(experiment.photographs().files)
        section = experiment.config.photographs
        assert section is not None
        told = found.files[0].stat()
        found.shape = _shape_of(found.files[0], told.st_mtime_ns, told.st_size, section.max_pixels, section.channel)
        experiment.photographs().check_region(found.shape)
        for k, file in enumerate(found.files):
            with file.open("rb") as stream:
                size = claimed_size(stream.read(HEADER))
            if size is not None and size != (found.shape[1], found.shape[0]):
                mistake = f"is {size[0]} x {size[1]} pixels, the first photograph {found.shape[1]} x {found.shape[0]}"
                raise InputError(file, f"photograph {k}", mistake)
        if "interval" not in found.data.get("photographs", {}) and section.times is None:
            return True
        read_times(experiment, len(found.files))
    except InputError as error:
        step.refuse(_without_file(experiment.folder, error))
        return found.shape is not None
    except OSError as error:
        step.lack(str(error))
        return False
    if len(found.files) < 2:
        step.doubt("There is one photograph: forces are found from how rods move between photographs.")
    return True


@lru_cache(maxsize=16)
def _shape_of(file: Path, _changed: int, _size: int, most: int, channel: Channel) -> tuple[int, int]:
    """Rows and columns of a photograph, which is read once as long as it stays the same."""
    image = read_photograph(file, max_pixels=most, channel=channel)
    return image.shape[0], image.shape[1]


def _look_at_rods(found: Understood, experiment: Experiment) -> None:
    if found.scale is None:
        return
    tracks = first_tracks(found)
    try:
        check_radii(experiment, tracks)
    except InputError as error:
        found.steps["rods"].doubt(_without_file(experiment.file, error))


def _look_at_walls(found: Understood, experiment: Experiment) -> None:
    walls, step = found.walls, found.steps["walls"]
    if walls is None:
        return
    if not walls.loaded.any():
        step.doubt("No wall has a pressure: forces are then known up to their scale only.")
    for sentence in open_sides(walls.frames(0, 1)) if experiment.config.boundary is None else ():
        step.doubt(sentence)
    if found.rods is None:
        return
    tracks, first = first_tracks(found), walls.frames(0, 1)
    try:
        check_inside(experiment, tracks, first)
    except InputError as error:
        step.refuse(_without_file(experiment.folder, error))
        return
    for sentence in (*rods_beyond_ends(tracks, first), *doubtful_loads(experiment, tracks, first)):
        step.doubt(sentence)


def _look_at_tracks(found: Understood, experiment: Experiment) -> None:
    tracks = _asked(found, "rods", lambda: read_tracks(experiment))
    if tracks is None:
        return
    try:
        check_radii(experiment, tracks)
        found.walls = read_walls(experiment, tracks.frame_count)
        if found.walls is not None:
            check_inside(experiment, tracks, found.walls)
    except InputError as error:
        found.steps["walls"].refuse(_without_file(experiment.folder, error))


def first_tracks(found: Understood) -> Tracks:
    """The rods of the first photograph as tracks of one frame; the scale must be known."""
    rods, scale = found.rods, found.scale
    assert rods is not None
    assert scale is not None
    place = np.stack([rods.x, rods.y], axis=1)
    n = len(rods.id)
    return Tracks(
        rods.id, rods.radius * scale.size_at(place), np.zeros(1), scale.to_world(place)[None], np.zeros((1, n)),
        np.full((1, n), np.nan), np.full((1, n), np.nan), np.full((1, n), TrackStatus.GIVEN, np.uint8),
    )  # fmt: skip


def _asked(found: Understood, step: str, question: Any) -> Any:
    """An answer, or None with the complaint said in the step."""
    try:
        return question()
    except InputError as error:
        folder = found.experiment.folder if found.experiment is not None else Path()
        found.steps[step].refuse(_without_file(folder, error))
        return None


def _step_of(key: str) -> str | None:
    for length in range(key.count(".") + 1, 0, -1):
        step = OF_KEYS.get(".".join(key.split(".")[:length]))
        if step is not None:
            return step
    return None


def _without_file(file: Path, error: InputError) -> str:
    """The complaint without the folder that everybody knows."""
    folder = file if file.is_dir() else file.parent
    return str(error).removeprefix(f"{file}: ").replace(f"{folder}/", "")
