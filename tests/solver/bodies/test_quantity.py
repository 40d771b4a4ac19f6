"""Declared fields, however the version of numpy names arrays."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, TypeVar

import numpy as np
from typing_extensions import TypeAliasType

from solver.bodies.quantity import Quantity, quantities
from tests.program import ROOT

Number = TypeVar("Number", bound=np.generic)
Named = TypeAliasType(  # as numpy's NDArray since 2.5
    "Named", np.ndarray[tuple[int, ...], np.dtype[Number]], type_params=(Number,)
)


@dataclass
class Told:
    state: Annotated[Named[np.uint8], Quantity("state", "", "contact")]
    force: Annotated[Named[np.float64] | None, Quantity("force", "N", "contact")] = None


def test_the_numbers_of_an_array_that_an_alias_names_are_known():
    assert [each.dtype for each in quantities(Told)] == [np.dtype(np.uint8), np.dtype(np.float64)]


def test_shapes_are_told_of_arrays_and_not_of_an_alias():
    """Float[NDArray[...], "n 2"] is refused by jaxtyping where NDArray is an alias: with Python 3.12 and later."""
    files = [*(ROOT / "solver").rglob("*.py"), *(ROOT / "app").rglob("*.py")]
    assert len(files) > 300
    told = re.compile(r"\b(?:Float|Int|Bool|UInt|Shaped|Num)\d*\[NDArray\b|^Array\b.*NDArray", re.MULTILINE)
    assert not [file.name for file in files if told.search(file.read_text(encoding="utf-8"))]
