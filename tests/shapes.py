"""Check the shapes that the solver's types state wherever one of them is made.

A field states them as `position: Float[Array, "n 2"]`, or by the dimensions of its Quantity.

Only the tests' runs do: `check_shapes` wraps the types in place, and nothing of it is in the product.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from dataclasses import is_dataclass
from functools import wraps
from types import NoneType
from typing import Any, get_args, get_type_hints

import numpy as np
from beartype.door import is_bearable
from jaxtyping import AbstractArray, Shaped, jaxtyped
from rodsight.solver.quantity import quantities

DIMENSIONS = {"xy": "2", "axis": "2", "component": "2"}  # of quantities, whose size is known


class ShapeError(TypeError):
    """A field does not have the shape or the kind of number that its type states."""


def check_shapes(package: str) -> list[type]:
    """Wrap every dataclass and named tuple of arrays of a package and its rooms; give those that were wrapped."""
    return [each for each in _types_of(package) if check_shapes_of(each)]


def check_shapes_of(kind: type) -> bool:
    """Wrap one type; whether it states any shape."""
    stated = _stated_shapes(kind)
    if not stated:
        return False
    if is_dataclass(kind):
        initialise = kind.__init__

        @wraps(initialise)
        def checked(self: Any, *values: Any, **named: Any) -> None:
            initialise(self, *values, **named)  # its own refusal is clearer
            _check(self, stated)

        kind.__init__ = checked  # type: ignore[method-assign]
    else:
        make = kind.__new__

        @wraps(make)
        def checked_new(cls: type, *values: Any, **named: Any) -> Any:
            made = make(cls, *values, **named)
            _check(made, stated)
            return made

        kind.__new__ = checked_new  # type: ignore[method-assign]
    return True


def _check(value: Any, stated: dict[str, Any]) -> None:
    """One letter is one length in all fields of a value."""
    with jaxtyped("context"):  # type: ignore[arg-type]
        for name, hint in stated.items():
            field = getattr(value, name)
            if not is_bearable(field, hint):
                found = f"{getattr(field, 'dtype', type(field).__name__)}{list(getattr(field, 'shape', []))}"
                raise ShapeError(f"{type(value).__name__}.{name} is {found}, not {hint}, or disagrees with the others")


def _stated_shapes(kind: type) -> dict[str, Any]:
    hints = get_type_hints(kind)
    stated = {name: hint for name, hint in hints.items() if _states_shape(hint)}
    for each in quantities(kind) if is_dataclass(kind) else ():
        if each.quantity.dims and each.name not in stated and each.dtype.kind != "O":
            shape = Shaped[np.ndarray, " ".join(DIMENSIONS.get(name, name) for name in each.quantity.dims.split())]
            stated[each.name] = shape | None if NoneType in get_args(hints[each.name]) else shape
    return stated


def _states_shape(hint: Any) -> bool:
    if isinstance(hint, type) and issubclass(hint, AbstractArray):
        return True
    return any(_states_shape(part) for part in get_args(hint))


def _types_of(package: str) -> Iterator[type]:
    root = importlib.import_module(package)
    for found in pkgutil.walk_packages(root.__path__, f"{package}."):
        module = importlib.import_module(found.name)
        for each in vars(module).values():
            if isinstance(each, type) and each.__module__ == module.__name__ and _has_fields(each):
                yield each


def _has_fields(kind: type) -> bool:
    return is_dataclass(kind) or (issubclass(kind, tuple) and hasattr(kind, "_fields"))
