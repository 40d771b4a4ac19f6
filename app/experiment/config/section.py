"""What every section of the experiment file is made of: frozen models, and keys that say what they mean."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field
from pydantic_core import PydanticUndefined

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
AtLeastOne = Annotated[int, Field(ge=1)]
Frame = Annotated[int, Field(ge=0)]


class Section(BaseModel):
    """A table of the experiment file. A key that it does not know is refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=False)


def key(description: str, *, unit: str = "", default: Any = PydanticUndefined) -> Any:
    """A key of the experiment file; without a default it must be given. The first sentence is quoted in complaints."""
    return Field(default, description=description, json_schema_extra={"unit": unit} if unit else None)
