"""Which runs a study makes: factors one at a time, or all at once in a space-filling design."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from ..errors import InputError
from ..experiment.experiment import Experiment
from .factors import FACTORS, Factor, Reading
from .networks import VariedInputs

Design = Literal["oat", "sobol"]
SAMPLES = 64  # runs of a space-filling design, unless told otherwise
LARGEST_SHARE = 0.1  # relative errors beyond this are no longer errors but another experiment


@dataclass(frozen=True, slots=True)
class Case:
    """One run: what is varied, and to what. Nothing varied is the nominal run."""

    values: tuple[tuple[str, float], ...]  # factor and value, in the order of FACTORS
    seed: int = 0  # of the factors that draw

    @property
    def key(self) -> str:
        """The same for the same run, in any study."""
        return " ".join([*(f"{name}={value!r}" for name, value in self.values), f"seed={self.seed}"])


def choose_factors(
    wanted: Sequence[str], ranges: Mapping[str, tuple[float, float]], *, file: Path, single_chain: bool
) -> tuple[Factor, ...]:
    """The factors of a study, with their ranges.

    wanted: NAME or NAME=LOW:HIGH, none for all; ranges: those of the experiment file `file`. Raises InputError for
    a factor that is not known or a range that makes no sense.
    """
    known = {each.name: each for each in FACTORS}
    for name, ends in ranges.items():
        if name not in known:
            raise InputError(file, f"key sensitivity.ranges.{name}", f"is no factor; there are {', '.join(known)}")
        known[name] = _ranged(known[name], *ends, str(file), f"key sensitivity.ranges.{name}")
    chosen = [name for name, each in known.items() if single_chain or not each.chain_only]
    if wanted:
        chosen = []
        for text in wanted:
            name, equals, ends = text.partition("=")
            if name not in known:
                raise InputError("--factors", text, f"is no factor; there are {', '.join(known)}")
            if known[name].chain_only and not single_chain:
                raise InputError("--factors", text, "has no effect on the ensemble: precision and overlap have")
            if equals:
                known[name] = _ranged(known[name], *_ends(text, ends), "--factors", text)
            chosen.append(name)
    return tuple(known[each.name] for each in FACTORS if each.name in chosen)


def plan(
    experiment: Experiment, design: Design, wanted: Sequence[str], samples: int | None, seed: int
) -> tuple[tuple[Factor, ...], list[Case]]:
    """The factors and the runs of a study. Raises InputError where they make no sense."""
    config = experiment.config
    if seed < 0:
        raise InputError("--seed", str(seed), "must not be negative")
    single = config.solver.estimator == "nlgs" or config.solver.preset == "paper"
    factors = choose_factors(wanted, config.sensitivity.ranges, file=experiment.file, single_chain=single)
    if design == "sobol":
        return factors, space_filling(factors, SAMPLES if samples is None else samples, seed)
    if samples is not None:
        raise InputError("--samples", str(samples), "belongs to --design sobol: one at a time the levels are the runs")
    return factors, one_at_a_time(factors, seed)


def one_at_a_time(factors: Sequence[Factor], seed: int) -> list[Case]:
    """Every factor at its low and its high value, all others as given."""
    return [Case(((each.name, float(value)),), seed) for each in factors for value in each.levels]


def space_filling(factors: Sequence[Factor], samples: int, seed: int) -> list[Case]:
    """A scrambled Sobol sequence over all factors at once. Raises InputError for too few samples to tell them apart."""
    least = 2 * len(factors) + 2
    if samples < least:
        raise InputError("--samples", str(samples), f"is too few for {len(factors)} factors: at least {least}")
    power = int(np.ceil(np.log2(samples)))
    from scipy.stats import qmc  # half a second of imports that no other command needs

    unit = qmc.Sobol(len(factors), rng=np.random.default_rng(seed)).random_base2(power)[:samples]
    return [
        Case(tuple((each.name, each.value_at(part)) for each, part in zip(factors, row, strict=True)), seed)
        for row in unit.tolist()
    ]


def vary(inputs: VariedInputs, case: Case) -> VariedInputs:
    """Inputs with everything that a case changes changed."""
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


def _ranged(factor: Factor, low: float, high: float, source: str, where: str) -> Factor:
    """The factor with another range, if that makes sense."""
    problem = ""
    if not (np.isfinite(low) and np.isfinite(high) and low <= high):
        problem = "must be two finite numbers, ascending"
    elif factor.reading is Reading.TIMES and not low > 0:
        problem = "multiplies what was given: must be positive"
    elif factor.reading is Reading.NOISE and low < 0:
        problem = "counts standard deviations: must not be negative"
    elif factor.reading is Reading.SHARE and not max(abs(low), abs(high)) <= LARGEST_SHARE:
        problem = f"is a relative error: within ±{LARGEST_SHARE}"
    elif factor.reading is Reading.COUNT:
        most = len(factor.text) - 1 if factor.text else np.inf
        if not (low == int(low) and high == int(high) and factor.nominal <= low and high <= most):
            upper = f" to {most}" if factor.text else " on"
            problem = f"must be whole numbers from {factor.nominal:.0f}{upper}"
    if not problem and low == high == factor.nominal:
        problem = "is the nominal value alone: nothing would vary"
    if problem:
        raise InputError(source, where, f"value {low:g}:{high:g} {problem}")
    return replace(factor, low=float(low), high=float(high))
