"""The picture over which a run is drawn: its size, and the scale with which the run was made."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from ...experiment.config.experiment_file import PhotographsSection
from ...experiment.scaling import make_scale
from ...experiment.units import Scale
from ...process.errors import InputError
from ...recording.look.canvas import Canvas
from ...results.manifest import Manifest
from ...run_folder import RESULTS
from ..setup.validation import ValidationResult
from .run_data import RunData


class Scene(NamedTuple):
    """The picture over which a run is drawn: the photograph, or a plain ground where there is none."""

    scale: Scale
    bounds: tuple[float, float, float, float]  # [px] left, top, right, bottom


def run_scene(found: ValidationResult, results: Path, data: RunData | None) -> Scene:
    """Return scale and size of the picture over which a run is drawn; raise InputError where there is none.

    The scale contains the run's calibration of the lens. Where tracks are given the ground is plain.
    """
    if found.shape is not None and not found.tracked:
        stored = Manifest(results).piece(RESULTS) if data is not None and data.results is not None else None
        _refuse_another_order(found, results, stored)
        height, width = found.shape
        calibration = data.results.calibration if data is not None and data.results is not None else None
        scale = make_scale(_section_of(found, results, data), height, calibration)
        return Scene(scale, (-0.5, -0.5, width - 0.5, height - 0.5))
    if not found.tracked or data is None:
        raise InputError(results, "photographs", "are not there: forces cannot be drawn over them")
    canvas = Canvas.around(data.tracks, None)
    bounds = (canvas.left - 0.5, canvas.top - 0.5, canvas.right - 0.5, canvas.bottom - 0.5)
    return Scene(canvas.scale, bounds)


def tracks_scale(found: ValidationResult, results: Path) -> Scale:
    """Return the scale with which the tracks in a run's folder were made; raise InputError where there is none."""
    if found.shape is None:
        raise InputError(results, "photographs", "are not there")
    _refuse_another_order(found, results, None)
    return make_scale(_section_of(found, results, None), found.shape[0])


def _refuse_another_order(found: ValidationResult, results: Path, piece: dict[str, Any] | None) -> None:
    """Raise InputError where the run numbers other photographs: its forces would be drawn over the wrong ones.

    piece: what is stored beside the results; None: the tracks alone are shown.
    """
    stored = Manifest(results).fact("photographs") if piece is None else piece.get("photographs")
    now = [] if found.experiment is None else found.experiment.photograph_names()
    if isinstance(stored, list) and now and stored != now[: len(stored)]:
        changed = next((k for k, (a, b) in enumerate(zip(stored, now, strict=False)) if a != b), len(now))
        raise InputError(
            results, f"photograph {changed}", "is another one than in this run, since the order or the number of the "
            "photographs has changed: run again, or undo the change",
        )  # fmt: skip


def _section_of(found: ValidationResult, results: Path, data: RunData | None) -> PhotographsSection:
    """The settings of the photographs of a run, which may differ from those of the experiment by now."""
    stored = Manifest(results).fact("settings") if data is None or data.results is None else data.results.configuration
    try:
        return PhotographsSection.model_validate(tomllib.loads(stored or "").get("photographs"))
    except (tomllib.TOMLDecodeError, ValidationError, TypeError):  # of an earlier version, or not stored
        section = None if found.experiment is None else found.experiment.config.photographs
        if section is None or found.scale is None:
            raise InputError("key photographs.pixel_size", "", "is missing: set the scale first") from None
        return section
