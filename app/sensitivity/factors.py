"""What a person cannot know exactly about an experiment, each with the range over which it is varied.

A factor turns inputs into those that somebody else might have given in good faith. Random ones draw from a generator
of their own, so that another size scales the same draw.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from .networks import VariedInputs

EVALUATED = 5  # photographs from which on forces are compared: those before still settle


class Reading(Enum):
    """How the values of a factor are to be read."""

    TIMES = "times"  # multiplies what was given; nominal 1, ranges are even on a logarithmic scale
    SHARE = "share"  # a relative error; nominal 0
    NOISE = "noise"  # times the stated standard deviation, added; nominal 0
    COUNT = "count"  # a whole number


Apply = Callable[[VariedInputs, float, np.random.Generator], VariedInputs]


@dataclass(frozen=True, slots=True)
class Factor:
    """One unknown. Varied one at a time it takes the values low and high; in a design, all between its ends."""

    name: str
    meaning: str  # for the user
    reading: Reading
    low: float
    high: float
    apply: Apply
    nominal: float
    chain_only: bool = False  # has a meaning for the single chain alone
    text: tuple[str, ...] = ()  # of the whole numbers, where each stands for something
    form: str = "{:.0f}"  # of a whole number otherwise

    @property
    def ends(self) -> tuple[float, float]:
        """Between which a design varies it: noise and whole numbers from the nominal value on."""
        one_sided = self.reading in (Reading.NOISE, Reading.COUNT) or (
            self.reading is Reading.SHARE and self.low > self.nominal
        )
        return (min(self.nominal, self.low) if one_sided else self.low), self.high

    @property
    def levels(self) -> tuple[float, ...]:
        """Values of the one-at-a-time design."""
        return tuple(value for value in dict.fromkeys((self.low, self.high)) if value != self.nominal)

    def value_at(self, part: float) -> float:
        """Value at a part (0 … 1) of the way between its ends."""
        low, high = self.ends
        if self.reading is Reading.TIMES:
            return float(low * (high / low) ** part)
        if self.reading is Reading.COUNT:
            return float(low + min(int(part * (high - low + 1)), int(high - low)))
        return float(low + (high - low) * part)

    def part_of(self, value: float) -> float:
        """Where a value lies between the ends, 0 … 1."""
        low, high = self.ends
        if low == high:
            return 0.0
        return float(
            np.log(value / low) / np.log(high / low) if self.reading is Reading.TIMES else (value - low) / (high - low)
        )

    def label(self, value: float) -> str:
        """A value as the user reads it."""
        if self.reading is Reading.TIMES:
            return f"× {value:.3g}"
        if self.reading is Reading.SHARE:
            return f"{100.0 * value:+.3g} %"
        if self.reading is Reading.NOISE:
            return f"+ {value:.3g} σ"
        return self.text[int(value)] if self.text else self.form.format(value)


def _sequence(inputs: VariedInputs, **values: Any) -> VariedInputs:
    """Inputs with other settings of the solver."""
    settings = inputs.settings
    return replace(inputs, settings=replace(settings, sequence=replace(settings.sequence, **values)))


def _friction(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    material = inputs.material  # the walls keep theirs, also where it was not given
    changed = replace(material, friction=value * material.friction, wall_friction=material.at_walls())
    return replace(inputs, material=changed)


def _friction_of_walls(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    material = inputs.material
    return replace(inputs, material=replace(material, wall_friction=value * material.at_walls()))


def _precision(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    return replace(inputs, tracks=replace(inputs.tracks, sigma=value * inputs.tracks.sigma))


def _overlap(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    usual = inputs.settings.overlap_of(inputs.tracks.radius)
    return replace(inputs, settings=replace(inputs.settings, overlap=value * usual))


def _threshold(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    given = inputs.settings.sequence
    absolute = None if given.threshold is None else value * given.threshold
    return _sequence(inputs, threshold=absolute, threshold_sigmas=value * given.threshold_sigmas)


def _position_noise(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    tracks = inputs.tracks
    added = value * inputs.noise[:, :, None] * rng.standard_normal(tracks.position.shape)
    return replace(inputs, tracks=replace(tracks, position=tracks.position + added))


def _rotation_noise(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    tracks = inputs.tracks  # a rotation is known as well as the rim's place
    added = value * inputs.noise / tracks.radius * rng.standard_normal(tracks.rotation.shape)
    return replace(inputs, tracks=replace(tracks, rotation=tracks.rotation + added))


def _radius_scatter(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    factor = 1.0 + value * rng.standard_normal(inputs.tracks.grain_count)
    return replace(inputs, tracks=replace(inputs.tracks, radius=factor * inputs.tracks.radius))


def _radius_error(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    return replace(inputs, tracks=replace(inputs.tracks, radius=(1.0 + value) * inputs.tracks.radius))


def _pixel_size(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    """Stretch the tracks about the middle of the packing; the walls and the known radii are measured otherwise."""
    position = inputs.tracks.position
    middle = np.nanmean(position, axis=(0, 1))
    return replace(inputs, tracks=replace(inputs.tracks, position=middle + (1.0 + value) * (position - middle)))


def _kappa(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    chain = inputs.settings.sequence.chain
    if chain.kappa is None:  # inertia alone
        return inputs
    return _sequence(inputs, chain=replace(chain, kappa=value * chain.kappa))


def _sweeps(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    chain = inputs.settings.sequence.chain
    return _sequence(inputs, chain=replace(chain, sweeps=max(1, round(value * chain.sweeps))))


def _reset(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    if value == 0:
        return inputs
    if value == 1:
        return _sequence(inputs, reset_to_zero=True)
    at = min(EVALUATED, len(inputs.frames) - 1)
    return _sequence(inputs, reset_frames=inputs.settings.sequence.reset_frames | {at})


def _spacing(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    return select_frames(inputs, 0, int(value))


def _first_frame(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    return select_frames(inputs, min(int(value), len(inputs.frames) - 1), 1)


def select_frames(inputs: VariedInputs, first: int, step: int) -> VariedInputs:
    """Inputs of every step-th of their photographs alone, from a first one on."""
    count = len(inputs.frames)
    place = {row: new for new, row in enumerate(range(first, count, step))}
    given = inputs.settings.sequence
    inputs = _sequence(
        inputs,
        reset_frames=frozenset(place[k] for k in given.reset_frames if k in place),
        kept_frames=frozenset(place[k] for k in given.kept_frames if k in place),
    )
    return replace(
        inputs,
        tracks=inputs.tracks.frames(first, count, step),
        walls=inputs.walls.frames(first, count, step),
        noise=inputs.noise[first::step],
        frames=inputs.frames[first::step],
        verdicts={place[k]: verdict for k, verdict in inputs.verdicts.items() if k in place},
    )


# In the order in which they are applied: those that leave out photographs come last.
FACTORS: tuple[Factor, ...] = (
    Factor("friction", "coefficient of friction between grains", Reading.TIMES, 0.8, 1.2, _friction, 1.0),
    Factor("wall_friction", "coefficient of friction at walls", Reading.TIMES, 0.8, 1.2, _friction_of_walls, 1.0),
    Factor("precision", "stated precision of positions, by which pairs are judged", Reading.TIMES, 0.5, 2.0,
           _precision, 1.0),
    Factor("overlap", "overlap or roughness of touching surfaces", Reading.TIMES, 0.5, 2.0, _overlap, 1.0),
    Factor("threshold", "gap threshold of contacts", Reading.TIMES, 0.5, 2.0, _threshold, 1.0, chain_only=True),
    Factor("position_noise", "positions scatter more than they do", Reading.NOISE, 1.0, 2.0, _position_noise, 0.0),
    Factor("rotation_noise", "rotations scatter more than they do", Reading.NOISE, 1.0, 2.0, _rotation_noise, 0.0),
    Factor("radius_scatter", "error of every radius by itself (rms)", Reading.SHARE, 5e-4, 1e-3, _radius_scatter, 0.0),
    Factor("radius_error", "common error of all radii", Reading.SHARE, -5e-4, 5e-4, _radius_error, 0.0),
    Factor("pixel_size", "pixel size, walls and radii as given", Reading.SHARE, -5e-4, 5e-4, _pixel_size, 0.0),
    Factor("kappa", "kinematic number: how much measured motion counts", Reading.TIMES, 0.5, 2.0, _kappa, 1.0),
    Factor("sweeps", "sweeps of a sub-step", Reading.TIMES, 0.5, 2.0, _sweeps, 1.0),
    Factor("reset", "go back to zero forces", Reading.COUNT, 1, 2, _reset, 0,
           text=("never", "at rearrangements", "at the first compared")),
    Factor("spacing", "use every so many photographs", Reading.COUNT, 2, 2, _spacing, 1, form="1 in {:.0f}"),
    Factor("first_frame", "begin so many photographs later", Reading.COUNT, 1, 3, _first_frame, 0, form="{:.0f} later"),
)  # fmt: skip
