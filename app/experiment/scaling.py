"""The scale and lens of an experiment's photographs, from its configuration."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..solver.calibration.calibrate import Calibration
from .config.experiment_file import PhotographsSection
from .lens import BrownLens, Lens, OpenCVLens
from .units import Scale, pixel_size_between


def make_scale(section: PhotographsSection, height: int, calibration: Calibration | None = None) -> Scale:
    """Return the scale of photographs of `height` rows [px]; calibration: correction of the given pixel size."""
    given = _given_scale(section, height)
    correction = 0.0 if calibration is None else calibration.pixel_size
    pixel_height = None if given.pixel_height is None else (1.0 + correction) * given.pixel_height
    return replace(given, pixel_size=(1.0 + correction) * given.pixel_size, pixel_height=pixel_height)


def _given_scale(section: PhotographsSection, height: int) -> Scale:
    lens = make_lens(section)
    if section.distance is not None:
        start, end = np.array(section.distance.start), np.array(section.distance.end)
        return Scale(pixel_size_between(start, end, section.distance.metres, lens), height, None, lens)
    if isinstance(section.pixel_size, tuple):
        return Scale(section.pixel_size[0], height, section.pixel_size[-1], lens)
    assert section.pixel_size is not None
    return Scale(section.pixel_size, height, None, lens)


def make_lens(section: PhotographsSection) -> Lens | None:
    """Return the lens of the photographs; None where none is given."""
    given = section.lens
    if given is None:
        return None
    if given.fx is None:
        keys = ("xc", "yc", "K1", "K2", "K3", "P1", "P2", "P3")
        return BrownLens(**_values(given, keys))
    values = _values(given, ("fx", "cx", "cy", "k1", "k2", "p1", "p2", "k3"))
    return OpenCVLens(fy=given.fx if given.fy is None else given.fy, **values)


def _values(given: Any, keys: tuple[str, ...]) -> dict[str, float]:
    return {key: float(getattr(given, key)) for key in keys}
