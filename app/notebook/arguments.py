"""Arguments given in Python: checked, and converted to tables and to the strings of `--set`."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomli_w

from ..experiment.reading.tables import Table
from ..process.errors import InputError
from ..process.frame_range import FrameRange

OPTION = re.compile(r"--([a-z][a-z-]*)")  # of the command line, in a message
CALLED_OTHERWISE = {"scheduler": "workers"}  # arguments by the names of their options, where these differ
OPTIONAL = "theta"  # column whose values may be NaN
WHOLE = ("frame", "id")  # columns of whole numbers, which data frames may store as floats


@contextmanager
def arguments_named() -> Iterator[None]:
    """Name options of the command line as arguments in bad input of the block; those of a whole command stay."""
    try:
        yield
    except InputError as error:
        if "rodsight " not in str(error):
            error.args = (OPTION.sub(_argument_of, str(error)),)
        raise


def _argument_of(option: re.Match[str]) -> str:
    name = option[1].replace("-", "_")
    return CALLED_OTHERWISE.get(name, name)


def as_strings(settings: Mapping[str, object], name: str = "settings") -> list[str]:
    """Return KEY=VALUE of every setting, the value as TOML. Raises InputError; name: of the argument."""
    given = as_mapping(name, settings, 'keys to values, such as {"solver.kappa": 0.1}')
    return [f"{key}={_as_toml(f'{name}[{key!r}]', value)}" for key, value in given.items()]


def _as_toml(where: str, value: object) -> str:
    if isinstance(value, np.generic):
        value = value.item()
    try:
        return tomli_w.dumps({"value": value}).partition("=")[2].strip()
    except TypeError:
        raise InputError(where, repr(value), "is no value of a key of experiment.toml") from None


def as_mapping(name: str, value: object, content: str) -> Mapping[Any, Any]:
    """Return a mapping. Raises InputError with the argument; content: of it in words, with an example."""
    if not isinstance(value, Mapping):
        raise InputError(name, repr(value), f"is no mapping of {content}")
    return value


def is_number(value: object) -> bool:
    """Whether a value is a finite number, and no truth value."""
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def as_whole(name: str, value: object) -> int:
    """Return a whole number. Raises InputError with the argument."""
    try:
        return operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise InputError(name, repr(value), "is not a whole number") from None


def as_frames(frames: object) -> FrameRange:
    """Return a range of frames. Raises InputError for what is none."""
    if isinstance(frames, Sequence) and len(frames) in (2, 3) and not isinstance(frames, str):
        first, stop, step = (*frames, 1)[:3]
        whole = [each for each in (first, 0 if stop is None else stop, step) if isinstance(each, Integral)]
        if len(whole) == 3 and step >= 1:
            return FrameRange(int(first), None if stop is None else int(stop), int(step))
    raise InputError("frames", repr(frames), "is not (first, end) or (first, end, step), such as (0, None, 4)")


def as_frame(name: str, columns: object) -> pd.DataFrame:
    """Return columns as a data frame. Raises InputError where they are none, or of unequal lengths."""
    if not isinstance(columns, pd.DataFrame | Mapping):
        raise InputError(name, f"{type(columns).__name__}", "is neither a data frame nor a mapping of columns")
    try:
        frame = pd.DataFrame(columns)
    except (ValueError, TypeError) as error:
        raise InputError(name, "", f"is no table: {error}") from None
    twice = frame.columns[frame.columns.duplicated()]
    if len(twice):
        raise InputError(name, f"column {twice[0]}", "stands twice")
    foreign = [column for column in frame if not getattr(frame[column].dtype, "isnative", True)]
    for column in foreign:  # pandas sorts and compares the own byte order only
        array = np.asarray(frame[column])
        frame = frame.assign(**{str(column): array.astype(array.dtype.newbyteorder("="))})
    return frame


def as_table(name: str, frame: pd.DataFrame, columns: Sequence[str]) -> Table:
    """Convert columns to a table as read from a file, for the same checks and messages."""
    for column in columns:
        if column not in frame:
            raise InputError(name, f"column {column}", f"there is no such column among {', '.join(map(str, frame))}")
    if frame.empty:
        raise InputError(name, "", "has no rows")
    return Table(Path(name), {column: _texts(column, frame[column]) for column in columns}, list(range(len(frame))))


def _texts(column: str, values: Iterable[Any]) -> list[str]:
    array = np.asarray(values)
    texts = ["" if column == OPTIONAL and each != each else str(each) for each in array.tolist()]  # NaN: unknown
    if column in WHOLE and array.dtype.kind == "f":
        texts = [text.removesuffix(".0") for text in texts]
    return texts
