"""The rows of every frame in the columns of a stored run, and the lengths of these columns."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ...solver.frame_forces import FrameForces
from ...solver.nlgs.sweep_record import SweepHistory
from ...solver.quantity import columns
from ...solver.statistics.frame_statistics import FrameStatistics
from ..checkpoint import flatten
from ..schema import (
    CONTACT_OFFSET,
    KEPT_OFFSET,
    SWEEP_COUNT,
    SWEEP_NUMBER,
    SWEEP_OFFSET,
    Entry,
    entries,
)
from .sweep_precision import round_sweeps

Columns = dict[str, np.ndarray]  # by path
Shapes = dict[str, tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class Extents:
    """The columns that all frames have, and the rows of each frame in them."""

    shape: Shapes  # of the columns
    rows: Columns  # offsets and counts


def rows_of_frame(forces: FrameForces, statistics: FrameStatistics, *, exact: bool = False) -> Columns:
    """Return the rows of one frame for each column; columns that the frame lacks are left out.

    exact: forces of sweeps are not rounded, for what depends on the lengths alone.
    """
    history = forces.history if exact else round_sweeps(forces.history)
    if history is not forces.history:
        forces = replace(forces, history=history)
    measured = measured_sweeps(forces.history)
    piece = {SWEEP_NUMBER.path: measured, SWEEP_COUNT.path: np.array([forces.history.count])}
    for part, whole in (("frames", forces), ("statistics", statistics)):
        named = dict(flatten(whole))
        for each in entries(part):
            if each.attribute in named:
                piece[each.path] = _rows_of(each, named[each.attribute], measured)
    return piece


def measure_extents(pieces: Iterable[Columns]) -> Extents:
    """Return the extents of the columns of all frames. Raises ValueError where the shapes of two frames disagree."""
    shape: Shapes = {}
    seen: dict[str, int] = {}
    ends: dict[str, list[int]] = {path: [0] for path in OFFSETS}
    count, by_path = 0, {each.path: each for each in entries()}
    for piece in pieces:
        count += 1
        for path, values in piece.items():
            if not _fits(by_path[path], values):
                continue
            rows, *rest = shape.get(path, (0, *values.shape[1:]))
            if values.shape[1:] != tuple(rest):
                raise ValueError(
                    f"{path} has rows of shape {values.shape[1:]} in frame {count - 1}, but {tuple(rest)} before"
                )
            shape[path] = (rows + len(values), *rest)
            seen[path] = seen.get(path, 0) + 1
        for path, counted in OFFSETS.items():
            ends[path].append(ends[path][-1] + len(piece[counted]))
    rows_of_frames = {path: np.array(values, np.int64) for path, values in ends.items()}
    return Extents({path: each for path, each in shape.items() if seen[path] == count}, rows_of_frames)


def measured_sweeps(history: SweepHistory) -> np.ndarray:
    """Return the indices of a frame's sweeps, from 0, whose residuals were measured."""
    rows = np.stack([getattr(history, name) for name in columns(SweepHistory, "sweep")])
    return np.flatnonzero(~np.isnan(rows).all(axis=0))


OFFSETS = {  # first rows of the frames, by a column that every frame has
    CONTACT_OFFSET.path: "contacts/i",
    SWEEP_OFFSET.path: SWEEP_NUMBER.path,
    KEPT_OFFSET.path: "sweeps/recorded",
}


def _rows_of(entry: Entry, value: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Return a frame's value as rows of a column."""
    if entry.dims[0] == "frame":
        return value[None]
    if entry.dims == ("sweep",):
        return value[measured]
    return value.ravel() if entry.dims == ("kept_force",) else value


def _fits(entry: Entry, values: np.ndarray) -> bool:
    """Whether values can be stored; NaN instead of whole numbers were not stored by an earlier version."""
    return values.dtype.kind != "f" or entry.dtype.kind == "f" or bool(np.isfinite(values).all())
