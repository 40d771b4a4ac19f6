"""Changes of network and forces between consecutive reported frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..contacts.contacts import Contacts
from ..contacts.pairs import are_among, are_present, common_rows
from ..nlgs.force_memory import ForceMemory
from ..statistics.agreement import pearson


@dataclass(frozen=True, slots=True)
class Changes:
    """Changes since the previous reported frame."""

    similarity: float  # correlation of f_n on common contacts, NaN where it is undefined
    new: float  # contacts that the previous frame did not have
    lost: float  # contacts of the previous frame that are gone, those of lost grains excluded


def find_changes(former: ForceMemory, contacts: Contacts, fn: Array, present: NDArray[np.bool_]) -> Changes:
    """Compare the forces fn (c,) [N] on contacts with those of the previous frame; present (n,): grains seen now."""
    key = contacts.key
    here, there = common_rows(key, former.key)
    gone = former.key[~are_among(former.key, key)]
    return Changes(
        correlate(former.force[there, 0], fn[here]),
        float((~are_among(key, former.key)).sum()),
        float(are_present(gone, present, contacts.body_count).sum()),
    )


def correlate(a: Array, b: Array) -> float:
    """Pearson correlation over values known on both sides; NaN of fewer than three values or of constants."""
    known = np.isfinite(a) & np.isfinite(b)
    return pearson(a[known], b[known]) if known.sum() >= 3 else float("nan")
