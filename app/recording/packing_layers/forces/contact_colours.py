"""Colours of contacts by quantities other than f_n, each a component of the entity of the contacts.

A view selects one of them by a component mapping. In the viewer, the source of the colours of any other view of the
contacts can be set to one of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ....solver.bodies.grains import Array
from ....solver.contacts.pairs import match_values
from ....solver.frame_forces import FrameForces
from ...look import entities
from ...look.colours import DIFFERENCE_RAMP, OPEN, PROBABILITY_RAMP, UNCERTAINTY_RAMP, packed, packed_one
from ...look.scene import Scene

LEVELS = 21  # distinct colours of a ramp: few keep the file small; odd, so that one is the middle
MAX_CHANGE = 1.0  # of the mean f_n: the change at the ends of the ramp
MAX_ERROR = 0.5  # of the mean f_n: the standard deviation at the end of the ramp

_OPEN = packed_one(OPEN)


@dataclass(frozen=True, slots=True)
class ColourData:
    """The data from which colours are computed: the forces of a frame and of the frame before."""

    scene: Scene
    forces: FrameForces
    previous: FrameForces | None

    @property
    def unknown(self) -> Array:
        """NaN for every contact (c,)."""
        return np.full(self.forces.contacts.count, np.nan)


@dataclass(frozen=True, slots=True)
class Colouring:
    """A quantity as a position on a ramp, 0 … 1, and the texts below the ramp."""

    position: Callable[[ColourData], Array]
    ramp: NDArray[np.uint8]  # (k, 4)
    texts: Callable[[Scene], list[tuple[float, str]]]

    def colours(self, position: Array) -> NDArray[np.uint32]:
        """Return colours at positions (c,) on the ramp, clipped to 0 … 1; grey where NaN."""
        levels = packed(self.ramp)[np.round(np.linspace(0, len(self.ramp) - 1, LEVELS)).astype(int)]
        level = np.round(np.clip(np.nan_to_num(position), 0.0, 1.0) * (LEVELS - 1)).astype(np.int64)
        return np.where(np.isfinite(position), levels[level], _OPEN).astype(np.uint32)


def contact_colours(scene: Scene, forces: FrameForces, previous: FrameForces | None) -> list[rr.DynamicArchetype]:
    """Return the colours of the contacts of one frame by every quantity of COLOURINGS."""
    data = ColourData(scene, forces, previous)
    return [
        rr.DynamicArchetype(entities.coloured_by(name), components={
            "colors": rr.components.ColorBatch(colouring.colours(colouring.position(data)))
        })
        for name, colouring in COLOURINGS.items()
    ]  # fmt: skip


def _most_tangential(scene: Scene) -> float:
    """Return |f_t| at the ends of its ramp [N]: half of the Coulomb limit of the greatest drawn f_n."""
    return 0.5 * max(scene.friction, 0.05) * scene.style.range.top


def _tangential(data: ColourData) -> Array:
    return 0.5 + 0.5 * data.forces.ft / _most_tangential(data.scene)


def _tangential_texts(scene: Scene) -> list[tuple[float, str]]:
    most = _most_tangential(scene)
    return [(0.0, f"−{most:.3g} N"), (0.5, "0"), (1.0, f"{most:.3g} N")]


def _sliding(data: ColourData) -> Array:
    return data.unknown if data.forces.sliding_probability is None else data.forces.sliding_probability


def _bearing(data: ColourData) -> Array:
    return data.unknown if data.forces.bearing_probability is None else data.forces.bearing_probability


def _touching(data: ColourData) -> Array:
    return data.forces.probability


def _age(data: ColourData) -> Array:
    """Return positions by age, new contacts at the bright end."""
    frames = max(data.scene.tracks.frame_count, 2)
    return 1.0 - np.log1p(data.forces.age) / np.log(frames)


def _age_texts(scene: Scene) -> list[tuple[float, str]]:
    frames = max(scene.tracks.frame_count, 2)
    return [(0.0, f"{frames - 1} frames"), (0.5, f"{max(round(frames**0.5) - 1, 1)}"), (1.0, "new")]


def _change(data: ColourData) -> Array:
    """Return positions by the change of f_n since the frame before, where absent contacts count as 0 N."""
    forces, previous = data.forces, data.previous
    if previous is None:
        return data.unknown
    before = match_values(forces.contacts.key, previous.contacts.key, np.asarray(previous.fn, np.float64))
    return 0.5 + 0.5 * (forces.fn - before) / (MAX_CHANGE * data.scene.style.range.mean)


def _error(data: ColourData) -> Array:
    return data.forces.fn_sd / (MAX_ERROR * data.scene.style.range.mean)


def _probability_texts(_: Scene) -> list[tuple[float, str]]:
    return [(0.0, "0"), (0.5, "0.5"), (1.0, "1")]


def _change_texts(scene: Scene) -> list[tuple[float, str]]:
    most = MAX_CHANGE * scene.style.range.mean
    return [(0.0, f"−{most:.3g} N"), (0.5, "0"), (1.0, f"{most:.3g} N")]


def _error_texts(scene: Scene) -> list[tuple[float, str]]:
    most = MAX_ERROR * scene.style.range.mean
    return [(0.0, "0"), (0.5, f"± {0.5 * most:.3g}"), (1.0, f"± {most:.3g} N")]


COLOURINGS: dict[str, Colouring] = dict(
    zip(
        entities.COLOURED_BY,
        (
            Colouring(_tangential, DIFFERENCE_RAMP, _tangential_texts),
            Colouring(_sliding, UNCERTAINTY_RAMP, _probability_texts),
            Colouring(_bearing, PROBABILITY_RAMP, _probability_texts),
            Colouring(_touching, PROBABILITY_RAMP, _probability_texts),
            Colouring(_age, UNCERTAINTY_RAMP, _age_texts),
            Colouring(_change, DIFFERENCE_RAMP, _change_texts),
            Colouring(_error, UNCERTAINTY_RAMP, _error_texts),
        ),
        strict=True,
    )
)
