"""What else a contact may be coloured by: each quantity as colours of its own on the one entity of the contacts.

A view chooses among them by a component mapping; any other view of the contacts can be given one in the viewer, where
the source of its colours is set.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.pairs import recall
from solver.sequence.frame_forces import FrameForces

from ...look import entities
from ...look.colours import DIFFERENCE_RAMP, DOUBT_RAMP, OPEN, PROBABILITY_RAMP, packed, packed_one
from ...look.scene import Scene

LEVELS = 21  # colours of a ramp that are told apart: few of them keep the file small; odd, so that one is the middle
MOST_CHANGE = 1.0  # of the mean f_n: where the colour of a change ends
MOST_ERROR = 0.5  # … of a standard deviation

_OPEN = packed_one(OPEN)


@dataclass(frozen=True, slots=True)
class Seen:
    """What a colour may hang on: a frame's forces and those of the frame before."""

    scene: Scene
    forces: FrameForces
    former: FrameForces | None

    @property
    def nothing(self) -> Array:
        """Unknown for every contact (c,)."""
        return np.full(self.forces.contacts.count, np.nan)


@dataclass(frozen=True, slots=True)
class Colouring:
    """A quantity as a place on a ramp, 0 … 1, and what stands below the ramp."""

    place: Callable[[Seen], Array]
    ramp: NDArray[np.uint8]  # (k, 4)
    texts: Callable[[Scene], list[tuple[float, str]]]

    def colours(self, place: Array) -> NDArray[np.uint32]:
        """Colours at places (c,) on the ramp, beyond its ends those of the ends; grey where unknown."""
        levels = packed(self.ramp)[np.round(np.linspace(0, len(self.ramp) - 1, LEVELS)).astype(int)]
        level = np.round(np.clip(np.nan_to_num(place), 0.0, 1.0) * (LEVELS - 1)).astype(np.int64)
        return np.where(np.isfinite(place), levels[level], _OPEN).astype(np.uint32)


def contact_colours(scene: Scene, forces: FrameForces, former: FrameForces | None) -> list[rr.DynamicArchetype]:
    """The colours of one frame's contacts by every quantity of COLOURINGS."""
    seen = Seen(scene, forces, former)
    return [
        rr.DynamicArchetype(entities.coloured_by(name), components={
            "colors": rr.components.ColorBatch(colouring.colours(colouring.place(seen)))
        })
        for name, colouring in COLOURINGS.items()
    ]  # fmt: skip


def _most_tangential(scene: Scene) -> float:
    """f_t where its colour ends [N]: half of what friction allows the greatest f_n."""
    return 0.5 * max(scene.friction, 0.05) * scene.style.range.top


def _tangential(seen: Seen) -> Array:
    return 0.5 + 0.5 * seen.forces.ft / _most_tangential(seen.scene)


def _tangential_texts(scene: Scene) -> list[tuple[float, str]]:
    most = _most_tangential(scene)
    return [(0.0, f"−{most:.3g} N"), (0.5, "0"), (1.0, f"{most:.3g} N")]


def _sliding(seen: Seen) -> Array:
    return seen.nothing if seen.forces.sliding_probability is None else seen.forces.sliding_probability


def _bearing(seen: Seen) -> Array:
    return seen.nothing if seen.forces.bearing_probability is None else seen.forces.bearing_probability


def _touching(seen: Seen) -> Array:
    return seen.forces.probability


def _age(seen: Seen) -> Array:
    """New ones glow."""
    frames = max(seen.scene.tracks.frame_count, 2)
    return 1.0 - np.log1p(seen.forces.age) / np.log(frames)


def _age_texts(scene: Scene) -> list[tuple[float, str]]:
    frames = max(scene.tracks.frame_count, 2)
    return [(0.0, f"{frames - 1} frames"), (0.5, f"{max(round(frames**0.5) - 1, 1)}"), (1.0, "new")]


def _change(seen: Seen) -> Array:
    """f_n against the frame before, 0 for contacts that were not there."""
    forces, former = seen.forces, seen.former
    if former is None:
        return seen.nothing
    before = recall(forces.contacts.key, former.contacts.key, np.asarray(former.fn, np.float64))
    return 0.5 + 0.5 * (forces.fn - before) / (MOST_CHANGE * seen.scene.style.range.mean)


def _error(seen: Seen) -> Array:
    return seen.forces.fn_sd / (MOST_ERROR * seen.scene.style.range.mean)


def _share_texts(_: Scene) -> list[tuple[float, str]]:
    return [(0.0, "0"), (0.5, "0.5"), (1.0, "1")]


def _change_texts(scene: Scene) -> list[tuple[float, str]]:
    most = MOST_CHANGE * scene.style.range.mean
    return [(0.0, f"−{most:.3g} N"), (0.5, "0"), (1.0, f"{most:.3g} N")]


def _error_texts(scene: Scene) -> list[tuple[float, str]]:
    most = MOST_ERROR * scene.style.range.mean
    return [(0.0, "0"), (0.5, f"± {0.5 * most:.3g}"), (1.0, f"± {most:.3g} N")]


COLOURINGS: dict[str, Colouring] = dict(
    zip(
        entities.COLOURED_BY,
        (
            Colouring(_tangential, DIFFERENCE_RAMP, _tangential_texts),
            Colouring(_sliding, DOUBT_RAMP, _share_texts),
            Colouring(_bearing, PROBABILITY_RAMP, _share_texts),
            Colouring(_touching, PROBABILITY_RAMP, _share_texts),
            Colouring(_age, DOUBT_RAMP, _age_texts),
            Colouring(_change, DIFFERENCE_RAMP, _change_texts),
            Colouring(_error, DOUBT_RAMP, _error_texts),
        ),
        strict=True,
    )
)
