"""Numbers of things in sentences, and means of the numbers that are known."""

from __future__ import annotations

import math
from collections.abc import Iterable


def state_count(count: int, noun: str) -> str:
    """Return a count with its noun, in the plural unless there is one.

    Examples
    --------
    >>> state_count(1, "frame"), state_count(0, "frame")
    ('1 frame', '0 frames')
    """
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def mean_of_known(values: Iterable[float | None]) -> float:
    """Return the mean of the values that are neither None nor infinite nor NaN; NaN where there are none.

    Examples
    --------
    >>> mean_of_known([1.0, None, math.nan, 2.0])
    1.5
    """
    known = [float(each) for each in values if each is not None and math.isfinite(each)]
    return math.fsum(known) / len(known) if known else math.nan


def known_or_none(value: float) -> float | None:
    """Return a number, None where it is infinite or NaN."""
    return float(value) if math.isfinite(value) else None
