"""Runs of a study: factors varied one at a time, or all at once in a space-filling design."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from ..experiment.experiment import Experiment
from ..process.errors import InputError
from .factors import FACTORS, Factor, ValueKind
from .networks import VariedInputs

Design = Literal["oat", "sobol"]
SAMPLES = 64  # default number of runs of a space-filling design
MAX_RELATIVE_ERROR = 0.1  # larger relative errors describe another experiment


@dataclass(frozen=True, slots=True)
class Case:
    """One run: the factors varied and their values; the nominal run varies none."""

    values: tuple[tuple[str, float], ...]  # factor and value, in the order of FACTORS
    seed: int = 0  # of the random factors

    @property
    def key(self) -> str:
        """Identifies the run; the same in every study."""
        return " ".join([*(f"{name}={value!r}" for name, value in self.values), f"seed={self.seed}"])


def choose_factors(
    wanted: Sequence[str], ranges: Mapping[str, tuple[float, float]], *, file: Path, single_chain: bool
) -> tuple[Factor, ...]:
    """Choose the factors of a study, with their ranges.

    Parameters
    ----------
    wanted : sequence of str
        NAME or NAME=LOW:HIGH; empty: all factors.
    ranges : mapping of str to (float, float)
        Low and high value of factors in the experiment file.
    file : Path
        The experiment file, for messages.
    single_chain : bool
        Whether the estimator is a single chain; some factors vary it alone.

    Raises
    ------
    InputError
        A factor is unknown, or a range is invalid.
    """
    known = {each.name: each for each in FACTORS}
    for name, ends in ranges.items():
        if name not in known:
            raise InputError(file, f"key sensitivity.ranges.{name}", f"is not a factor: choose from {', '.join(known)}")
        known[name] = _with_range(known[name], *ends, str(file), f"key sensitivity.ranges.{name}")
    chosen = [name for name, each in known.items() if single_chain or not each.chain_only]
    if wanted:
        chosen = []
        for text in wanted:
            name, equals, ends = text.partition("=")
            if name not in known:
                raise InputError("--factors", text, f"is not a factor: choose from {', '.join(known)}")
            if known[name].chain_only and not single_chain:
                raise InputError("--factors", text, "has no effect on the ensemble: vary precision or overlap")
            if equals:
                known[name] = _with_range(known[name], *_ends(text, ends), "--factors", text)
            chosen.append(name)
    return tuple(known[each.name] for each in FACTORS if each.name in chosen)


def plan(
    experiment: Experiment, design: Design, wanted: Sequence[str], samples: int | None, seed: int
) -> tuple[tuple[Factor, ...], list[Case]]:
    """Plan the factors and runs of a study; samples: None for the default. Raises InputError for invalid options."""
    config = experiment.config
    if seed < 0:
        raise InputError("--seed", str(seed), "must not be negative")
    single = config.solver.estimator == "nlgs" or config.solver.preset == "paper"
    factors = choose_factors(wanted, config.sensitivity.ranges, file=experiment.file, single_chain=single)
    if design == "sobol":
        return factors, space_filling(factors, SAMPLES if samples is None else samples, seed)
    if samples is not None:
        raise InputError("--samples", str(samples), "requires --design sobol: one at a time, every level is a run")
    return factors, one_at_a_time(factors, seed)


def one_at_a_time(factors: Sequence[Factor], seed: int) -> list[Case]:
    """Vary every factor to its low and its high value, all others as given."""
    return [Case(((each.name, float(value)),), seed) for each in factors for value in each.levels]


def space_filling(factors: Sequence[Factor], samples: int, seed: int) -> list[Case]:
    """Draw a scrambled Sobol sequence over all factors. Raises InputError for too few samples to separate them."""
    least = 2 * len(factors) + 2
    if samples < least:
        raise InputError("--samples", str(samples), f"is too few for {len(factors)} factors: at least {least}")
    power = int(np.ceil(np.log2(samples)))
    from scipy.stats import qmc  # half a second of imports that no other command needs

    unit = qmc.Sobol(len(factors), rng=np.random.default_rng(seed)).random_base2(power)[:samples]
    return [
        Case(tuple((each.name, each.from_unit(part)) for each, part in zip(factors, row, strict=True)), seed)
        for row in unit.tolist()
    ]


def vary(inputs: VariedInputs, case: Case) -> VariedInputs:
    """Apply a case to the inputs."""
    values = dict(case.values)
    for number, factor in enumerate(FACTORS):
        if factor.name in values and values[factor.name] != factor.nominal:
            inputs = factor.apply(inputs, values[factor.name], np.random.default_rng([case.seed, number]))
    return inputs


def _ends(text: str, ends: str) -> tuple[float, float]:
    low, colon, high = ends.partition(":")
    try:
        if not colon:
            raise ValueError
        return float(low), float(high)
    except ValueError:
        raise InputError("--factors", text, "is not NAME=LOW:HIGH, such as friction=0.7:1.3") from None


def _with_range(factor: Factor, low: float, high: float, source: str, where: str) -> Factor:
    """Replace the range of a factor; source and where: of the range, for messages. Raises InputError."""
    problem = ""
    if not (np.isfinite(low) and np.isfinite(high) and low <= high):
        problem = "must be two finite numbers in ascending order"
    elif factor.kind is ValueKind.MULTIPLE and not low > 0:
        problem = "multiplies the given value: it must be positive"
    elif factor.kind is ValueKind.NOISE and low < 0:
        problem = "is in standard deviations: it must not be negative"
    elif factor.kind is ValueKind.RELATIVE_ERROR and not max(abs(low), abs(high)) <= MAX_RELATIVE_ERROR:
        problem = f"is a relative error: it must be within ±{MAX_RELATIVE_ERROR}"
    elif factor.kind is ValueKind.COUNT:
        most = len(factor.value_names) - 1 if factor.value_names else np.inf
        if not (low == int(low) and high == int(high) and factor.nominal <= low and high <= most):
            upper = f" to {most}" if factor.value_names else " on"
            problem = f"must be whole numbers from {factor.nominal:.0f}{upper}"
    if not problem and low == high == factor.nominal:
        problem = "is the nominal value alone: the factor would not vary"
    if problem:
        raise InputError(source, where, f"value {low:g}:{high:g} {problem}")
    return replace(factor, low=float(low), high=float(high))
