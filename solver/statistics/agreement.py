"""Agreement of two force networks: inferred and true forces, or two frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bodies.grains import Array
from ..contacts.pairs import Keys, align, are_among


@dataclass(frozen=True, slots=True)
class Agreement:
    """Agreement in one frame over the union of both contact sets; an absent contact has zero force."""

    r_fn: float  # Pearson correlation of the normal forces
    r_ft: float  # of the tangential forces
    relative_l2: float  # ‖f − f_true‖ / ‖f_true‖, both components
    scale: float  # Σ f_n / Σ f_n,true
    contact_precision: float  # fraction of the listed contacts that truly bear force
    contact_recall: float  # fraction of the contacts that truly bear force that is listed


def compare_forces(key: Keys, force: Array, true_key: Keys, true_force: Array) -> Agreement:
    """Compare forces (c, 2) [N] on contacts of keys (c,) with true forces (t, 2) [N] on true_key (t,)."""
    _, inferred, true = align(key, force, true_key, true_force)
    bearing = np.unique(true_key[true_force[:, 0] > 0])
    hit = int(are_among(bearing, key).sum())
    size, total = float(np.linalg.norm(true)), float(true[:, 0].sum())
    return Agreement(
        r_fn=pearson(inferred[:, 0], true[:, 0]),
        r_ft=pearson(inferred[:, 1], true[:, 1]),
        relative_l2=float(np.linalg.norm(inferred - true)) / size if size > 0 else float("nan"),
        scale=float(inferred[:, 0].sum()) / total if total > 0 else float("nan"),
        contact_precision=hit / len(key) if len(key) else float("nan"),
        contact_recall=hit / len(bearing) if len(bearing) else float("nan"),
    )


def relative_change(key: Keys, force: Array, other_key: Keys, other_force: Array) -> float:
    """Return ‖f_other − f‖ / ‖f‖ of forces (c, …) and (t, …) [N] given by key, absent ones zero; 0 where f = 0."""
    _, one, other = align(key, force, other_key, other_force)
    size = float(np.linalg.norm(one))
    return float(np.linalg.norm(other - one)) / size if size > 0 else 0.0


def pearson(a: Array, b: Array) -> float:
    """Return the Pearson correlation; NaN where either is constant."""
    if len(a) < 2 or np.ptp(a) == 0 or np.ptp(b) == 0:
        return float("nan")
    return float(np.corrcoef(a, b)[0, 1])


def ranks(values: Array) -> Array:
    """Return the ranks (m,) of values (m,) from 1, equal ones with their mean rank.

    As `scipy.stats.rankdata`, whose import takes a fifth of a second.
    """
    _, group, count = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(count)
    return np.asarray(0.5 * (2 * last - count + 1), np.float64)[group]
