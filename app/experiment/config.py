"""The experiment file: one frozen section per stage, every key with a default that works or a reason to be given."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from ..errors import InputError

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=False)


def _pixel_size(value: Any) -> Any:
    """One side or both, in one line of complaint: a union's own would name its branches."""
    sides = value if isinstance(value, list | tuple) else [value]
    numbers = all(isinstance(side, int | float) and not isinstance(side, bool) for side in sides)
    if len(sides) not in (1, 2) or not numbers or not all(0 < side < float("inf") for side in sides):
        raise ValueError(f"value {value!r}: must be a positive number [m], or [along rows, along columns]")
    return tuple(float(side) for side in sides) if isinstance(value, list | tuple) else float(value)


class LensSection(Section):
    """How the lens bends the picture: OpenCV's model, or Brown's with capital letters as p-tracker writes it."""

    fx: Positive | None = None  # [px]
    fy: Positive | None = None  # [px]; absent: fx
    cx: Finite | None = None  # [px]
    cy: Finite | None = None  # [px]
    k1: Finite = 0.0
    k2: Finite = 0.0
    p1: Finite = 0.0
    p2: Finite = 0.0
    k3: Finite = 0.0
    xc: Finite | None = None  # [px]
    yc: Finite | None = None  # [px]
    K1: Finite = 0.0  # [1/px²]
    K2: Finite = 0.0  # [1/px⁴]
    K3: Finite = 0.0  # [1/px⁶]
    P1: Finite = 0.0  # [1/px]
    P2: Finite = 0.0  # [1/px]
    P3: Finite = 0.0  # [1/px²]

    @model_validator(mode="after")
    def _one_model(self) -> LensSection:
        opencv = [key for key in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3") if getattr(self, key)]
        brown = [key for key in ("xc", "yc", "K1", "K2", "K3", "P1", "P2", "P3") if getattr(self, key)]
        if opencv and brown:
            raise ValueError(f"{opencv[0]} belongs to OpenCV's model and {brown[0]} to Brown's: give one of them")
        needed = ("xc", "yc") if brown else ("fx", "cx", "cy")
        for key in needed:
            if getattr(self, key) is None:
                raise ValueError(f"{key} is missing: OpenCV's model needs fx, cx, cy, Brown's xc, yc, all in pixels")
        return self


class KnownDistance(Section):
    """Two points of the first photograph whose distance was measured, instead of pixel_size."""

    start: tuple[Finite, Finite]  # [px] column, row
    end: tuple[Finite, Finite]  # [px]
    metres: Positive

    @model_validator(mode="after")
    def _apart(self) -> KnownDistance:
        if self.start == self.end:
            raise ValueError(f"value {list(self.start)!r}: start and end are the same point")
        return self


class Photographs(Section):
    """Where the photographs are and what a pixel is."""

    files: str  # pattern, relative to the experiment
    pixel_size: Annotated[float | tuple[float, float] | None, BeforeValidator(_pixel_size)] = None  # [m], [m, m]
    distance: KnownDistance | None = None  # instead of pixel_size
    lens: LensSection | None = None  # absent: the picture is straight
    interval: Positive | None = None  # [s] between photographs
    times: str | None = None  # table frame,time
    grains: str | None = None  # table id,x,y,radius in pixels on the first photograph
    radii: tuple[Positive, ...] = ()  # [m] known radius classes
    corrections: str | None = None  # table frame,id,x,y,theta: poses told by hand [px, px, rad], or lost

    @model_validator(mode="after")
    def _one_scale(self) -> Photographs:
        if self.pixel_size is None and self.distance is None:
            raise ValueError("pixel_size is missing: give it or distance = {start, end, metres}")
        if self.pixel_size is not None and self.distance is not None:
            raise ValueError("give either pixel_size or distance")
        return self

    @model_validator(mode="after")
    def _one_clock(self) -> Photographs:
        if (self.interval is None) == (self.times is None):
            raise ValueError("give either interval or times")
        return self


class GivenTracks(Section):
    """Tables of grains already tracked by any tool."""

    positions: str  # table frame,id,x,y,theta
    grains: str  # table id,radius
    times: str  # table frame,time
    precision: Positive = 1.0e-5  # [m] standard deviation of a position component


class Plate(Section):
    """What is known of one wall beside its position."""

    pressure: Positive | None = None  # [Pa]; absent: the measured velocity is imposed


class WallsSection(Section):
    file: str  # table frame,wall,x1,y1,x2,y2
    track: bool | None = None  # follow walls in the photographs where the table has no row; absent: where it has none
    thickness: Positive | None = None  # [m] of the bars seen beside their inner faces; absent: measured on the picture
    forces: str | None = None  # table frame,wall,fx,fy [N] of sensors: the packing's force on the wall, to compare
    plates: dict[str, Plate] = {}

    @model_validator(mode="before")
    @classmethod
    def _gather_plates(cls, data: Any) -> Any:
        """[walls.NAME] tables stand beside `file` in the experiment file."""
        if not isinstance(data, dict) or "plates" in data:
            return data
        return {
            **{key: value for key, value in data.items() if not isinstance(value, dict)},
            "plates": {key: value for key, value in data.items() if isinstance(value, dict)},
        }


class MaterialSection(Section):
    density: Positive = 2700.0  # [kg/m³]
    length: Positive = 0.06  # [m] of the rods
    friction: NotNegative = 0.25
    wall_friction: NotNegative | None = None  # absent: as friction
    formal_weight: Annotated[float, Field(ge=0, le=0.5)] = 0.0  # η
    gravity: tuple[Finite, Finite] = (0.0, 0.0)  # [m/s²]


class TrackingSection(Section):
    """Tuning of the tracker."""

    workers: Annotated[int, Field(ge=1)] = 2
    # [px] of grains looked for when radii are not known; unset: any size, from 4 px where small discs are seen
    radius_range: tuple[Positive, Positive] = (8.0, 60.0)
    search_window: Positive = 60.0  # [px] half width of the widest search for a grain that has jumped

    @model_validator(mode="after")
    def _ascending(self) -> TrackingSection:
        if not 3.0 < self.radius_range[0] < self.radius_range[1]:
            raise ValueError(f"radius_range value {list(self.radius_range)!r}: must ascend and exceed 3 px")
        return self


class CalibrationSection(Section):
    """Self-calibration of centres, radii, walls and pixel size from persistent contacts."""

    enabled: bool = True
    pixel_size: NotNegative = 5e-3  # relative standard deviation of the given scale; 0: it is exact
    lens: bool = True  # look for what is left of the lens's radial distortion
    radius_class: NotNegative = 1e-3  # relative error that the rods of a known radius may share; 0: none


class ContactsSection(Section):
    """Tuning of contact detection."""

    threshold_sigmas: Positive = 6.0  # gap threshold in standard deviations of a position
    threshold: Finite | None = None  # [m], instead of threshold_sigmas
    coordination: Positive | None = None  # change all radii alike until z without rattlers is this (the paper: near 4)
    overlap: NotNegative | None = None  # [m] typical elastic overlap and roughness; absent: 3e-4 mean diameters


class SolverSection(Section):
    """Tuning of the force solver."""

    estimator: Literal["ensemble", "nlgs"] = "ensemble"
    preset: Literal["rodsight", "paper"] = "rodsight"  # paper: inertia alone, one step per interval, reset to zero
    kappa: Positive = 0.05  # kinematic number
    substeps: Annotated[int, Field(ge=1)] = 5
    spin_up: Annotated[int, Field(ge=1)] = 10
    sweeps: Annotated[int, Field(ge=1)] = 1000  # per sub-step
    relaxation: Annotated[float, Field(gt=0, lt=2)] = 1.0
    force_change: Positive | None = None  # the paper's ε_f as a stopping level
    keep_members: bool = False  # store the field of every member of the ensemble
    precision: Literal["measured", "stated"] = "measured"  # of positions; measured: where the gaps contradict it
    ensemble_size: Annotated[int, Field(ge=0)] = 0  # sequences solved again for the error bars; 0: the free formula
    reset: Literal["never", "rearrangement"] = "never"  # go back to zero forces
    reset_frames: tuple[Annotated[int, Field(ge=0)], ...] = ()  # do so at these frames, whatever is found
    kept_frames: tuple[Annotated[int, Field(ge=0)], ...] = ()  # never do so at these


class SensitivitySection(Section):
    """Ranges of the robustness study, by factor."""

    ranges: dict[str, tuple[Finite, Finite]] = {}


class RecordingSection(Section):
    """Tuning of the recording."""

    sweeps: Literal["all", "log", "none"] = "log"  # sweeps whose forces are kept


class ExperimentFile(Section):
    name: Annotated[str, Field(pattern=r"^[\w][\w .+-]*$")]
    photographs: Photographs | None = None
    tracks: GivenTracks | None = None
    walls: WallsSection | None = None
    material: MaterialSection = MaterialSection()
    tracking: TrackingSection = TrackingSection()
    calibration: CalibrationSection = CalibrationSection()
    contacts: ContactsSection = ContactsSection()
    solver: SolverSection = SolverSection()
    recording: RecordingSection = RecordingSection()
    sensitivity: SensitivitySection = SensitivitySection()
    truth: str | None = None  # table frame,i,j,fn,ft
    truth_tracks: str | None = None  # table frame,id,x,y,theta: names grains that were detected as the truth does

    @model_validator(mode="after")
    def _one_source(self) -> ExperimentFile:
        if (self.photographs is None) == (self.tracks is None):
            raise ValueError("give either [photographs] or [tracks]")
        return self


def load_config(file: Path, settings: list[str] | tuple[str, ...] = ()) -> ExperimentFile:
    """Read an experiment file and lay KEY=VALUE settings over it; raises InputError naming file, key and value."""
    try:
        data = tomllib.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(file, "", "there is no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(file, "", f"cannot be read ({error})") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(file, "", f"is not TOML: {error}") from None
    for setting in settings:
        _lay_over(data, setting)
    try:
        return ExperimentFile.model_validate(data)
    except ValidationError as error:
        raise _explain(file, error) from None


def _lay_over(data: dict[str, Any], setting: str) -> None:
    key, equals, text = setting.partition("=")
    if not equals or not key.strip():
        raise InputError("--set", setting, "is not KEY=VALUE, such as solver.kappa=0.05")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text
    *path, last = key.strip().split(".")
    for part in path:
        data = data.setdefault(part, {})
        if not isinstance(data, dict):
            raise InputError("--set", setting, f"{part} is not a section")
    data[last] = value


def _explain(file: Path, error: ValidationError) -> InputError:
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"] if part not in ("plates",))
    if first["type"] == "extra_forbidden":
        return InputError(file, f"key {key}", f"is not known (value {first['input']!r})")
    if first["type"] == "missing":
        return InputError(file, f"key {key}", "is missing")
    if first["type"] == "value_error":
        return InputError(file, f"key {key}" if key else "", first["msg"].removeprefix("Value error, "))
    return InputError(file, f"key {key}", f"value {first['input']!r}: {first['msg']}")


def as_toml(config: ExperimentFile) -> str:
    """The resolved configuration, defaults included, as TOML that reads back to the same."""
    lines: list[str] = []
    data = config.model_dump(exclude_none=True)
    if "walls" in data:
        plates = data["walls"].pop("plates")
        data["walls"].update(plates)
    _write_section(lines, (), data)
    return "\n".join(lines).strip() + "\n"


def _write_section(lines: list[str], path: tuple[str, ...], data: dict[str, Any]) -> None:
    if path:
        lines.append(f"\n[{'.'.join(_toml_key(part) for part in path)}]")
    for key, value in data.items():
        if not isinstance(value, dict):
            lines.append(f"{_toml_key(key)} = {_toml_value(value)}")
    for key, value in data.items():
        if isinstance(value, dict):
            _write_section(lines, (*path, key), value)


def _toml_key(key: str) -> str:
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else _toml_value(key)


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml_value(item) for item in value) + "]"
    escaped = str(value).replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
