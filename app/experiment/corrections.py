"""Poses entered by hand, where the tracker lost a grain or found it in a wrong place."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..solver.bodies.grains import Array
from .experiment import Experiment, rows_of
from .reading.tables import Table, check_unique

LOST = "lost"


@dataclass(frozen=True, slots=True)
class PoseCorrections:
    """m poses entered by hand, in the order of the table."""

    frame: NDArray[np.int64]  # (m,) 1 …
    id: NDArray[np.int64]  # (m,)
    x: Array  # (m,) [px] column, NaN where the grain is lost
    y: Array  # (m,) [px] row, down
    theta: Array  # (m,) [rad] from the first photograph, counter-clockwise; NaN where it is to be found


def read_corrections(experiment: Experiment, ids: NDArray[np.int64] | None, frame_count: int) -> PoseCorrections | None:
    """Read `photographs.corrections`, a table frame,id,x,y,theta; None if the experiment has none.

    x and y are pixels as in the table of grains, theta is in radians as in a table of tracks. The tracker finds the
    angle where theta is empty; the word "lost" in x, y or theta marks a grain that is not visible in that frame.

    Parameters
    ----------
    experiment
        The experiment with the table.
    ids
        Ids of the grains (n,); None while they are unknown.
    frame_count
        Number of photographs.

    Raises
    ------
    InputError
        A value is wrong; the message names file, row and value.
    """
    section = experiment.config.photographs
    if section is None or section.corrections is None:
        return None
    table = experiment.table(section.corrections, ("frame", "id", "x", "y", "theta"))
    frame, of = table.integers("frame"), table.integers("id")
    check_unique(table, "id", frame, of)
    for row in np.flatnonzero((frame < 1) | (frame >= frame_count)):
        first = "is the first photograph: correct it with photographs.grains"
        other = f"is not one of the frames 1 … {frame_count - 1}"
        raise table.error(int(row), "frame", first if frame[row] == 0 else other)
    if ids is not None:
        rows_of(table, "id", of, ids)
    cells = [[text.lower() for text in table.text(column)] for column in ("x", "y", "theta")]
    lost = np.array([LOST in row for row in zip(*cells, strict=True)], dtype=np.bool_)
    unspecified = np.array([text == "" for text in cells[2]], dtype=np.bool_)
    x, y = _numbers(table, "x", lost), _numbers(table, "y", lost)
    return PoseCorrections(frame, of, x, y, _numbers(table, "theta", lost | unspecified))


def _numbers(table: Table, column: str, blank: NDArray[np.bool_]) -> Array:
    """Return the numbers of a column (m,), NaN in rows that are marked `blank` (m,)."""
    values = np.full(len(table), np.nan)
    for row in np.flatnonzero(~blank):
        with suppress(ValueError):
            values[row] = float(table.text(column)[row])
        if not np.isfinite(values[row]):
            raise table.error(int(row), column, f"is neither a finite number nor {LOST!r}")
    return values
