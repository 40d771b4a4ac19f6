"""Declarations of stored quantities: dimensions, unit and meaning, on the dataclass field that holds the values.

    fn: Annotated[Array, Quantity("normal force, compression positive", "N", "contact")]

Storage, exports and documentation are generated from these declarations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import MISSING, Field, dataclass, fields
from enum import IntEnum
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np


@dataclass(frozen=True, slots=True)
class Quantity:
    """Meaning, unit and dimensions of a field of a result."""

    meaning: str  # a phrase for people
    unit: str = ""  # SI; empty: none
    dims: str = ""  # names of the dimensions, separated by spaces: "contact xy"; empty: a single value
    since: int = 1  # first version of the stored schema that has it
    essential: bool = False  # required to interpret the rest
    absent: Any = float("nan")  # value where an earlier version stored none; a default of the field goes before
    path: str | None = None  # path of its dataset where it differs from group/field
    formerly: str | None = None  # its path in earlier versions of the stored schema
    names: type[IntEnum] | None = None  # enumeration that names its values


class DeclaredField(NamedTuple):
    """A dataclass field with its declaration."""

    name: str
    dtype: np.dtype  # object: text
    quantity: Quantity
    absent: Any  # value where none was stored: a number, text or None


@cache
def quantities(kind: type) -> tuple[DeclaredField, ...]:
    """Return the declared fields of a dataclass, in order."""
    return tuple(_declared(kind))


def columns(kind: type, dimension: str) -> tuple[str, ...]:
    """Return the names of the fields whose first dimension is the given one: columns(FrameForces, "contact")."""
    return tuple(each.name for each in quantities(kind) if each.quantity.dims.split()[:1] == [dimension])


def _declared(kind: type) -> Iterator[DeclaredField]:
    hints = get_type_hints(kind, include_extras=True)
    for each in fields(kind):
        hint = hints[each.name]
        if get_origin(hint) is not Annotated:
            continue
        stored, *notes = get_args(hint)
        for quantity in (note for note in notes if isinstance(note, Quantity)):
            yield DeclaredField(each.name, _dtype(stored), quantity, _absent(each, quantity))


def _dtype(hint: Any) -> np.dtype:
    """Return the dtype of a type hint: of an array, a scalar, or one of them or None."""
    if hasattr(hint, "array_type"):  # jaxtyping, as Float[Array, "n 2"]: the widest dtype that it allows
        widest = [name for name in ("float64", "int64") if name in hint.dtypes]
        return np.dtype((widest or hint.dtypes)[0])
    alias = getattr(get_origin(hint), "__value__", None)
    if alias is not None:  # NDArray[number] is an alias since numpy 2.5
        return _dtype(alias[get_args(hint)])
    parts = [part for part in get_args(hint) if part is not type(None)]
    if get_origin(hint) is np.ndarray:  # ndarray[shape, dtype[number]]
        return np.dtype(get_args(parts[1])[0])
    if len(parts) == 1 and type(None) in get_args(hint):
        return _dtype(parts[0])
    if get_origin(hint) is tuple or hint is str:
        return np.dtype(object)
    return np.dtype(np.uint8) if issubclass(hint, IntEnum) else np.dtype(hint)


def _absent(each: Field[Any], quantity: Quantity) -> Any:
    if each.default is not MISSING:
        return each.default
    return each.default_factory() if each.default_factory is not MISSING else quantity.absent
