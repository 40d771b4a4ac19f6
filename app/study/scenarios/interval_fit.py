"""Fit of the constants of force intervals: quantile regression with penalties on the coverage of groups and scenarios.

Quantiles alone fit the interval of every contact, but errors with heavy tails have more values within one standard
deviation than a normal law where two cover 95 %. Therefore the loss also contains the coverage errors of both in every
group and scenario.
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

from ...process.progress import Progress, no_progress
from ...solver.assessment.intervals.force_intervals import (
    TYPICAL,
    EvidenceSource,
    Group,
    Term,
)
from ...solver.bodies.grains import Array
from ...solver.dem.dem_truth import UnbalancedError
from ...synthetic.scenarios.preset_names import ScenarioName
from ..fitting.coverage import COVERED
from .contact_errors import ContactErrors, measure_errors
from .interval_coverage import FIRSTS, FIT_SCENARIOS, GROUPS, TOLERANCE
from .scenario_score import StudyPlan
from .solved_scenario import solve_one

TERMS = {  # fitted for each evidence source; the data do not determine the others
    EvidenceSource.MOTION: (Term.PENALTY, Term.SIZE),
    EvidenceSource.BOTH: (Term.PENALTY, Term.CHANGE),
    EvidenceSource.FIRST: (Term.FRICTION,),
    EvidenceSource.SOFT: (Term.PENALTY,),
    EvidenceSource.SOFT_FIRST: (),
}
SIZES = (0.5, 1.0, 2.0)  # of the packings, over the plan's, to determine the effect of size
WEIGHTS = (1.0, 3.0)  # of the two quantiles; the second is rarely exceeded
COVERAGE_WEIGHT = 3.0  # of a coverage error equal to its tolerance, in the mean of all cells
POOLED = 6.0  # weight of a group over all scenarios, in cells
MIN_CONTACTS = 60  # of a cell
SMOOTHING = (0.05, 0.06)  # widths that make the quantile loss and the interval edges differentiable
RIDGE = (1e-3, 0.03)  # of all coefficients, and of the powers of the standard deviation, which are extrapolated
MIN_ERROR = 1e-9  # over the mean f_n, to take logarithms


@dataclass(frozen=True, slots=True)
class IntervalFit:
    """The constants of `solver.assessment.intervals.force_intervals`."""

    factor: Array  # (evidence source, group, 2)
    slope: Array  # (evidence source, term, 2)
    power: Array  # (evidence source, 2)

    def interval_sd(self, errors: ContactErrors) -> Array:
        """Return the standard deviations (c, 2) over the mean f_n by these constants."""
        evidence_source = errors.evidence_source
        of_frame = np.exp(np.einsum("ct,ctk->ck", errors.terms, self.slope[evidence_source]))
        size = (errors.formula_sd / TYPICAL) ** (1.0 + self.power[evidence_source])
        return TYPICAL * self.factor[evidence_source, errors.group] * of_frame * size


def errors_of_fit(plan: StudyPlan, seeds: Sequence[int], progress: Progress = no_progress) -> ContactErrors:
    """Compute errors on the scenarios of the fit, of SIZES times the plan's grains; skip unbalanced packings."""
    found = []
    cases: list[tuple[float, ScenarioName, int]] = [
        (size, scenario, seed) for size in SIZES for scenario in FIT_SCENARIOS for seed in seeds
    ]
    for done, (size, scenario, seed) in enumerate(cases):
        progress("scenarios", done, len(cases))
        with suppress(UnbalancedError):
            found.append(measure_errors(solve_one(replace(plan, grains=round(size * plan.grains)), scenario, seed)))
    return ContactErrors.joined(found)


def fit_intervals(errors: ContactErrors) -> IntervalFit:
    """Fit ln |error| on group, evidence source, terms and size, with equal weight of every scenario."""
    weight = np.zeros(len(errors.group))
    for scenario in np.unique(errors.scenario):
        here = errors.scenario == scenario
        weight[here] = 1.0 / here.sum()
    weight /= weight.sum()
    cells = _cells(errors)
    groups, evidence_sources, terms = len(Group), len(EvidenceSource), len(Term)
    found = np.zeros((2, evidence_sources, groups + terms + 1))
    for c in range(2):
        size = np.log(np.maximum(np.abs(errors.error[:, c]), MIN_ERROR) / errors.formula_sd[:, c])
        found[c].flat = _fit_quantiles(_columns(errors, c), size, weight, *cells)
    factor = np.exp(found[:, :, :groups]).transpose(1, 2, 0)
    slope, power = found[:, :, groups:-1].transpose(1, 2, 0), found[:, :, -1].T
    for each in FIRSTS:  # too few frames to distinguish groups
        factor[each] = factor[each, 0]
    for constants in (factor, slope, power):  # too few frames with positions only: as at the first frame
        constants[EvidenceSource.POSITIONS] = constants[EvidenceSource.FIRST]
    return IntervalFit(factor, slope, power)


def print_fit(console: Console, fit: IntervalFit) -> None:
    """Print the constants in the form of fitted.toml."""
    with np.printoptions(precision=2, suppress=True, floatmode="fixed"):
        for name, values in (("factor", fit.factor), ("slope", fit.slope), ("power", fit.power)):
            console.print(f"{name} = {np.array2string(values, separator=', ')}", highlight=False)


def _columns(errors: ContactErrors, c: int) -> csr_array:
    """Build the regression columns by evidence source: groups, fitted terms, ln of the formula's sd."""
    count, groups, terms = len(errors.group), len(Group), len(Term)
    rows, first = np.arange(count), np.isin(errors.evidence_source, FIRSTS)
    start = errors.evidence_source.astype(np.int64) * (groups + terms + 1)
    fitted = np.zeros((len(EvidenceSource), terms))
    for evidence_source, used in TERMS.items():
        fitted[evidence_source, list(used)] = 1.0
    values = [
        np.ones(count),
        *(errors.terms * fitted[errors.evidence_source]).T,
        np.log(errors.formula_sd[:, c] / TYPICAL[c]),
    ]
    places = [start + np.where(first, 0, errors.group), *(start + groups + k for k in range(terms + 1))]
    return csr_array(
        (np.concatenate(values), (np.tile(rows, terms + 2), np.concatenate(places))),
        shape=(count, len(EvidenceSource) * (groups + terms + 1)),
    )  # fmt: skip


def _cells(errors: ContactErrors) -> tuple[csr_array, Array]:
    """Build averages (k, c) over every group of every scenario and of all, and the weights (k,) of these cells."""
    chosen, weights = [], []
    for choose in GROUPS.values():
        group = choose(errors)
        parts = [(group & (errors.scenario == scenario), 1.0) for scenario in np.unique(errors.scenario)]
        for rows, counts in ((np.flatnonzero(part), counts) for part, counts in (*parts, (group, POOLED))):
            if len(rows) >= MIN_CONTACTS:
                chosen.append(rows)
                weights.append(counts)
    sizes = [len(rows) for rows in chosen]
    values = np.repeat(1.0 / np.array(sizes), sizes)
    cell = np.repeat(np.arange(len(sizes)), sizes)
    weight = np.array(weights)
    means = csr_array((values, (cell, np.concatenate(chosen))), shape=(len(sizes), len(errors.group)))
    return means, weight / weight.sum()


def _fit_quantiles(columns: csr_array, size: Array, weight: Array, cells: csr_array, counts: Array) -> Array:
    """Fit coefficients (k,) of columns (c, k) such that size − columns @ k has its quantiles at ln 1 and ln 2."""
    corner, edge = SMOOTHING
    ridge = np.tile([RIDGE[0]] * (len(Group) + len(Term)) + [RIDGE[1]], len(EvidenceSource))

    def loss(x: Array) -> tuple[float, Array]:
        residual = size - columns @ x
        value, slope = float(ridge @ x**2), 2.0 * ridge * x
        for fraction, shift, quantile, tolerance in zip(COVERED, (0.0, np.log(2.0)), WEIGHTS, TOLERANCE, strict=True):
            beyond = residual - shift
            value += quantile * float(weight @ (fraction * beyond + corner * np.logaddexp(0.0, -beyond / corner)))
            pull = quantile * weight * (fraction - expit(-beyond / corner))
            within = expit(-beyond / edge)
            error = (cells @ within - fraction) / tolerance
            value += COVERAGE_WEIGHT * float(counts @ error**2)
            pull -= 2.0 * COVERAGE_WEIGHT / (edge * tolerance) * (cells.T @ (counts * error)) * within * (1.0 - within)
            slope = slope - columns.T @ pull
        return value, slope

    return minimize(loss, np.zeros(len(ridge)), jac=True, method="L-BFGS-B", options={"maxiter": 400}).x
