"""The endpoints that the page may request: a name, checked values, an answer of plain values; queries of pictures."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints, ValidationError, validate_call
from starlette.requests import Request

from ...process.errors import InputError
from ..action_script import as_script
from ..setup.journal import requested
from .project import Project
from .workbench import Workbench

Endpoint = Callable[..., Any]


def without_nul(text: str) -> str:
    """Refuse a text that no file can be named by."""
    if "\0" in text:
        raise ValueError("a text has no NUL character")
    return text


Text = Annotated[str, StringConstraints(max_length=300), AfterValidator(without_nul)]
Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e12, le=1e12)]
Whole = Annotated[int, Field(ge=0, lt=2**53)]
Point = Annotated[list[Number], Field(min_length=2, max_length=2)]
Line = Annotated[list[Point], Field(min_length=2, max_length=2)]
Numbers = Annotated[list[Number], Field(max_length=1000)]
Name = Annotated[int, Field(ge=-(2**53), le=2**53)] | Text  # of a body: a grain's id, or a wall's name
Side = Annotated[int, Field(ge=16, le=1600)]  # [px] of a crop as it is sent
WIDEST = 20_000  # [px] of a picture

ENDPOINTS: dict[str, Endpoint] = {}
EDITING: set[str] = set()  # endpoints that change the files of an experiment: they run one at a time
# Requests that write about the photograph that is shown: it must be the one that has this number here.
ABOUT_SHOWN = frozenset(("judge", "flag_frame", "pair_at"))
FREE = frozenset(("undo", "redo"))  # edits that concern no photograph
_RULES = ConfigDict(arbitrary_types_allowed=True, strict=True)


class BadRequest(ValueError):
    """A request names something that does not exist, or has malformed values."""


class Values(BaseModel):
    """Values of a request that belong together; unknown ones are refused."""

    model_config = ConfigDict(extra="forbid", strict=True)


def endpoint(function: Endpoint) -> Endpoint:
    """Serve a function under its name; its annotations are the checks of its values.

    A function of an experiment, `opened`, is given it by the path in the request, `at`; where such a function returns
    nothing, the answer is the description of the experiment.
    """
    opens = "opened" in signature(function).parameters
    ENDPOINTS[function.__name__] = validate_call(config=_RULES)(_opening(function) if opens else function)
    return function


def _opening(function: Endpoint) -> Endpoint:
    """Return a function of an experiment as one of the workbench and its path, which is opened when all is checked."""

    @wraps(function)
    def opening(workbench: Workbench, at: str, **values: Any) -> Any:
        opened = workbench.project(at)
        answer = function(opened, **values)
        return opened.describe() if answer is None else answer

    kinds = {"workbench": Workbench, "at": Text}
    first = [Parameter(name, Parameter.POSITIONAL_OR_KEYWORD, annotation=kind) for name, kind in kinds.items()]
    rest = list(signature(function).parameters.values())[1:]
    opening.__signature__ = Signature([*first, *rest])  # type: ignore[attr-defined]
    opening.__annotations__ = {**function.__annotations__, **kinds}
    return opening


def editing_endpoint(function: Endpoint) -> Endpoint:
    """Serve a function that changes the experiment: no other edit runs between its reading and its writing."""
    EDITING.add(function.__name__)
    return endpoint(function)


def call_endpoint(workbench: Workbench, name: str, values: dict[str, Any]) -> Any:
    """Call an endpoint with the values of a request.

    Raises
    ------
    BadRequest
        There is no such endpoint, or a value is malformed.
    InputError
        As the commands raise it.
    """
    if name not in ENDPOINTS or "workbench" in values:
        raise BadRequest(f"there is no endpoint {name}")
    shown = values.pop("photograph", None)
    try:
        with (
            _edit_lock(workbench, values.get("at")) if name in EDITING else nullcontext(),
            requested(name, values),
        ):
            if shown is not None and (name in ABOUT_SHOWN or name in EDITING - FREE):
                _refuse_another_photograph(workbench.project(values["at"]), shown)
            return ENDPOINTS[name](workbench, **values)
    except ValidationError as error:
        raise BadRequest(f"{name}: {first_error(error)}") from None


def _refuse_another_photograph(opened: Project, shown: Any) -> None:
    """Raise InputError where the photograph that the page shows, [number, name], has another number by now."""
    if not isinstance(shown, list) or [type(each) for each in shown] != [int, str]:
        raise BadRequest("photograph: is a number and a name")
    number, name = shown
    names = opened.photograph_names()
    if names and name not in names[number : number + 1]:
        raise InputError(
            name, f"photograph {number}", "is another one by now: their order or number was changed in another window; "
            "look again, and repeat the action",
        )  # fmt: skip


def first_error(error: ValidationError) -> str:
    """Describe the first value that was refused."""
    first = error.errors()[0]
    return f"{'.'.join(str(part) for part in first['loc'])}: {first['msg']}"


def _edit_lock(workbench: Workbench, at: Any) -> AbstractContextManager[Any]:
    """The lock of an experiment's edits; where there is no such experiment, the endpoint itself raises."""
    try:
        return workbench.project(at).editing if isinstance(at, str) else nullcontext()
    except InputError:
        return nullcontext()


@endpoint
def home(workbench: Workbench) -> dict[str, Any]:
    return workbench.home()


@endpoint
def sample(workbench: Workbench) -> dict[str, Any]:
    return workbench.sample().describe()


@endpoint
def begin(workbench: Workbench, folder: Text, suffix: Text, name: Text, like: Text | None = None) -> dict[str, Any]:
    """Make an experiment of a series of photographs: a folder, by its path from the root, and the ending of names.

    like: the experiment whose set-up it takes over.
    """
    return workbench.begin(folder, suffix, name, like).describe()


@endpoint
def duplicate(workbench: Workbench, at: Text) -> dict[str, Any]:
    """Copy an experiment, without its run, into a new folder beside it."""
    return workbench.duplicate(at).describe()


@endpoint
def script(workbench: Workbench, at: Text) -> dict[str, Any]:
    """Return the actions that are not undone as a Python script."""
    opened = workbench.project(at)
    files = opened.validation().data.get("photographs", {}).get("files", "")
    actions = opened.draft.journal.done()
    return {"script": as_script(actions, at=at, name=opened.name, files=files), "count": len(actions)}


@endpoint
def stamp(opened: Project) -> dict[str, Any]:
    """Return a text that changes when another window or another program has changed the experiment."""
    return {"stamp": opened.stamp()}


@endpoint
def project(opened: Project) -> dict[str, Any]:
    return opened.describe()


class Query(BaseModel):
    """Values after the question mark of an address; unknown ones are ignored."""

    model_config = ConfigDict(extra="ignore")

    @classmethod
    def of(cls, request: Request) -> Self:
        """Read the query of a request; raise BadRequest if a value is malformed."""
        try:
            return cls.model_validate(dict(request.query_params))
        except ValidationError as error:
            raise BadRequest(first_error(error)) from None


class ExperimentQuery(Query):
    at: Text = ""


class PhotographQuery(ExperimentQuery):
    frame: Whole = 0
    size: Annotated[int, Field(ge=1, le=WIDEST)] = WIDEST  # [px] of the longer side
    # The part that is sent [px]; without right and bottom, all of it.
    left: Whole = 0
    top: Whole = 0
    right: Whole | None = None
    bottom: Whole | None = None

    @property
    def part(self) -> tuple[slice, slice]:
        return slice(self.top, self.bottom), slice(self.left, self.right)


class ThumbnailQuery(Query):
    folder: Text | None = None  # path from the root; None: the sample
    suffix: Text = ""


class CropQuery(ExperimentQuery):
    """A part of a photograph: `width` pixels about a place, magnified to columns × rows pixels."""

    frame: Whole = 0
    x: Number
    y: Number
    width: Annotated[Number, Field(ge=4.0, le=4000.0)]
    columns: Side = 240
    rows: Side = 240
