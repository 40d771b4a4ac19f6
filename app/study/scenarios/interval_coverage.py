"""Coverage of the intervals of contact forces, by group of contacts and by scenario.

Split conformal calibration: constants are fitted on some seeds of some scenarios (`interval_fit`) and judged on other
seeds of other scenarios.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from ...solver.assessment.intervals.force_intervals import WEAK, EvidenceSource
from ...solver.assessment.motion_information import STRONG
from ...solver.bodies.grains import Array
from ...synthetic.scenarios.preset_names import ScenarioName
from ..fitting.coverage import COVERED
from .contact_errors import ContactErrors

FIT_SCENARIOS: tuple[ScenarioName, ...] = (
    "shear", "biaxial", "gravity", "isotropic", "radii_03", "step_05", "soft", "softer", "loads", "circle",
    "nearly_jammed", "sheared", "soft_radii_03", "noise_40", "smooth_walls", "stiff",
)  # fmt: skip
JUDGE_SCENARIOS: tuple[ScenarioName, ...] = (
    "step_1", "periodic", "radii_1", "centres", "unseen", "corners", "ten_frames", "mu_low", "mu_high",
    "stiff_noise_40", "stiff_moving", "friction_spread", "annulus",
)  # fmt: skip
TOLERANCE = (0.05, 0.02)  # of these coverages
COMPONENTS = ("f_n", "f_t")
FIRST = "first frame"
FIRSTS = (EvidenceSource.FIRST, EvidenceSource.SOFT_FIRST)
GROUPS: dict[str, Callable[[ContactErrors], NDArray[np.bool_]]] = {
    "all": lambda e: _later(e),
    "weak": lambda e: _later(e) & (e.force[:, 0] < WEAK),
    "mean": lambda e: _later(e) & (e.force[:, 0] >= WEAK) & (e.force[:, 0] <= STRONG),
    "strong": lambda e: _later(e) & (e.force[:, 0] > STRONG),
    "sliding": lambda e: _later(e) & e.sliding,
    "wall": lambda e: _later(e) & e.wall,
    "ambiguous": lambda e: _later(e) & e.ambiguous,
    FIRST: lambda e: ~_later(e),
}


def coverage(error: Array, sd: Array) -> tuple[float, float]:
    """Return the fractions of errors (c,) within one and within two standard deviations (c,)."""
    size = np.abs(error)
    return float(np.mean(size <= sd)), float(np.mean(size <= 2.0 * sd))


def interval_score(error: Array, sd: Array) -> float:
    """Compute the mean interval score of intervals of ± two standard deviations.

    Parameters
    ----------
    error, sd : ndarray
        (c,) over the mean f_n.

    Notes
    -----
    The score 4 σ + (2 / .05) max(|e| − 2 σ, 0) is least for the narrowest intervals that cover 95 %: T. Gneiting and
    A. E. Raftery (2007), equation 43.
    """
    return float(np.mean(4.0 * sd + 40.0 * np.maximum(np.abs(error) - 2.0 * sd, 0.0)))


def print_intervals(console: Console, title: str, errors: ContactErrors) -> None:
    """Print the coverage by group and scenario for all frames but the first, and for the first frame.

    Further columns: mean standard deviation, and interval score over that of the best common standard deviation.
    """
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("contacts")
    fractions = [f"{name} {fraction} %" for name in COMPONENTS for fraction in (68, 95)]
    beside = [f"{column} {name}" for name in COMPONENTS for column in ("mean", "score")]
    for heading in ("number", *fractions, *beside):
        table.add_column(heading, justify="right")
    table.add_column("beyond")
    common_sd = np.quantile(np.abs(errors.error[_later(errors)]), COVERED[1], axis=0) / 2.0
    rows = [*GROUPS.items()]
    rows += [(str(scenario), _in_scenario(scenario)) for scenario in np.unique(errors.scenario)]
    for name, choose in rows:
        part = errors.select(choose(errors))
        if len(part.group):
            fractions = covered(part)
            cells = [f"{100.0 * fraction:.0f}" for fraction in fractions]
            table.add_row(name, str(len(part.group)), *cells, *_scores(part, common_sd), describe_violations(fractions))
    console.print(table)
    console.print(
        "Mean: stated standard deviation σ over the mean f_n. Score: of intervals of ± 2 σ, over the score with one σ "
        "for all contacts that covers 95 % of them; below 1 is better. Beyond: coverages off by more than 5 % within "
        "1 σ or 2 % within 2 σ, too high (+) or too low (−).", highlight=False, soft_wrap=True,
    )  # fmt: skip


def describe_violations(fractions: Sequence[float]) -> str:
    """Name the fractions of `covered` that are off by more than TOLERANCE, with the sign; empty if none."""
    names = [f"{name} {fraction}" for name in COMPONENTS for fraction in (68, 95)]
    violations = [
        f"{name} {'+' if fraction > aimed else '−'}"
        for name, fraction, aimed, tolerance in zip(names, fractions, COVERED * 2, TOLERANCE * 2, strict=True)
        if abs(fraction - aimed) > tolerance
    ]
    return ", ".join(violations)


def _scores(errors: ContactErrors, common_sd: Array) -> list[str]:
    cells = []
    for c in range(2):
        error, sd = errors.error[:, c], errors.sd[:, c]
        score = interval_score(error, sd) / interval_score(error, np.full(len(error), common_sd[c]))
        cells += [f"{sd.mean():.3f}", f"{score:.2f}"]
    return cells


def _later(errors: ContactErrors) -> NDArray[np.bool_]:
    return ~np.isin(errors.evidence_source, FIRSTS)


def covered(errors: ContactErrors) -> tuple[float, ...]:
    """Return the fractions of f_n, then of f_t, within one and within two stated standard deviations."""
    return tuple(fraction for c in range(2) for fraction in coverage(errors.error[:, c], errors.sd[:, c]))


def _in_scenario(scenario: str) -> Callable[[ContactErrors], NDArray[np.bool_]]:
    return lambda errors: (errors.scenario == scenario) & _later(errors)
