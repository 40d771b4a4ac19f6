"""Intervals of contact forces against the truth: how often they cover it, by kind of contact and by world.

Split conformal calibration: constants are fitted on some seeds of some worlds (`interval_fit`) and judged on other
seeds of other worlds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from solver.bodies.grains import Array
from solver.sequence.judging.intervals import STRONG, WEAK, Witness

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
TOLERANCE = (0.05, 0.02)  # by which a share that is covered may be off these
COMPONENTS = ("f_n", "f_t")
FIRST = "first frame"
FIRSTS = (Witness.FIRST, Witness.SOFT_FIRST)
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


def coverage(error: Array, deviation: Array) -> tuple[float, float]:
    """Share of errors (c,) within one and within two deviations (c,)."""
    size = np.abs(error)
    return float(np.mean(size <= deviation)), float(np.mean(size <= 2.0 * deviation))


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
    table.add_column("beyond")
    one = np.quantile(np.abs(errors.error[_later(errors)]), COVERED[1], axis=0) / 2.0
    rows = [*GROUPS.items()]
    rows += [(str(world), _of_world(world)) for world in np.unique(errors.world)]
    for name, choose in rows:
        part = errors.select(choose(errors))
        if len(part.group):
            shares = covered(part)
            told = [f"{100.0 * share:.0f}" for share in shares]
            table.add_row(name, str(len(part.group)), *told, *_beside(part, one), tell_misses(shares))
    console.print(table)
    console.print(
        "Mean: stated deviation over the mean f_n. Score: of intervals of two deviations, over the score with one "
        "deviation for all contacts, which covers 95 % of them; below 1 is better. Beyond: shares that are off by more "
        "than 5 % within one deviation, 2 % within two, too many (+) or too few (−).", highlight=False, soft_wrap=True,
    )  # fmt: skip


def tell_misses(shares: Sequence[float]) -> str:
    """Which of the shares that `covered` gives are off by more than TOLERANCE, and to which side; empty: none."""
    names = [f"{name} {share}" for name in COMPONENTS for share in (68, 95)]
    told = [
        f"{name} {'+' if share > aimed else '−'}"
        for name, share, aimed, tolerance in zip(names, shares, COVERED * 2, TOLERANCE * 2, strict=True)
        if abs(share - aimed) > tolerance
    ]
    return ", ".join(told)


def _beside(errors: ContactErrors, one: Array) -> list[str]:
    cells = []
    for c in range(2):
        error, deviation = errors.error[:, c], errors.deviation[:, c]
        score = interval_score(error, deviation) / interval_score(error, np.full(len(error), one[c]))
        cells += [f"{deviation.mean():.3f}", f"{score:.2f}"]
    return cells


def _later(errors: ContactErrors) -> NDArray[np.bool_]:
    return ~np.isin(errors.witness, FIRSTS)


def covered(errors: ContactErrors) -> tuple[float, ...]:
    """Share of f_n, then of f_t, within one and within two stated deviations."""
    return tuple(share for c in range(2) for share in coverage(errors.error[:, c], errors.deviation[:, c]))


def _of_world(world: str) -> Callable[[ContactErrors], NDArray[np.bool_]]:
    return lambda errors: (errors.world == world) & _later(errors)
