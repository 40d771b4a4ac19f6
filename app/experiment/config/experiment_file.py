"""The experiment file: one frozen section per stage, every key with a default that works or a reason to be given."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

import tomli_w
from pydantic import Field, ValidationError, model_validator
from pydantic_core import ErrorDetails

from ...errors import InputError
from ..reading.input_files import InputFiles
from .input_sections import BoundarySection, GivenTracks, PhotographsSection, WallsSection
from .keys import find_key, nearest_key
from .section import Section, key
from .tuning_sections import (
    CalibrationSection,
    ContactsSection,
    MaterialSection,
    RecordingSection,
    SensitivitySection,
    SolverSection,
    TrackingSection,
)
from .unused_keys import unused_keys

LONGEST = 60  # characters of a value that is quoted
S = TypeVar("S", bound="InferenceSections")


class InferenceSections(Section):
    """The sections that say how tracks become forces, wherever the tracks come from."""

    material: MaterialSection = key("What all rods have in common.", default=MaterialSection())
    calibration: CalibrationSection = key("Self-calibration from persistent contacts.", default=CalibrationSection())
    contacts: ContactsSection = key("Tuning of contact detection.", default=ContactsSection())
    solver: SolverSection = key("Tuning of the force solver.", default=SolverSection())
    recording: RecordingSection = key("Tuning of the recording.", default=RecordingSection())


class InputSections(Section):
    """The sections that say what was measured, and how photographs become tracks."""

    name: Annotated[str, Field(pattern=r"^[\w][\w .+-]*$")] = key(
        "Name of the experiment: of its results' folder, too."
    )
    photographs: PhotographsSection | None = key("Photographs to be tracked. Give these or tracks.", default=None)
    tracks: GivenTracks | None = key("Grains that any other tool has tracked. Give these or photographs.", default=None)
    walls: WallsSection | None = key(
        "The walls; without them and without a boundary grains are tracked but not solved.", default=None
    )
    boundary: BoundarySection | None = key("What bounds the packing where it is no wall.", default=None)
    tracking: TrackingSection = key("Tuning of the tracker.", default=TrackingSection())


class ExperimentFile(InferenceSections, InputSections):
    """All of an experiment."""

    sensitivity: SensitivitySection = key("Ranges of the robustness study.", default=SensitivitySection())
    truth: str | None = key("Table frame,i,j,fn,ft of true contact forces, to be compared with.", default=None)
    truth_tracks: str | None = key(
        "Table frame,id,x,y,theta that names detected grains as the truth does.", default=None
    )

    @model_validator(mode="after")
    def _one_source(self) -> ExperimentFile:
        if (self.photographs is None) == (self.tracks is None):
            raise ValueError("give either [photographs] or [tracks]")
        return self

    @model_validator(mode="after")
    def _cell_alone(self) -> ExperimentFile:
        if self.boundary is None or self.boundary.periodic is None:
            return self
        if self.walls is not None:
            raise ValueError("boundary.periodic stands instead of [walls]: give one of them")
        if any(self.material.gravity):
            raise ValueError("material.gravity: nothing carries the weight in a periodic cell")
        return self


def load_config(file: Path, settings: Sequence[str] = (), inputs: InputFiles | None = None) -> ExperimentFile:
    """Read an experiment file and lay KEY=VALUE settings over it; raises InputError naming file, key and value."""
    try:
        data = tomllib.loads((InputFiles() if inputs is None else inputs).read(file).decode("utf-8"))
    except FileNotFoundError:
        raise InputError(file, "", "there is no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(file, "", f"cannot be read ({error})") from None
    except (ValueError, RecursionError) as error:  # also a number of thousands of digits
        raise InputError(file, "", f"is not TOML: {error}") from None
    return _validated(ExperimentFile, file, data, settings)


def load_sections(settings: Sequence[str]) -> InferenceSections:
    """Defaults with KEY=VALUE settings laid over; raises InputError naming key and value."""
    return _validated(InferenceSections, "settings", {}, settings)


def find_complaints(file: Path, data: dict[str, Any]) -> list[tuple[str, InputError]]:
    """Everything that is wrong with the values of an experiment file, each with the key that it is about."""
    try:
        ExperimentFile.model_validate(data)
    except ValidationError as error:
        return [_explain_one(file, each) for each in error.errors()]
    return []


def _validated(kind: type[S], file: Path | str, data: dict[str, Any], settings: Sequence[str]) -> S:
    for setting in settings:
        _lay_over(data, setting)
    _refuse_nul(file, data, "")
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise _explain(file, error) from None


def _refuse_nul(file: Path | str, value: Any, name: str) -> None:
    """No file and no library takes a text with a NUL in it."""
    if isinstance(value, dict):
        for key, part in value.items():
            _refuse_nul(file, str(key), f"{name}.{key}".strip("."))
            _refuse_nul(file, part, f"{name}.{key}".strip("."))
    elif isinstance(value, list):
        for part in value:
            _refuse_nul(file, part, name)
    elif isinstance(value, str) and "\0" in value:
        raise InputError(file, f"key {name!r} = {value!r}", "holds a NUL character")


def _lay_over(data: dict[str, Any], setting: str) -> None:
    name, equals, text = setting.partition("=")
    if not equals or not name.strip():
        raise InputError("--set", setting, "is not KEY=VALUE, such as solver.kappa=0.05")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        value = text
    *path, last = name.strip().split(".")
    for part in path:
        data = data.setdefault(part, {})
        if not isinstance(data, dict):
            raise InputError("--set", setting, f"{part} is not a section")
    data[last] = value


def _explain(file: Path | str, error: ValidationError) -> InputError:
    return _explain_one(file, error.errors()[0])[1]


def _explain_one(file: Path | str, first: ErrorDetails) -> tuple[str, InputError]:
    """The key that a complaint is about, and the complaint."""
    name = ".".join(str(part) for part in first["loc"] if part not in ("plates",))
    where = f"key {name}" if name else ""
    if first["type"] == "extra_forbidden":
        other = nearest_key(ExperimentFile, name)
        meant = f": did you mean {other}?" if other else ""
        return name, InputError(file, where, f"is not known (value {first['input']!r}){meant}")
    if first["type"] == "missing":
        return name, InputError(file, where, f"is missing{_meaning(name)}")
    if first["type"] == "value_error":
        return name, InputError(file, where, first["msg"].removeprefix("Value error, "))
    said = first["msg"].replace("Input should be", "must be")
    return name, InputError(file, where, f"value {_shortened(first['input'])}: {said}{_range(name)}{_meaning(name)}")


def _shortened(value: Any) -> str:
    text = f"about 10^{value.bit_length() * 3 // 10}" if isinstance(value, int) and abs(value) > 10**30 else repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]} …"


def _range(name: str) -> str:
    """What may stand at a key, to be appended to a complaint."""
    found = find_key(ExperimentFile, name)
    return "" if found is None else f"; {found.name} is a {found.kind}"


def _meaning(name: str) -> str:
    """The first sentence of what a key says of itself, to be appended to a complaint."""
    found = find_key(ExperimentFile, name)
    return "" if found is None else f" ({found.summary})"


def as_toml(config: InferenceSections) -> str:
    """The resolved configuration, defaults included, as TOML that reads back to the same.

    Defaults that the chosen estimator does not use are left out: the text is an experiment file that is accepted.
    """
    data = config.model_dump(exclude_none=True)
    for name in unused_keys(config):
        section, last = name.split(".")
        if getattr(config, section).__class__.model_fields[last].default == data[section].get(last):
            data[section].pop(last, None)
    walls = data.get("walls")
    if walls is not None and not walls["plates"].keys() & WallsSection.model_fields.keys():
        walls.update(walls.pop("plates"))  # as a person writes it: [walls.NAME]
    return tomli_w.dumps(data)
