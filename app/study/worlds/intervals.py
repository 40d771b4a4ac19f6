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
from solver.sequence.judging.intervals import FACTOR, POWER, STRONG, TRUST_SLOPE, TYPICAL, WEAK, Group, Witness

from ...synthetic.worlds.names import WorldName
from .contact_errors import ContactErrors

FIT_WORLDS: tuple[WorldName, ...] = (
    "shear", "biaxial", "gravity", "isotropic", "radii_03", "step_05", "soft", "softer", "loads", "circle",
    "nearly_jammed",
)  # fmt: skip
JUDGE_WORLDS: tuple[WorldName, ...] = (
    "sheared", "step_1", "periodic", "radii_1", "centres", "unseen", "corners", "ten_frames", "mu_low", "mu_high",
)  # fmt: skip
COVERED = (0.683, 0.954)  # of one and of two standard deviations
WEIGHTS = (1.0, 2.5)  # of the two in a fit, for the second is seldom missed
SOFTNESS = 0.05  # of the corner of the quantiles' loss, so that it has a slope everywhere
RIDGE = 1e-4
COMPONENTS = ("f_n", "f_t")
GROUPS: dict[str, Callable[[ContactErrors], NDArray[np.bool_]]] = {
    "all": lambda e: np.ones(len(e.group), np.bool_),
    "weak": lambda e: e.force[:, 0] < WEAK,
    "mean": lambda e: (e.force[:, 0] >= WEAK) & (e.force[:, 0] <= STRONG),
    "strong": lambda e: e.force[:, 0] > STRONG,
    "sliding": lambda e: e.sliding,
    "wall": lambda e: e.wall,
    "doubtful": lambda e: e.doubtful,
}


@dataclass(frozen=True, slots=True)
class IntervalFit:
    """The constants of `solver.sequence.judging.intervals`."""

    factor: Array  # (witness, group, 2)
    slope: Array  # (witness, 2)
    power: Array  # (witness, 2)

    @classmethod
    def in_use(cls) -> IntervalFit:
        return cls(FACTOR, TRUST_SLOPE, POWER)

    def deviations(self, errors: ContactErrors) -> Array:
        """Deviations (c, 2) over the mean f_n that these constants give."""
        witness = errors.witness
        told = self.factor[witness, errors.group] * np.exp(self.slope[witness] * errors.doubt[:, None])
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
    found = np.zeros((2, groups * witnesses + 2 * witnesses))
    for c in range(2):
        size = np.log(np.maximum(np.abs(errors.error[:, c]), 1e-9) / errors.formula[:, c])
        found[c] = _fit_quantiles(_columns(errors, c), size, weight)
    told = groups * witnesses
    return IntervalFit(
        np.exp(found[:, :told]).reshape(2, witnesses, groups).transpose(1, 2, 0),
        found[:, told : told + witnesses].T,
        found[:, told + witnesses :].T,
    )


def print_intervals(console: Console, title: str, errors: ContactErrors) -> None:
    """Print what the stated deviations cover: of all, by group, and by world."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("contacts")
    for heading in ("number", *(f"{name} {share} %" for name in COMPONENTS for share in (68, 95))):
        table.add_column(heading, justify="right")
    rows = [*GROUPS.items()]
    rows += [(str(world), _of_world(world)) for world in np.unique(errors.world)]
    for name, choose in rows:
        part = errors.select(choose(errors))
        if len(part.group):
            table.add_row(name, str(len(part.group)), *(f"{100.0 * share:.0f}" for share in covered(part)))
    console.print(table)


def covered(errors: ContactErrors) -> tuple[float, ...]:
    """Share of f_n, then of f_t, within one and within two stated deviations."""
    return tuple(share for c in range(2) for share in coverage(errors.error[:, c], errors.deviation[:, c]))


def print_fit(console: Console, fit: IntervalFit) -> None:
    """Print constants as `solver.sequence.judging.intervals` holds them."""
    with np.printoptions(precision=2, suppress=True, floatmode="fixed"):
        for name, values in (("FACTOR", fit.factor), ("TRUST_SLOPE", fit.slope), ("POWER", fit.power)):
            console.print(f"{name} = {np.array2string(values, separator=', ')}", highlight=False)


def _of_world(world: str) -> Callable[[ContactErrors], NDArray[np.bool_]]:
    return lambda errors: errors.world == world


def _columns(errors: ContactErrors, c: int) -> Array:
    """The regression's columns: witness and group, then 1 − T and the size of the formula's deviation by witness."""
    rows, groups, witnesses = np.arange(len(errors.group)), len(Group), len(Witness)
    columns = np.zeros((len(rows), groups * witnesses + 2 * witnesses))
    columns[rows, groups * errors.witness.astype(np.int64) + errors.group] = 1.0
    columns[rows, groups * witnesses + errors.witness] = errors.doubt
    columns[rows, groups * witnesses + witnesses + errors.witness] = np.log(errors.formula[:, c] / TYPICAL[c])
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
