"""Uncertain inputs of an experiment, each with the range over which a study varies it.

A factor replaces inputs by equally plausible ones. Each random factor draws from a generator of its own, so that
another size scales the same draw.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from .networks import VariedInputs

FIRST_COMPARED = 5  # photographs before this one are not compared: their forces are settling


class ValueKind(Enum):
    """Meaning of a factor's values."""

    MULTIPLE = "times"  # multiplies the given value; nominal 1, ranges are sampled on a logarithmic scale
    RELATIVE_ERROR = "share"  # nominal 0
    NOISE = "noise"  # added, in stated standard deviations; nominal 0
    COUNT = "count"  # a whole number


Apply = Callable[[VariedInputs, float, np.random.Generator], VariedInputs]


@dataclass(frozen=True, slots=True)
class Factor:
    """One uncertain input: low and high one at a time, every value between its ends in a space-filling design."""

    name: str
    meaning: str  # for users
    kind: ValueKind
    low: float
    high: float
    apply: Apply
    nominal: float
    chain_only: bool = False  # has an effect on the single chain alone
    value_names: tuple[str, ...] = ()  # names of the whole numbers, where they have some
    value_format: str = "{:.0f}"  # of whole numbers without names

    @property
    def ends(self) -> tuple[float, float]:
        """Range of a space-filling design: noise and whole numbers begin with the nominal value."""
        one_sided = self.kind in (ValueKind.NOISE, ValueKind.COUNT) or (
            self.kind is ValueKind.RELATIVE_ERROR and self.low > self.nominal
        )
        return (min(self.nominal, self.low) if one_sided else self.low), self.high

    @property
    def levels(self) -> tuple[float, ...]:
        """Values of the one-at-a-time design."""
        return tuple(value for value in dict.fromkeys((self.low, self.high)) if value != self.nominal)

    def from_unit(self, unit: float) -> float:
        """Map 0 … 1 to a value between the ends; the inverse of `to_unit`."""
        low, high = self.ends
        if self.kind is ValueKind.MULTIPLE:
            return float(low * (high / low) ** unit)
        if self.kind is ValueKind.COUNT:
            return float(low + min(int(unit * (high - low + 1)), int(high - low)))
        return float(low + (high - low) * unit)

    def to_unit(self, value: float) -> float:
        """Map a value between the ends to 0 … 1."""
        low, high = self.ends
        if low == high:
            return 0.0
        if self.kind is ValueKind.MULTIPLE:
            return float(np.log(value / low) / np.log(high / low))
        return float((value - low) / (high - low))

    def label(self, value: float) -> str:
        """Format a value for users."""
        if self.kind is ValueKind.MULTIPLE:
            return f"× {value:.3g}"
        if self.kind is ValueKind.RELATIVE_ERROR:
            return f"{100.0 * value:+.3g} %"
        if self.kind is ValueKind.NOISE:
            return f"+ {value:.3g} σ"
        return self.value_names[int(value)] if self.value_names else self.value_format.format(value)


def _sequence(inputs: VariedInputs, **values: Any) -> VariedInputs:
    """Replace settings of the sequence."""
    settings = inputs.settings
    return replace(inputs, settings=replace(settings, sequence=replace(settings.sequence, **values)))


def _friction(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    material = inputs.material  # the friction at walls stays, also where it is not given
    changed = replace(material, friction=value * material.friction, wall_friction=material.at_walls())
    return replace(inputs, material=changed)


def _wall_friction(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    material = inputs.material
    return replace(inputs, material=replace(material, wall_friction=value * material.at_walls()))


def _precision(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    return replace(inputs, tracks=replace(inputs.tracks, sigma=value * inputs.tracks.sigma))


def _overlap(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    nominal = inputs.settings.overlap_of(inputs.tracks.radius)
    return replace(inputs, settings=replace(inputs.settings, overlap=value * nominal))


def _threshold(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    given = inputs.settings.sequence
    absolute = None if given.threshold is None else value * given.threshold
    return _sequence(inputs, threshold=absolute, threshold_sigmas=value * given.threshold_sigmas)


def _position_noise(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    tracks = inputs.tracks
    added = value * inputs.noise[:, :, None] * rng.standard_normal(tracks.position.shape)
    return replace(inputs, tracks=replace(tracks, position=tracks.position + added))


def _rotation_noise(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    tracks = inputs.tracks  # at the rim a rotation is as exact as a position
    added = value * inputs.noise / tracks.radius * rng.standard_normal(tracks.rotation.shape)
    return replace(inputs, tracks=replace(tracks, rotation=tracks.rotation + added))


def _radius_scatter(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    factor = 1.0 + value * rng.standard_normal(inputs.tracks.grain_count)
    return replace(inputs, tracks=replace(inputs.tracks, radius=factor * inputs.tracks.radius))


def _radius_error(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    return replace(inputs, tracks=replace(inputs.tracks, radius=(1.0 + value) * inputs.tracks.radius))


def _pixel_size(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    """Scale the tracks about the centre of the packing; walls and known radii are measured otherwise."""
    position = inputs.tracks.position
    centre = np.nanmean(position, axis=(0, 1))
    return replace(inputs, tracks=replace(inputs.tracks, position=centre + (1.0 + value) * (position - centre)))


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
    at = min(FIRST_COMPARED, len(inputs.frames) - 1)
    return _sequence(inputs, reset_frames=inputs.settings.sequence.reset_frames | {at})


def _spacing(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    return select_frames(inputs, 0, int(value))


def _first_frame(inputs: VariedInputs, value: float, rng: np.random.Generator) -> VariedInputs:
    return select_frames(inputs, min(int(value), len(inputs.frames) - 1), 1)


def select_frames(inputs: VariedInputs, first: int, step: int) -> VariedInputs:
    """Keep every step-th photograph alone, from a first one on."""
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


# In the order of application: those that leave out photographs come last.
FACTORS: tuple[Factor, ...] = (
    Factor("friction", "coefficient of friction between grains", ValueKind.MULTIPLE, 0.8, 1.2, _friction, 1.0),
    Factor("wall_friction", "coefficient of friction at walls", ValueKind.MULTIPLE, 0.8, 1.2, _wall_friction, 1.0),
    Factor("precision", "stated precision of positions, which decides on pairs", ValueKind.MULTIPLE, 0.5, 2.0,
           _precision, 1.0),
    Factor("overlap", "overlap or roughness of touching surfaces", ValueKind.MULTIPLE, 0.5, 2.0, _overlap, 1.0),
    Factor("threshold", "gap threshold of contacts", ValueKind.MULTIPLE, 0.5, 2.0, _threshold, 1.0, chain_only=True),
    Factor("position_noise", "additional noise of the positions", ValueKind.NOISE, 1.0, 2.0, _position_noise, 0.0),
    Factor("rotation_noise", "additional noise of the rotations", ValueKind.NOISE, 1.0, 2.0, _rotation_noise, 0.0),
    Factor("radius_scatter", "independent error of every radius (rms)", ValueKind.RELATIVE_ERROR, 5e-4, 1e-3,
           _radius_scatter, 0.0),
    Factor("radius_error", "common error of all radii", ValueKind.RELATIVE_ERROR, -5e-4, 5e-4, _radius_error, 0.0),
    Factor("pixel_size", "pixel size, walls and radii as given", ValueKind.RELATIVE_ERROR, -5e-4, 5e-4,
           _pixel_size, 0.0),
    Factor("kappa", "kinematic number: weight of the measured motion", ValueKind.MULTIPLE, 0.5, 2.0, _kappa, 1.0),
    Factor("sweeps", "sweeps of a sub-step", ValueKind.MULTIPLE, 0.5, 2.0, _sweeps, 1.0),
    Factor("reset", "reset to zero forces", ValueKind.COUNT, 1, 2, _reset, 0,
           value_names=("never", "at rearrangements", "at the first compared photograph")),
    Factor("spacing", "spacing of the photographs", ValueKind.COUNT, 2, 2, _spacing, 1, value_format="1 in {:.0f}"),
    Factor("first_frame", "first photograph", ValueKind.COUNT, 1, 3, _first_frame, 0, value_format="{:.0f} later"),
)  # fmt: skip
