"""Check the shapes that the solver's types state, `position: Float[Array, "n 2"]`, wherever one of them is made.

Only the tests' runs do: `check_shapes` wraps the types in place, and nothing of it is in the product.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from dataclasses import is_dataclass
from functools import wraps
from typing import Any, get_args, get_type_hints

from beartype.door import is_bearable
from jaxtyping import AbstractArray, jaxtyped


class ShapeError(TypeError):
    """A field does not have the shape or the kind of number that its type states."""


def check_shapes(package: str) -> list[type]:
    """Wrap every dataclass and named tuple of arrays of a package and its rooms; give those that were wrapped."""
    return [each for each in _types_of(package) if check_shapes_of(each)]


def check_shapes_of(kind: type) -> bool:
    """Wrap one type; whether it states any shape."""
    stated = {name: hint for name, hint in get_type_hints(kind).items() if _states_shape(hint)}
    if not stated:
        return False
    if is_dataclass(kind):
        initialise = kind.__init__

        @wraps(initialise)
        def checked(self: Any, *values: Any, **named: Any) -> None:
            initialise(self, *values, **named)  # what the type itself refuses, it says better
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
