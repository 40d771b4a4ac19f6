"""The experiment file: one frozen section per stage; every key has a working default or is required."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

import tomli_w
from pydantic import Field, ValidationError, model_validator
from pydantic_core import ErrorDetails

from ...process.errors import InputError, MissingFileError
from ..reading.input_files import InputFiles
from .corrections import correct_value, explain_line
from .input_sections import BoundarySection, GivenTracks, PhotographsSection, WallsSection
from .keys import Key, find_key, keys_beside, nearest_key
from .section import Section, key
from .tuning_sections import InferenceSections, SensitivitySection, TrackingSection
from .unused_keys import unused_keys

MAX_QUOTED = 60  # characters of a quoted value
LENGTHS = ("too_long", "too_short")  # errors of lists
S = TypeVar("S", bound=InferenceSections)


class InputSections(Section):
    """The sections that describe the measurement, and how photographs become tracks."""

    name: Annotated[str, Field(pattern=r"^[\w][\w .+-]*$")] = key("Name of the experiment and of its results' folder.")
    photographs: PhotographsSection | None = key("Photographs to be tracked. Give these or tracks.", default=None)
    tracks: GivenTracks | None = key("Grains tracked by any other tool. Give these or photographs.", default=None)
    walls: WallsSection | None = key(
        "The walls; without them and without a boundary grains are tracked but not solved.", default=None
    )
    boundary: BoundarySection | None = key("Boundary of the packing where it has no wall.", default=None)
    tracking: TrackingSection = key("Tuning of the tracker.", default=TrackingSection())


class ExperimentFile(InferenceSections, InputSections):
    """All sections of an experiment."""

    sensitivity: SensitivitySection = key("Ranges of the robustness study.", default=SensitivitySection())
    truth: str | None = key("Table frame,i,j,fn,ft of true contact forces, for comparison.", default=None)
    truth_tracks: str | None = key(
        "Table frame,id,x,y,theta of true poses, by which detected grains get the ids of the truth.", default=None
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
            raise ValueError("boundary.periodic is given instead of [walls]: give one of them")
        if any(self.material.gravity):
            raise ValueError("material.gravity: no boundary carries the weight in a periodic cell")
        return self


def load_config(file: Path, settings: Sequence[str] = (), inputs: InputFiles | None = None) -> ExperimentFile:
    """Read an experiment file and override it by KEY=VALUE settings. Raises InputError with file, key and value."""
    try:
        text = (InputFiles() if inputs is None else inputs).read(file, text=True).decode("utf-8")
    except FileNotFoundError:
        raise MissingFileError(file, "", "there is no such file") from None
    except UnicodeDecodeError:
        raise InputError(file, "", "is no text: name the folder of an experiment, or its experiment.toml") from None
    except OSError as error:
        raise InputError(file, "", f"cannot be read ({error})") from None
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError also for a number of thousands of digits
        raise InputError(file, "", f"is not TOML: {explain_line(text, error, _unit_of)}") from None
    return _validated(ExperimentFile, file, data, settings)


def load_sections(settings: Sequence[str]) -> InferenceSections:
    """Return the defaults overridden by KEY=VALUE settings. Raises InputError with key and value."""
    return _validated(InferenceSections, "settings", {}, settings)


def find_config_errors(file: Path, data: dict[str, Any]) -> list[tuple[str, InputError]]:
    """Return all errors in the values of an experiment file, each with its key."""
    try:
        ExperimentFile.model_validate(data)
    except ValidationError as error:
        found = {}
        for each in error.errors():  # one for each key, where several kinds of value were tried
            name, explained = _explain_one(file, each)
            found.setdefault((name, "" if name else explained.problem), (name, explained))
        return list(found.values())
    return []


def _validated(kind: type[S], file: Path | str, data: dict[str, Any], settings: Sequence[str]) -> S:
    for setting in settings:
        _override(data, setting)
    _refuse_nul(file, data, "")
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise _explain(file, error, kind) from None


def _refuse_nul(file: Path | str, value: Any, name: str) -> None:
    """Raise InputError for a text with a NUL character, which no file name and no library accepts."""
    if isinstance(value, dict):
        for key, part in value.items():
            _refuse_nul(file, str(key), f"{name}.{key}".strip("."))
            _refuse_nul(file, part, f"{name}.{key}".strip("."))
    elif isinstance(value, list):
        for part in value:
            _refuse_nul(file, part, name)
    elif isinstance(value, str) and "\0" in value:
        raise InputError(file, f"key {name!r} = {value!r}", "holds a NUL character")


def _override(data: dict[str, Any], setting: str) -> None:
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


# Parts of a place that pydantic adds: the kind of value that was tried, the free names of walls.
_INNER = ("plates", "constrained-float", "constrained-int", "float", "int", "str", "bool")


def find_wrong_values(file: Path, data: dict[str, Any], keys: Collection[str]) -> list[str]:
    """Return the errors of given values, each in words; keys: those that are judged, with all below them.

    A key that is missing is no wrong value.
    """
    try:
        ExperimentFile.model_validate(data)
    except ValidationError as error:
        found: dict[str, str] = {}
        for each in error.errors():
            name, explained = _explain_one(file, each)
            concerned = any(
                name == key or name.startswith(f"{key}.") or f"{name}.{_first_word(explained)}" == key for key in keys
            )
            if concerned and each["type"] != "missing":
                problem = explained.problem.partition(";")[0] if each["type"] != "value_error" else explained.problem
                found.setdefault(name, f"{name}: {problem}{_meaning(name)}")
        return list(found.values())
    return []


def _unit_of(name: str) -> str:
    found = find_key(ExperimentFile, name)
    return "" if found is None else found.unit


def _first_word(error: InputError) -> str:
    return error.problem.partition(" ")[0]


def _explain(file: Path | str, error: ValidationError, kind: type[Section]) -> InputError:
    errors = error.errors()
    misspelt = (each for each in errors if each["type"] == "extra_forbidden")  # why another key seems to be missing
    first = next(misspelt, errors[0])
    section = str(first["loc"][0]) if first["loc"] else ""
    if first["type"] == "extra_forbidden" and section in ExperimentFile.model_fields.keys() - kind.model_fields.keys():
        name = ".".join(map(str, first["loc"]))
        *others, last = kind.model_fields
        sections = f"{', '.join(others)} and {last}"
        return InputError(
            file, f"key {name}", f"is read from experiment.toml alone: keys of {sections} can be given here"
        )
    return _explain_one(file, first, kind)[1]


def _explain_one(file: Path | str, first: ErrorDetails, kind: type[Section] = ExperimentFile) -> tuple[str, InputError]:
    """Return the key of a validation error, and the error for the user; kind: whose keys may be meant."""
    name = ".".join(str(part) for part in first["loc"] if str(part) not in _INNER and "[" not in str(part))
    where = f"key {name}" if name else ""
    if first["type"] == "extra_forbidden":
        if name.count(".") == 1 and name.startswith("walls.") and not isinstance(first["input"], dict):
            line = correct_value("pressure", first["input"], "number", "Pa") or f"pressure = {first['input']!r}"
            wall = f"is the name of a wall: write [{name}] and, below it, {line}"
            if nearest_key(WallsSection, name.removeprefix("walls.")) is None:
                return name, InputError(file, where, wall)
        other = nearest_key(kind, name)
        value = "" if isinstance(first["input"], dict) else f" (value {first['input']!r})"
        beside = keys_beside(kind, name)
        hint = f": there are {', '.join(beside)}" if beside else ""
        hint = f": did you mean {other}?" if other else hint
        return name, InputError(file, where, f"is not known{value}{hint}")
    if first["type"] == "missing" and not isinstance(first["loc"][-1], int):
        return name, InputError(file, where, f"is missing{_meaning(name)}")
    if first["type"] == "value_error":
        known, words = find_key(ExperimentFile, name), first["msg"].removeprefix("Value error, ")
        return name, InputError(file, where, words + ("" if known is None else _correction(known, first["input"])))
    value = f"value {_shortened(first['input'])}"
    if first["type"] == "model_type":
        return name, InputError(file, where, f"{value}: is a section: write [{name}] and its keys below it")
    known = _key_of(name)
    if known is not None and (name != known.name or first["type"].endswith("_type") or first["type"] in LENGTHS):
        given = name if find_key(ExperimentFile, name.rpartition(".")[0]) is None else name.rpartition(".")[0]
        own = given if given.count(".") == known.name.count(".") else known.name  # with the name of the wall
        words = f"{value}{_range(known.name, own)}{_meaning(known.name)}{_correction(known, first['input'])}"
        return name, InputError(file, f"key {own}", words)
    if first["type"] == "string_pattern_mismatch":
        words = "must begin with a letter or a digit, and hold letters, digits, spaces and . + - _ only"
        return name, InputError(file, where, f"{value}: {words}{_range(name)}{_meaning(name)}")
    expected = first["msg"].replace("Input should be", "must be").replace("a valid dictionary", "a section of keys")
    corrected = "" if known is None else _correction(known, first["input"])
    return name, InputError(file, where, f"{value}: {expected}{_range(name, name)}{_meaning(name)}{corrected}")


def _correction(known: Key, value: Any) -> str:
    """Return what to write instead of a value, to append to an error; empty: it cannot be guessed."""
    line = correct_value(known.name.rpartition(".")[2], value, known.kind, known.unit)
    return "" if line is None else f": write {line}"


def _key_of(name: str) -> Key | None:
    """Return the key that a name denotes, perhaps followed by an index, or by one of its kinds of values."""
    return find_key(ExperimentFile, name) or find_key(ExperimentFile, name.rpartition(".")[0])


def _shortened(value: Any) -> str:
    text = f"about 10^{value.bit_length() * 3 // 10}" if isinstance(value, int) and abs(value) > 10**30 else repr(value)
    return text if len(text) <= MAX_QUOTED else f"{text[:MAX_QUOTED]} …"


def _range(name: str, own: str = "") -> str:
    """Return the allowed values of a key, to append to an error; own: its name with that of the wall."""
    found = find_key(ExperimentFile, name)
    return "" if found is None else f"; {own or found.name} is {_with_article(found.kind)}"


def _with_article(kind: str) -> str:
    """Return allowed values after *is*: a number; one of some words."""
    if kind.startswith("["):
        each = kind.strip("[]").partition(", whole number")[0].partition(", number")[0]
        return f"a list of {kind.count('number')}, each a {each}"
    return kind if kind.startswith('"') else f"a {kind}"


def _meaning(name: str) -> str:
    """Return the first sentence of a key's description, to append to an error."""
    found = find_key(ExperimentFile, name)
    return "" if found is None else f" ({found.summary})"


def as_toml(config: InferenceSections) -> str:
    """Return the resolved configuration with its defaults as TOML, which loads to the same configuration.

    Defaults that the chosen estimator does not use are left out, so that the text is a valid experiment file.
    """
    data = config.model_dump(exclude_none=True)
    for name in unused_keys(config):
        section, last = name.split(".")
        if getattr(config, section).__class__.model_fields[last].default == data[section].get(last):
            data[section].pop(last, None)
    walls = data.get("walls")
    if walls is not None and not walls["plates"].keys() & WallsSection.model_fields.keys():
        walls.update(walls.pop("plates"))  # in the form of an experiment file: [walls.NAME]
    return tomli_w.dumps(data)
