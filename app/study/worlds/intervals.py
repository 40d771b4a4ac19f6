"""Intervals of contact forces against the truth: how often they cover it, by groups; their factors fitted anew.

Split conformal calibration: constants are fitted on some seeds of some worlds and judged on other seeds of other
worlds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.optimize import minimize
from scipy.special import expit

from solver.bodies.grains import Array
from solver.sequence.judging.intervals import (
    FACTOR,
    FRICTION_POWER,
    POWER,
    STRONG,
    TRUST_SLOPE,
    TYPICAL,
    WEAK,
    Group,
    Witness,
)

from ...synthetic.worlds.names import WorldName
from .contact_errors import ContactErrors

FIT_WORLDS: tuple[WorldName, ...] = (
    "shear", "biaxial", "gravity", "isotropic", "radii_03", "step_05", "soft", "softer", "loads", "circle",
    "nearly_jammed", "sheared", "soft_radii_03",
)  # fmt: skip
JUDGE_WORLDS: tuple[WorldName, ...] = (
    "step_1", "periodic", "radii_1", "centres", "unseen", "corners", "ten_frames", "mu_low", "mu_high",
)  # fmt: skip
COVERED = (0.683, 0.954)  # of one and of two standard deviations
WEIGHTS = (1.0, 7.0)  # of the two in a fit, for the second is seldom missed
SOFTNESS = 0.05  # of the corner of the quantiles' loss, so that it has a slope everywhere
RIDGE = 1e-4
COMPONENTS = ("f_n", "f_t")
FIRST = "first frame"
GROUPS: dict[str, Callable[[ContactErrors], NDArray[np.bool_]]] = {
    "all": lambda e: _later(e),
    "weak": lambda e: _later(e) & (e.force[:, 0] < WEAK),
    "mean": lambda e: _later(e) & (e.force[:, 0] >= WEAK) & (e.force[:, 0] <= STRONG),
    "strong": lambda e: _later(e) & (e.force[:, 0] > STRONG),
    "sliding": lambda e: _later(e) & e.sliding,
    "wall": lambda e: _later(e) & e.wall,
    "doubtful": lambda e: _later(e) & e.doubtful,
    FIRST: lambda e: ~_later(e),
}


@dataclass(frozen=True, slots=True)
class IntervalFit:
    """The constants of `solver.sequence.judging.intervals`."""

    factor: Array  # (witness, group, 2)
    slope: Array  # (witness, 2)
    power: Array  # (witness, 2)
    friction: Array  # (2,)

    @classmethod
    def in_use(cls) -> IntervalFit:
        return cls(FACTOR, TRUST_SLOPE, POWER, FRICTION_POWER)

    def deviations(self, errors: ContactErrors) -> Array:
        """Deviations (c, 2) over the mean f_n that these constants give."""
        witness = errors.witness
        told = self.factor[witness, errors.group] * np.exp(self.slope[witness] * errors.doubt[:, None])
        told = told * errors.friction[:, None] ** self.friction
        return TYPICAL * told * (errors.formula / TYPICAL) ** (1.0 + self.power[witness])


def coverage(error: Array, deviation: Array) -> tuple[float, float]:
    """Share of errors (c,) within one and within two deviations (c,)."""
    size = np.abs(error)
    return float(np.mean(size <= deviation)), float(np.mean(size <= 2.0 * deviation))


def fit_intervals(errors: ContactErrors) -> IntervalFit:
    """Quantile regression of the logarithm of |error| on group, witness, trust and size; worlds count alike."""
    weight = np.zeros(len(errors.group))
    for world in np.unique(errors.world):
        here = errors.world == world
        weight[here] = 1.0 / here.sum()
    groups, witnesses = len(Group), len(Witness)
    found = np.zeros((2, groups * witnesses + 2 * witnesses + 1))
    for c in range(2):
        size = np.log(np.maximum(np.abs(errors.error[:, c]), 1e-9) / errors.formula[:, c])
        found[c] = _fit_quantiles(_columns(errors, c), size, weight)
    told = groups * witnesses
    factor = np.exp(found[:, :told]).reshape(2, witnesses, groups).transpose(1, 2, 0)
    factor[Witness.FIRST] = factor[Witness.FIRST, 0]
    slope, power = (found[:, told + k * witnesses : told + (k + 1) * witnesses].T for k in range(2))
    return IntervalFit(factor, slope, power, found[:, -1])


def interval_score(error: Array, deviation: Array) -> float:
    """Mean width of intervals of ± two deviations (c,) [mean f_n], and 2/.05 of what errors (c,) lie beyond them.

    Least for the narrowest intervals that cover 95 %: T. Gneiting and A. E. Raftery (2007), equation 43.
    """
    return float(np.mean(4.0 * deviation + 40.0 * np.maximum(np.abs(error) - 2.0 * deviation, 0.0)))


def print_intervals(console: Console, title: str, errors: ContactErrors) -> None:
    """Print what the stated deviations cover: of all frames but the first by group and by world, and of the first.

    Beside it how wide they are, and their score over that of one deviation for all contacts, the best there is.
    """
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("contacts")
    shares = [f"{name} {share} %" for name in COMPONENTS for share in (68, 95)]
    beside = [f"{what} {name}" for name in COMPONENTS for what in ("mean", "score")]
    for heading in ("number", *shares, *beside):
        table.add_column(heading, justify="right")
    one = np.quantile(np.abs(errors.error[_later(errors)]), COVERED[1], axis=0) / 2.0
    rows = [*GROUPS.items()]
    rows += [(str(world), _of_world(world)) for world in np.unique(errors.world)]
    for name, choose in rows:
        part = errors.select(choose(errors))
        if len(part.group):
            told = [f"{100.0 * share:.0f}" for share in covered(part)]
            table.add_row(name, str(len(part.group)), *told, *_beside(part, one))
    console.print(table)
    console.print(
        "Mean: stated deviation over the mean f_n. Score: of intervals of two deviations, over the score with one "
        "deviation for all contacts, which covers 95 % of them; below 1 is better.", highlight=False, soft_wrap=True,
    )  # fmt: skip


def _beside(errors: ContactErrors, one: Array) -> list[str]:
    cells = []
    for c in range(2):
        error, deviation = errors.error[:, c], errors.deviation[:, c]
        score = interval_score(error, deviation) / interval_score(error, np.full(len(error), one[c]))
        cells += [f"{deviation.mean():.3f}", f"{score:.2f}"]
    return cells


def _later(errors: ContactErrors) -> NDArray[np.bool_]:
    return errors.witness != Witness.FIRST


def covered(errors: ContactErrors) -> tuple[float, ...]:
    """Share of f_n, then of f_t, within one and within two stated deviations."""
    return tuple(share for c in range(2) for share in coverage(errors.error[:, c], errors.deviation[:, c]))


def print_fit(console: Console, fit: IntervalFit) -> None:
    """Print constants as `solver.sequence.judging.intervals` holds them."""
    with np.printoptions(precision=2, suppress=True, floatmode="fixed"):
        for name, values in (
            ("FACTOR", fit.factor), ("TRUST_SLOPE", fit.slope), ("POWER", fit.power), ("FRICTION_POWER", fit.friction),
        ):  # fmt: skip
            console.print(f"{name} = {np.array2string(values, separator=', ')}", highlight=False)


def _of_world(world: str) -> Callable[[ContactErrors], NDArray[np.bool_]]:
    return lambda errors: (errors.world == world) & _later(errors)


def _columns(errors: ContactErrors, c: int) -> Array:
    """The regression's columns: witness and group, then 1 − T and size of the formula's deviation by witness, friction.

    Of first frames there is one in every world: too few to tell groups apart.
    """
    rows, groups, witnesses = np.arange(len(errors.group)), len(Group), len(Witness)
    group = np.where(errors.witness == Witness.FIRST, 0, errors.group)
    columns = np.zeros((len(rows), groups * witnesses + 2 * witnesses + 1))
    columns[rows, groups * errors.witness.astype(np.int64) + group] = 1.0
    columns[rows, groups * witnesses + errors.witness] = errors.doubt
    columns[rows, groups * witnesses + witnesses + errors.witness] = np.log(errors.formula[:, c] / TYPICAL[c])
    columns[:, -1] = np.log(errors.friction)
    return columns


def _fit_quantiles(columns: Array, size: Array, weight: Array) -> Array:
    """Coefficients (k,) of columns (c, k) such that size − columns @ k has its quantiles at ln 1 and ln 2."""

    def loss(x: Array) -> tuple[float, Array]:
        rest = size - columns @ x
        value, slope = RIDGE * float(x @ x), 2.0 * RIDGE * x
        for share, shift, counts in zip(COVERED, (0.0, np.log(2.0)), WEIGHTS, strict=True):
            beyond = rest - shift
            value += counts * float(weight @ (share * beyond + SOFTNESS * np.logaddexp(0.0, -beyond / SOFTNESS)))
            slope = slope - counts * (columns.T @ (weight * (share - expit(-beyond / SOFTNESS))))
        return value, slope

    return minimize(loss, np.zeros(columns.shape[1]), jac=True, method="L-BFGS-B").x
