"""Validation of an experiment that is being set up: every step is good, doubtful or missing.

The messages are those of `rodsight check`: its functions are called, each for the step that it concerns.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field
from enum import StrEnum
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ...experiment.config.experiment_file import ExperimentFile, find_config_errors
from ...experiment.experiment import Experiment, GrainGuess, read_grain_guess, read_times, read_tracks
from ...experiment.pictures.image import Channel
from ...experiment.pictures.picture_file import read_photograph
from ...experiment.plausibility import (
    PackingSources,
    check_inside,
    check_radii,
    expected_rods,
    implausible_walls,
    open_sides,
    rods_cut_by_walls,
)
from ...experiment.reading.input_files import InputFiles
from ...experiment.reading.photograph_order import MissingNumbers, missing_numbers
from ...experiment.scaling import make_scale
from ...experiment.units import Scale
from ...experiment.walls import read_walls
from ...process.counts import state_count
from ...process.errors import InputError
from ...solver.bodies.wall_shapes import bounding_distance
from ...tracking.missed_rods import describe_missed_rods
from ...tracks import Tracks, TrackStatus, WallTracks
from .draft import Draft
from .photograph_checks import LISTED, compare_with_camera, name_fractions, name_missing, unusable

STEPS = ("photographs", "scale", "walls", "rods", "material")
OF_KEYS = {  # the step of a key: the longest prefix counts
    "photographs": "photographs", "photographs.pixel_size": "scale", "photographs.distance": "scale",
    "photographs.lens": "scale", "photographs.radii": "rods", "photographs.grains": "rods", "walls": "walls",
    "boundary": "walls", "material": "material",
}  # fmt: skip
MOSTLY = 0.8  # fraction of the rods beyond a wall above which the walls are wrong, not the rods
UNLIKE = 1.5  # ratio of the rods' radii and the known ones above which the scale is in question
FEW = 0.8  # of the rods that would fill the area of those found: fewer are reported
FEW_PHOTOGRAPHS = 4
APART = 3.0  # ratio of two successive radii above which the smaller circles may be no rods
SUBSTITUTE = 1e-4  # [m] of a pixel, and [s] between photographs, where they are missing


class Mark(StrEnum):
    GOOD = "good"
    DOUBTFUL = "doubtful"
    MISSING = "missing"


@dataclass(slots=True)
class Step:
    """One step of the set-up: its mark, and the reasons."""

    name: str
    mark: Mark = Mark.GOOD
    messages: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)  # messages about given values that are wrong

    def add_error(self, sentence: str) -> None:
        """A given value cannot be used."""
        self.add_missing(sentence)
        self.errors.append(sentence)

    def add_warning(self, sentence: str) -> None:
        self.messages.append(sentence)
        self.mark = Mark.DOUBTFUL if self.mark is Mark.GOOD else self.mark

    def add_missing(self, sentence: str) -> None:
        self.messages.append(sentence)
        self.mark = Mark.MISSING


@dataclass(slots=True)
class ValidationResult:
    """The parts of an experiment that are valid; None: missing or wrong."""

    steps: dict[str, Step]
    data: dict[str, Any]
    files: tuple[Path, ...] = ()
    shape: tuple[int, int] | None = None  # rows, columns [px]
    scale: Scale | None = None
    walls: WallTracks | None = None  # of frame 0
    rods: GrainGuess | None = None  # [px] on the first photograph
    unusable: dict[int, str] = field(default_factory=dict)  # photographs that cannot be read, with the reason
    missing: list[MissingNumbers] = field(default_factory=list)  # between their names
    all_files: tuple[Path, ...] = ()  # photographs that match, in natural order
    number: tuple[int, ...] = ()  # place in time of every photograph, in intervals
    experiment: Experiment | None = None  # with substitutes for a missing scale and missing times
    other_messages: list[str] = field(default_factory=list)  # those that concern no step

    @property
    def left_out(self) -> tuple[Path, ...]:
        """The photographs that match, but are not used."""
        used = set(self.files)
        return tuple(file for file in self.all_files if file not in used)

    @property
    def ready(self) -> bool:
        """A run can begin."""
        return not self.other_messages and all(step.mark is not Mark.MISSING for step in self.steps.values())

    @property
    def tracked(self) -> bool:
        """The tracks come from the tables of another program."""
        return "tracks" in self.data


def validate(draft: Draft) -> ValidationResult:
    """Read an experiment's files and validate every step; raise InputError where the experiment file is no TOML."""
    data = draft.data()
    found = ValidationResult({name: Step(name) for name in STEPS}, data)
    filled = _fill_in(found, data)
    for key, complaint in find_config_errors(draft.file, filled):
        step = _step_of(key)
        sentence = _without_file(draft.file, complaint)
        if step is None:
            found.other_messages.append(sentence)
        else:
            found.steps[step].add_error(sentence)
    _read_inputs(found, draft, filled)
    return found


def _fill_in(found: ValidationResult, data: dict[str, Any]) -> dict[str, Any]:
    """Substitute missing values, so that the others can be validated, and report them as missing."""
    filled = deepcopy(data)
    filled.setdefault("name", "unnamed")
    if found.tracked:
        return filled
    section = filled.setdefault("photographs", {})
    steps = found.steps
    if not isinstance(section, dict):
        return filled
    if "files" not in section:
        steps["photographs"].add_missing("No photographs are given: without them no rod can be tracked.")
        section["files"] = "*.none"
    if "interval" not in section and "times" not in section:
        steps["photographs"].add_missing("The time between photographs is missing: velocities follow from it.")
        section["interval"] = SUBSTITUTE
    if "pixel_size" not in section and "distance" not in section:
        steps["scale"].add_missing("The size of a pixel in metres is missing: walls, radii and forces need it.")
        section["pixel_size"] = SUBSTITUTE
    if not isinstance(filled.get("walls"), dict) or not filled["walls"].keys() & {"file", "arcs", "corners"}:
        if "boundary" not in data:
            steps["walls"].add_missing("No walls are given: without them grains can be tracked but not solved.")
        filled.pop("walls", None)
    if "material" not in data:
        friction = ExperimentFile.model_fields["material"].default.friction
        steps["material"].add_warning(
            f"No material is given: friction {friction:g} is assumed. Too low a friction is the largest error that "
            "this step can cause."
        )
    return filled


def _read_inputs(found: ValidationResult, draft: Draft, filled: dict[str, Any]) -> None:
    """Read the files that the valid values name."""
    usable = deepcopy(filled)
    for name in ("walls", "material"):
        if found.steps[name].mark is Mark.MISSING:
            usable.pop(name, None)
    if find_config_errors(draft.file, usable):
        return
    experiment = Experiment(draft.file, ExperimentFile.model_validate(usable), InputFiles(draft.root))
    found.experiment = experiment
    if found.tracked:
        _validate_tracks(found, experiment)
        return
    if not _validate_photographs(found, experiment):
        return
    section = experiment.config.photographs
    assert section is not None
    assert found.shape is not None
    if found.steps["scale"].mark is not Mark.MISSING:
        found.scale = make_scale(section, found.shape[0])
    rods = _call(found, "rods", lambda: read_grain_guess(experiment))
    if section.grains is None:
        found.steps["rods"].add_missing("The rods are not detected yet; a run would detect them without your check.")
        found.steps["rods"].mark = Mark.DOUBTFUL
    elif rods is not None:
        found.rods = rods
        _validate_rods(found, experiment)
    if experiment.config.walls is not None and found.scale is not None:
        found.walls = _call(found, "walls", lambda: read_walls(experiment, len(found.files)))
        _validate_walls(found, experiment)
    elif experiment.config.walls is not None:
        found.steps["walls"].add_missing("Walls are given in metres: set the scale first.")


def _validate_photographs(found: ValidationResult, experiment: Experiment) -> bool:
    step = found.steps["photographs"]
    try:
        found.files = tuple(experiment.photographs().files)
        section = experiment.config.photographs
        assert section is not None
        stat = found.files[0].stat()
        stored = _shape_of(found.files[0], stat.st_mtime_ns, stat.st_size, section.max_pixels, section.channel)
        rows, columns = stored if section.rotation in (0, 180) else stored[::-1]
        found.shape = rows, columns
        experiment.photographs().check_region(found.shape)
        found.unusable = unusable(found.files, stored)
        for k, fault in list(found.unusable.items())[:LISTED]:
            step.add_error(f"Photograph {k}, {found.files[k].name}, {fault}: leave it out, or replace the file.")
        if len(found.unusable) > LISTED:
            step.add_error(f"{len(found.unusable) - LISTED} more photographs cannot be used.")
        _validate_order(found, experiment)
        if "interval" not in found.data.get("photographs", {}) and section.times is None:
            return True
        read_times(experiment, len(found.files))
    except InputError as error:
        step.add_error(_without_file(experiment.folder, error))
        return found.shape is not None
    except OSError as error:
        step.add_missing(str(error))
        return False
    if len(found.files) < 2:
        step.add_warning("There is one photograph: forces follow from the motion of the rods between photographs.")
    elif len(found.files) < FEW_PHOTOGRAPHS:
        step.add_warning(
            f"There are {len(found.files)} photographs: friction is mobilised over several, and with so few "
            "the forces stay suspect."
        )
    return True


def _validate_order(found: ValidationResult, experiment: Experiment) -> None:
    """Compare the order of the photographs with the numbers in their names and with the camera's notes."""
    section, step = experiment.config.photographs, found.steps["photographs"]
    assert section is not None
    order = experiment.given_order()
    found.all_files = tuple(experiment.matching())
    found.number = tuple(range(len(found.files)) if order is None else order.number.tolist())
    found.missing = missing_numbers(found.files) if order is None else []
    uneven = order is not None and bool((np.diff(order.number) != 1).any())
    interval = section.interval if "interval" in found.data.get("photographs", {}) else None
    notes = compare_with_camera(found.files, section.rotation, None if uneven else interval)
    for sentence in (*name_missing([] if section.times else found.missing), *name_fractions(found.files), *notes):
        step.add_warning(sentence)


@lru_cache(maxsize=16)
def _shape_of(file: Path, _changed: int, _size: int, most: int, channel: Channel) -> tuple[int, int]:
    """Rows and columns of a photograph, which is read once as long as its file is the same."""
    return read_photograph(file, max_pixels=most, channel=channel).shape[:2]


def _validate_rods(found: ValidationResult, experiment: Experiment) -> None:
    if found.scale is None:
        return
    _validate_scale(found)
    tracks = first_tracks(found)
    try:
        check_radii(PackingSources.of(experiment), tracks)
    except InputError as error:
        found.steps["rods"].add_warning(_without_file(experiment.file, error))
    _warn_of_small(found)
    count, expected = len(tracks.id), expected_rods(tracks)
    if count < FEW * expected:
        found.steps["rods"].add_warning(
            f"About {expected} rods fill the area of those found, but {count} are found: mark the others, or try "
            "another channel, following by outline, a range of radii, or --region if circles lie on empty ground."
        )
    for sentence in describe_missed_rods(experiment, found.rods) if found.rods is not None else ():
        found.steps["rods"].add_warning(sentence)


def _warn_of_small(found: ValidationResult) -> None:
    """Warn of circles that are much smaller than all others: speckles of the paint, screws."""
    assert found.rods is not None
    assert found.scale is not None
    ordered = np.sort(found.rods.radius)
    apart = np.flatnonzero(ordered[1:] > APART * ordered[:-1])
    if len(apart):
        count = int(apart[-1]) + 1
        below, above = (1e3 * found.scale.mean_size * float(ordered[k]) for k in (count - 1, count))
        found.steps["rods"].add_warning(
            f"{count} of {len(ordered)} circles have radii up to {below:.2g} mm, the others from {above:.2g} mm: "
            "speckles of the paint, or screws? Give the known radii, and detect again."
        )


def _validate_walls(found: ValidationResult, experiment: Experiment) -> None:
    config, walls, step = experiment.config, found.walls, found.steps["walls"]
    if walls is None:
        return
    if not walls.loaded.any():
        step.add_warning("No wall has a pressure: forces are known only up to their scale.")
    unbounded = open_sides(walls.frames(0, 1), config.material.gravity) if config.boundary is None else []
    for sentence in unbounded:
        step.add_warning(sentence)
    if found.rods is None:
        return
    tracks, first = first_tracks(found), walls.frames(0, 1)
    beyond = outside_walls(found)
    if beyond:
        found.steps["rods"].add_warning(
            f"{len(beyond)} of {len(found.rods.id)} circles lie outside the walls: bolts, screws or wheels of the "
            "apparatus? Step Rods drops them with one click."
        )
    try:
        check_inside(PackingSources.of(experiment), tracks, first)
    except InputError as error:
        step.add_error(_without_file(experiment.folder, error))
        return
    for name, count in rods_cut_by_walls(tracks, first).items():
        step.add_error(f"Wall {name!r} cuts through {state_count(count, 'rod')}: move it to their rims.")
    enclosed = config.boundary is None and not unbounded
    for sentence in implausible_walls(experiment, tracks, first, enclosed=enclosed):
        step.add_warning(sentence)


def outside_walls(found: ValidationResult) -> list[int]:
    """List the rods of the first photograph beyond a wall: bolts, screws and wheels of the apparatus are round, too."""
    if found.rods is None or found.walls is None or found.scale is None:
        return []
    place = found.scale.to_world(np.stack([found.rods.x, found.rods.y], axis=1))
    distance, _ = bounding_distance(found.walls.endpoints[0], found.walls.sides, place)
    outside = np.asarray((distance < 0.0).any(axis=1))
    return found.rods.id[outside].tolist() if outside.mean() < MOSTLY else []


def _validate_scale(found: ValidationResult) -> None:
    """Compare the known radii with those of the rods as they are seen."""
    section = found.data.get("photographs", {})
    radii = section.get("radii") if isinstance(section, dict) else None
    if not radii or found.scale is None or found.rods is None or not len(found.rods.radius):
        return
    seen = float(np.median(found.rods.radius)) * found.scale.mean_size
    nearest = min(radii, key=lambda each: abs(np.log(each / seen)))
    if not 1.0 / UNLIKE < seen / nearest < UNLIKE:
        ratio = seen / float(np.median(radii))
        known = ", ".join(f"{1e3 * each:.3g}" for each in radii)
        direction = "large" if ratio > 1.0 else "small"
        found.steps["scale"].add_warning(
            f"At this scale the rods have a radius of {1e3 * seen:.3g} mm, but the known radii are {known} mm: "
            f"the scale looks {max(ratio, 1.0 / ratio):.2g} times too {direction}."
        )


def _validate_tracks(found: ValidationResult, experiment: Experiment) -> None:
    tracks = _call(found, "rods", lambda: read_tracks(experiment))
    if tracks is None:
        return
    try:
        check_radii(PackingSources.of(experiment), tracks)
        found.walls = read_walls(experiment, tracks.frame_count)
        if found.walls is not None:
            check_inside(PackingSources.of(experiment), tracks, found.walls)
    except InputError as error:
        found.steps["walls"].add_error(_without_file(experiment.folder, error))


def first_tracks(found: ValidationResult) -> Tracks:
    """Return the rods of the first photograph as tracks of one frame; the scale must be known."""
    rods, scale = found.rods, found.scale
    assert rods is not None
    assert scale is not None
    place = np.stack([rods.x, rods.y], axis=1)
    n = len(rods.id)
    return Tracks(
        rods.id, rods.radius * scale.size_at(place), np.zeros(1), scale.to_world(place)[None], np.zeros((1, n)),
        np.full((1, n), np.nan), np.full((1, n), np.nan), np.full((1, n), TrackStatus.GIVEN, np.uint8),
    )  # fmt: skip


def _call(found: ValidationResult, step: str, function: Any) -> Any:
    """Return the value of a function, or None with its error as a message of the step."""
    try:
        return function()
    except InputError as error:
        folder = found.experiment.folder if found.experiment is not None else Path()
        found.steps[step].add_error(_without_file(folder, error))
        return None


def _step_of(key: str) -> str | None:
    for length in range(key.count(".") + 1, 0, -1):
        step = OF_KEYS.get(".".join(key.split(".")[:length]))
        if step is not None:
            return step
    return None


def _without_file(file: Path, error: InputError) -> str:
    """The message without the folder of the experiment."""
    folder = file if file.is_dir() else file.parent
    return str(error).removeprefix(f"{file}: ").replace(f"{folder}/", "")
