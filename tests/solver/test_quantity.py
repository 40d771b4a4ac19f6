"""Declared fields, for every version of numpy."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, TypeVar

import numpy as np
from rodsight.solver.quantity import Quantity, quantities
from typing_extensions import TypeAliasType

from tests.program import ROOT

Number = TypeVar("Number", bound=np.generic)
Named = TypeAliasType(  # as numpy's NDArray since 2.5
    "Named", np.ndarray[tuple[int, ...], np.dtype[Number]], type_params=(Number,)
)


@dataclass
class Example:
    state: Annotated[Named[np.uint8], Quantity("state", "", "contact")]
    force: Annotated[Named[np.float64] | None, Quantity("force", "N", "contact")] = None


def test_dtype_of_an_aliased_array_is_found():
    assert [each.dtype for each in quantities(Example)] == [np.dtype(np.uint8), np.dtype(np.float64)]


def test_shapes_are_declared_on_arrays_not_on_an_alias():
    """Float[NDArray[...], "n 2"] is refused by jaxtyping where NDArray is an alias: with Python 3.12 and later."""
    files = [*(ROOT / "solver").rglob("*.py"), *(ROOT / "app").rglob("*.py")]
    assert len(files) > 300
    pattern = re.compile(r"\b(?:Float|Int|Bool|UInt|Shaped|Num)\d*\[NDArray\b|^Array\b.*NDArray", re.MULTILINE)
    assert not [file.name for file in files if pattern.search(file.read_text(encoding="utf-8"))]
