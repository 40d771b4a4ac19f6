"""How a frame's network and forces differ from those of the frame before, as both were reported."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts
from solver.contacts.pairs import are_among, are_there, common_rows
from solver.nlgs.warm_start import ForceMemory
from solver.statistics.agreement import pearson


@dataclass(frozen=True, slots=True)
class Changes:
    similarity: float  # correlation of f_n on common contacts, NaN where it is not defined
    gained: float  # contacts that the frame before did not have
    parted: float  # contacts of the frame before that are gone, those of lost grains left out


def find_changes(former: ForceMemory, contacts: Contacts, fn: Array, present: NDArray[np.bool_]) -> Changes:
    """Compare the forces fn (c,) [N] on contacts with those of the frame before; present (n,): the grains seen now."""
    key = contacts.key
    here, there = common_rows(key, former.key)
    gone = former.key[~are_among(former.key, key)]
    return Changes(
        correlate(former.force[there, 0], fn[here]),
        float((~are_among(key, former.key)).sum()),
        float(are_there(gone, present, contacts.body_count).sum()),
    )


def correlate(a: Array, b: Array) -> float:
    """Pearson correlation of what is known on both sides; NaN with fewer than three values or none that vary."""
    known = np.isfinite(a) & np.isfinite(b)
    return pearson(a[known], b[known]) if known.sum() >= 3 else float("nan")
