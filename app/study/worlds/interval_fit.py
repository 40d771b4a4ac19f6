"""The constants of intervals fitted anew: quantiles of the errors, held to their coverage group by group and by world.

The quantiles alone bring every contact's interval to its place, but errors with heavy tails have more within one
deviation than a normal law where two cover 95 %. So that neither share is far from what is stated, in no group and no
world, what both miss in each counts, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from rich.console import Console
from scipy.optimize import minimize
from scipy.sparse import csr_array
from scipy.special import expit

from solver.bodies.grains import Array
from solver.dem.truth import UnbalancedError
from solver.sequence.judging.intervals import FACTOR, POWER, SLOPE, TYPICAL, Group, Term, Witness

from ...progress import Progress, silent
from ...synthetic.worlds.names import WorldName
from .contact_errors import ContactErrors, measure_errors
from .intervals import COVERED, FIRSTS, FIT_WORLDS, GROUPS, TOLERANCE
from .solved_world import solve_one
from .world_score import WorldPlan

ASKED = {  # terms by witness; of all others truths told too little
    Witness.MOTION: (Term.DOUBT, Term.SIZE),
    Witness.BOTH: (Term.DOUBT, Term.CHANGE),
    Witness.FIRST: (Term.FRICTION,),
    Witness.SOFT: (Term.DOUBT,),
    Witness.SOFT_FIRST: (),
}
SIZES = (0.5, 1.0, 2.0)  # of the packings of a study, so that what their size does can be told
WEIGHTS = (1.0, 3.0)  # of the two quantiles, for the second is seldom missed
HELD = 3.0  # weight of a coverage that is off by its tolerance, in the mean of all cells
POOLED = 6.0  # cells that a group of all worlds together counts as
FEWEST = 60  # contacts of a cell
SOFTNESS = (0.05, 0.06)  # of the corner of the quantiles' loss, of the edge of an interval: so that they have slopes
RIDGE = (1e-3, 0.03)  # of all coefficients, and of the powers of a deviation, which are used beyond what was fitted
NOTHING = 1e-9  # of the mean f_n: an error that is none


@dataclass(frozen=True, slots=True)
class IntervalFit:
    """The constants of `solver.sequence.judging.intervals`."""

    factor: Array  # (witness, group, 2)
    slope: Array  # (witness, term, 2)
    power: Array  # (witness, 2)

    @classmethod
    def in_use(cls) -> IntervalFit:
        return cls(FACTOR, SLOPE, POWER)

    def deviations(self, errors: ContactErrors) -> Array:
        """Deviations (c, 2) over the mean f_n that these constants give."""
        witness = errors.witness
        of_frame = np.exp(np.einsum("ct,ctk->ck", errors.terms, self.slope[witness]))
        size = (errors.formula / TYPICAL) ** (1.0 + self.power[witness])
        return TYPICAL * self.factor[witness, errors.group] * of_frame * size


def errors_of_fit(plan: WorldPlan, seeds: Sequence[int], progress: Progress = silent) -> ContactErrors:
    """Errors on the worlds of the fit, of SIZES times the plan's grains; packings that do not rest are passed over."""
    found = []
    cases: list[tuple[float, WorldName, int]] = [
        (size, world, seed) for size in SIZES for world in FIT_WORLDS for seed in seeds
    ]
    for done, (size, world, seed) in enumerate(cases):
        progress("worlds", done, len(cases))
        with suppress(UnbalancedError):
            found.append(measure_errors(solve_one(replace(plan, grains=round(size * plan.grains)), world, seed)))
    return ContactErrors.joined(found)


def fit_intervals(errors: ContactErrors) -> IntervalFit:
    """Fit the logarithm of |error| on group, witness, terms and size; worlds count alike."""
    weight = np.zeros(len(errors.group))
    for world in np.unique(errors.world):
        here = errors.world == world
        weight[here] = 1.0 / here.sum()
    weight /= weight.sum()
    cells = _cells(errors)
    groups, witnesses, terms = len(Group), len(Witness), len(Term)
    found = np.zeros((2, witnesses, groups + terms + 1))
    for c in range(2):
        size = np.log(np.maximum(np.abs(errors.error[:, c]), NOTHING) / errors.formula[:, c])
        found[c].flat = _fit_quantiles(_columns(errors, c), size, weight, *cells)
    factor = np.exp(found[:, :, :groups]).transpose(1, 2, 0)
    slope, power = found[:, :, groups:-1].transpose(1, 2, 0), found[:, :, -1].T
    for each in FIRSTS:  # too few frames to tell groups apart
        factor[each] = factor[each, 0]
    for constants in (factor, slope, power):  # positions hardly ever speak alone: as of the first frame
        constants[Witness.POSITIONS] = constants[Witness.FIRST]
    return IntervalFit(factor, slope, power)


def print_fit(console: Console, fit: IntervalFit) -> None:
    """Print constants as `solver.sequence.judging.intervals` holds them."""
    with np.printoptions(precision=2, suppress=True, floatmode="fixed"):
        for name, values in (("FACTOR", fit.factor), ("SLOPE", fit.slope), ("POWER", fit.power)):
            console.print(f"{name} = {np.array2string(values, separator=', ')}", highlight=False)


def _columns(errors: ContactErrors, c: int) -> csr_array:
    """The regression's columns by witness: groups, terms that are asked, ln of the formula's deviation."""
    count, groups, terms = len(errors.group), len(Group), len(Term)
    rows, first = np.arange(count), np.isin(errors.witness, FIRSTS)
    start = errors.witness.astype(np.int64) * (groups + terms + 1)
    asked = np.zeros((len(Witness), terms))
    for witness, told in ASKED.items():
        asked[witness, list(told)] = 1.0
    values = [np.ones(count), *(errors.terms * asked[errors.witness]).T, np.log(errors.formula[:, c] / TYPICAL[c])]
    places = [start + np.where(first, 0, errors.group), *(start + groups + k for k in range(terms + 1))]
    return csr_array(
        (np.concatenate(values), (np.tile(rows, terms + 2), np.concatenate(places))),
        shape=(count, len(Witness) * (groups + terms + 1)),
    )  # fmt: skip


def _cells(errors: ContactErrors) -> tuple[csr_array, Array]:
    """Means (k, c) over every group of every world and of all worlds together, and the weights (k,) of these cells."""
    chosen, weights = [], []
    for choose in GROUPS.values():
        group = choose(errors)
        parts = [(group & (errors.world == world), 1.0) for world in np.unique(errors.world)]
        for rows, counts in ((np.flatnonzero(part), counts) for part, counts in (*parts, (group, POOLED))):
            if len(rows) >= FEWEST:
                chosen.append(rows)
                weights.append(counts)
    sizes = [len(rows) for rows in chosen]
    values = np.repeat(1.0 / np.array(sizes), sizes)
    cell = np.repeat(np.arange(len(sizes)), sizes)
    weight = np.array(weights)
    means = csr_array((values, (cell, np.concatenate(chosen))), shape=(len(sizes), len(errors.group)))
    return means, weight / weight.sum()


def _fit_quantiles(columns: csr_array, size: Array, weight: Array, cells: csr_array, counts: Array) -> Array:
    """Coefficients (k,) of columns (c, k) such that size − columns @ k has its quantiles at ln 1 and ln 2."""
    corner, edge = SOFTNESS
    ridge = np.tile([RIDGE[0]] * (len(Group) + len(Term)) + [RIDGE[1]], len(Witness))

    def loss(x: Array) -> tuple[float, Array]:
        rest = size - columns @ x
        value, slope = float(ridge @ x**2), 2.0 * ridge * x
        for share, shift, quantile, tolerance in zip(COVERED, (0.0, np.log(2.0)), WEIGHTS, TOLERANCE, strict=True):
            beyond = rest - shift
            value += quantile * float(weight @ (share * beyond + corner * np.logaddexp(0.0, -beyond / corner)))
            pull = quantile * weight * (share - expit(-beyond / corner))
            within = expit(-beyond / edge)
            miss = (cells @ within - share) / tolerance
            value += HELD * float(counts @ miss**2)
            pull -= 2.0 * HELD / (edge * tolerance) * (cells.T @ (counts * miss)) * within * (1.0 - within)
            slope = slope - columns.T @ pull
        return value, slope

    return minimize(loss, np.zeros(len(ridge)), jac=True, method="L-BFGS-B", options={"maxiter": 400}).x
