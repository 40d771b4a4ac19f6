"""Compare two results, number for number and type for type."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from rodsight.results.checkpoint import flatten
from rodsight.results.results import Results


def differences(one: Results, other: Results, rounding: float = 0.0) -> list[str]:
    """Return the names of different fields; rounding: tolerated relative difference between processors."""
    found: list[str] = []
    for each in fields(Results):
        a, b = getattr(one, each.name), getattr(other, each.name)
        if callable(a):  # a part that is read on access
            a, b = a(), b()
        if isinstance(a, Sequence) and not isinstance(a, str):
            found += [] if len(a) == len(b) else [f"number of {each.name}"]
            for k, (x, y) in enumerate(zip(a, b, strict=False)):
                found += _parts(f"{each.name}[{k}]", x, y, rounding)
        elif isinstance(a, str | int | float) or a is None:
            found += [] if a == b else [each.name]
        else:
            found += _parts(each.name, a, b, rounding)
    return found


def _parts(name: str, one: Any, other: Any, rounding: float) -> list[str]:
    if other is None or type(one) is not type(other):
        return [name]
    a, b = dict(flatten(one)), dict(flatten(other))
    return [
        f"{name}.{key}"
        for key in a.keys() | b.keys()
        if key not in a or key not in b or not same_values(a[key], b[key], rounding)
    ]


def same_values(one: np.ndarray, other: np.ndarray, rounding: float = 0.0) -> bool:
    """Return whether two arrays have the same type and values, NaN included."""
    alike = one.dtype.kind == other.dtype.kind == "U" or one.dtype == other.dtype
    if alike and rounding and one.dtype.kind == "f":
        return one.shape == other.shape and np.allclose(one, other, rounding, rounding * _largest(one), equal_nan=True)
    return alike and np.array_equal(one, other, equal_nan=one.dtype.kind == "f")


def _largest(values: np.ndarray) -> float:
    return float(np.nanmax(np.abs(values), initial=0.0)) if not np.isnan(values).all() else 0.0
