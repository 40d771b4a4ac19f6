"""Base of every section of the experiment file: a frozen model, and keys with descriptions."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field
from pydantic_core import PydanticUndefined

GREATEST = 2**53  # whole numbers up to it are exact wherever they are stored


def _number(**bounds: Any) -> Any:
    """Return the field of a finite number within bounds; booleans and quoted numbers are refused."""
    return Field(strict=True, allow_inf_nan=False, **bounds)


def above(low: float, high: float) -> Any:
    """Return the field of a number with low < value ≤ high."""
    return _number(gt=low, le=high)


def between(low: float, high: float) -> Any:
    """Return the field of a number with low ≤ value ≤ high."""
    return _number(ge=low, le=high)


def whole(low: int, high: int) -> Any:
    """Return the field of a whole number with low ≤ value ≤ high."""
    return Field(strict=True, ge=low, le=high)


Finite = Annotated[float, _number()]
Frame = Annotated[int, whole(0, GREATEST)]
Length = Annotated[float, above(0, 1e3)]  # [m]
Pixels = Annotated[float, above(0, 1e6)]  # [px]
Switch = Annotated[bool, Field(strict=True)]


class Section(BaseModel):
    """A table of the experiment file. Unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=False)


def key(description: str, *, unit: str = "", default: Any = PydanticUndefined) -> Any:
    """Return a key of the experiment file, required without a default. Errors quote the first sentence."""
    return Field(default, description=description, json_schema_extra={"unit": unit} if unit else None)
