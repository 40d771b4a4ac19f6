"""The questions that the page may ask: a name, checked values, an answer of plain values."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError, validate_call

from ...errors import InputError
from .bench import Bench

Question = Callable[..., Any]
Text = Annotated[str, StringConstraints(max_length=300)]
Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e12, le=1e12)]
Whole = Annotated[int, Field(ge=0, lt=2**53)]
Point = Annotated[list[Number], Field(min_length=2, max_length=2)]
Line = Annotated[list[Point], Field(min_length=2, max_length=2)]
Numbers = Annotated[list[Number], Field(max_length=1000)]

QUESTIONS: dict[str, Question] = {}
EDITS: set[str] = set()  # those that change the files of an experiment: one at a time, from however many windows
_RULES = ConfigDict(arbitrary_types_allowed=True, strict=True)


class BadRequest(ValueError):
    """The page asked for something that does not exist."""


class Shape(BaseModel):
    """Values of a question that belong together. Unknown ones are refused."""

    model_config = ConfigDict(extra="forbid", strict=True)


def question(function: Question) -> Question:
    """Let the page ask this by the function's name."""
    QUESTIONS[function.__name__] = validate_call(config=_RULES)(function)
    return function


def edit(function: Question) -> Question:
    """Likewise; what it reads of the experiment nobody else changes until it has written."""
    EDITS.add(function.__name__)
    return question(function)


def answer(bench: Bench, name: str, values: dict[str, Any]) -> Any:
    """Answer one question. Raises BadRequest, and InputError as the commands do."""
    if name not in QUESTIONS or "bench" in values:
        raise BadRequest(f"there is no question {name}")
    try:
        with _alone(bench, values.get("at")) if name in EDITS else nullcontext():
            return QUESTIONS[name](bench, **values)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise BadRequest(f"{name}: {where}: {first['msg']}") from None


def _alone(bench: Bench, at: Any) -> AbstractContextManager[Any]:
    """What one edit of an experiment holds; of what is none, the question itself complains."""
    try:
        return bench.project(at).editing if isinstance(at, str) else nullcontext()
    except InputError:
        return nullcontext()


@question
def home(bench: Bench) -> dict[str, Any]:
    return bench.home()


@question
def sample(bench: Bench) -> dict[str, Any]:
    return bench.sample().describe()


@question
def begin(bench: Bench, roll: Whole, name: Text) -> dict[str, Any]:
    return bench.begin(roll, name).describe()


@question
def stamp(bench: Bench, at: Text) -> dict[str, Any]:
    """By which a page sees that another window, or another program, has changed something."""
    return {"stamp": bench.project(at).stamp()}


@question
def project(bench: Bench, at: Text) -> dict[str, Any]:
    return bench.project(at).describe()
