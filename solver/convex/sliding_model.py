"""What resists sliding: coefficients of friction of grains, walls and base, and an attraction, compared by power gap.

Where bodies slide, Coulomb's law fixes friction, and forces in equilibrium exist whose power gap against the measured
sliding is small. A model that lacks what resists the motion leaves a large gap: smooth walls that are stated as rough,
a base that drags the grains, contacts that attract. Each alternative is a small change of one convex program, so all
can be compared on a few frames without solving the sequence again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

import numpy as np
from scipy import sparse

from ..bodies.grains import Array
from ..parallel import parallel_map
from .friction_estimate import SlidingFrame, power_gaps
from .grain_blocks import block_balance
from .program import Balance

# `all_friction` is that of grains, with that of walls in its given proportion.
Parameter = Literal["friction", "all_friction", "wall_friction", "base_drag", "attraction", "rolling"]
# Trial values of each parameter; a search stops where the gap rises again.
TRIALS: dict[Parameter, tuple[float, ...]] = {
    "friction": tuple(np.geomspace(0.04, 1.2, 24).tolist()),
    "all_friction": tuple(np.geomspace(0.04, 1.2, 24).tolist()),
    "wall_friction": (0.01, 0.05, 0.1, 0.15, 0.2, 0.25, 0.32, 0.4, 0.5, 0.65, 0.8, 1.0),
    "base_drag": (0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.125, 0.15, 0.2, 0.25, 0.3, 0.4),
    "attraction": (0.0, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8),
    "rolling": (0.0, 0.03, 0.06, 0.09, 0.12, 0.16, 0.2, 0.3),
}
ROUNDS = 3  # over the parameters of a model, each of which shifts the best values of the others
SAME = 0.02  # relative change of the gap below which further rounds change nothing


@dataclass(frozen=True, slots=True)
class SlidingModel:
    """What resists sliding; drag and attraction are fractions of the typical contact force."""

    friction: float
    wall_friction: float
    base_drag: float = 0.0  # on a mean grain that slides on the base
    attraction: float = 0.0  # of grains in contact
    rolling: float = 0.0  # moment of a contact over f_n and its rolling radius

    def value(self, name: Parameter) -> float:
        """The value of a parameter."""
        return float(getattr(self, "friction" if name == "all_friction" else name))

    def with_value(self, name: Parameter, value: float) -> SlidingModel:
        """The model with another value of a parameter."""
        if name != "all_friction":
            return replace(self, **{name: value})
        return replace(self, friction=value, wall_friction=self.wall_friction * value / self.friction)


@dataclass(frozen=True, slots=True)
class ResistedFrame(SlidingFrame):
    """Balance without drag, and sliding of one frame."""

    drag: Array  # (m,) load b of a unit of `base_drag`
    roll: sparse.csr_matrix  # (m, 2c) what a unit of `rolling` adds to H
    grain_count: int

    def reversed(self) -> ResistedFrame:
        """The same frame with its motion reversed."""
        return replace(self, slip=-self.slip, drag=-self.drag, roll=-self.roll)

    def balance_of(self, model: SlidingModel) -> Balance:
        """The balance under a model.

        Notes
        -----
        With an attraction a, f_n = g − a and |f_t| ≤ μ g: the program is solved for g ≥ 0, with H a added to b.
        """
        given, load = self.balance, self.balance.load
        wall = self.contacts.with_wall
        friction = np.where(wall, model.wall_friction, model.friction)
        if model.base_drag == 0.0 and model.attraction == 0.0 and model.rolling == 0.0:
            return replace(given, friction=friction)
        matrix = given.matrix if model.rolling == 0.0 else sparse.csr_matrix(given.matrix + model.rolling * self.roll)
        attraction = np.where(wall, 0.0, model.attraction * self.probability)
        load = load + model.base_drag * self.drag + matrix[:, : given.contact_count] @ attraction
        blocks = block_balance(matrix, load, self.grain_count, given.contact_count)
        return replace(given, matrix=matrix, load=load, grains=blocks, friction=friction)

    def under(self, model: SlidingModel) -> SlidingFrame:
        """The sliding with the balance under a model."""
        return SlidingFrame(self.balance_of(model), self.contacts, self.slip, self.probability)


@dataclass(frozen=True, slots=True)
class FittedModel:
    """A model with the least power gap."""

    model: SlidingModel
    gap: float  # mean relative power gap over the frames; NaN where nothing slides
    enclosed: bool  # False: a parameter ended at the edge of its trials, so that it is not determined


@dataclass(slots=True)
class _Search:
    frames: Sequence[ResistedFrame]
    known: dict[SlidingModel, float] = field(default_factory=dict)

    def gap(self, model: SlidingModel) -> float:
        if model not in self.known:
            self.known[model] = power_gap(self.frames, model)
        return self.known[model]


def power_gap(frames: Sequence[ResistedFrame], model: SlidingModel) -> float:
    """Mean relative power gap of the forces of least gap under a model; NaN where nothing slides."""
    if not frames:
        return np.nan
    return float(np.mean(power_gaps(each.under(model) for each in frames)))


def fit_model(frames: Sequence[ResistedFrame], start: SlidingModel, free: Sequence[Parameter]) -> FittedModel:
    """Find the model of least power gap.

    Parameters
    ----------
    frames : sequence of ResistedFrame
        Consecutive frames.
    start : SlidingModel
        Values of all parameters; those that are not free stay.
    free : sequence of Parameter
        Parameters that are varied, one after the other, each until the gap rises on both sides.

    Returns
    -------
    FittedModel
    """
    search, model, enclosed = _Search(frames), start, True
    before = search.gap(model)
    if not np.isfinite(before):
        return FittedModel(model, before, False)
    for _ in range(ROUNDS):
        enclosed = True
        for name in free:
            value, inside = _least(search, model, name)
            model, enclosed = model.with_value(name, value), enclosed and inside
        if not search.gap(model) < (1.0 - SAME) * before:
            break
        before = search.gap(model)
    return FittedModel(model, search.gap(model), enclosed)


def compare_models(
    frames: Sequence[ResistedFrame], start: SlidingModel, rivals: Sequence[Sequence[Parameter]], workers: int | None = 1
) -> list[FittedModel]:
    """Fit one model for each set of free parameters, in threads."""
    return parallel_map([partial(fit_model, frames, start, free) for free in rivals], workers)


def _least(search: _Search, model: SlidingModel, name: Parameter) -> tuple[float, bool]:
    """Value of least gap of one parameter, and whether it lies inside its trials; zero is an end that nature has."""
    value = model.value(name)
    trial = np.unique([*TRIALS[name], value])

    def gap(q: int) -> float:
        return search.gap(model.with_value(name, float(trial[q])))

    q = int(np.searchsorted(trial, value))
    while True:
        near = [p for p in (q - 1, q, q + 1) if 0 <= p < len(trial)]
        best = min(near, key=gap)
        if best == q:
            break
        q = best
    if q == len(trial) - 1 or (q == 0 and name in ("friction", "all_friction")):
        return float(trial[q]), False
    if q == 0:
        return float(trial[0]), True
    x, y = trial[q - 1 : q + 2], np.array([gap(p) for p in (q - 1, q, q + 1)])
    curve = np.polynomial.Polynomial.fit(x, y, 2)
    if not curve.convert().coef[-1] > 0.0:
        return float(x[1]), True
    top = float(np.clip(curve.deriv().roots()[0].real, x[0], x[2]))
    return (top if search.gap(model.with_value(name, top)) < y[1] else float(x[1])), True
