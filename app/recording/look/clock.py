"""Positions of rows on the timelines: frame number, time, strain and sweep."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from . import entities

Moment = tuple[tuple[str, int | np.timedelta64], ...]  # timelines and the values on them


class RowSink(Protocol):
    """Receives rows that are sent in larger messages later."""

    def begin(self, moment: Moment) -> None:
        """Set the time of the rows and points that follow."""

    def add(self, path: str, when: Iterable[rr.TimeColumn], columns: Iterable[rr.ComponentColumn]) -> None:
        """Add rows of an entity."""

    def add_row(self, path: str, parts: Sequence[rr.DescribedComponentBatch]) -> None:
        """Add one row of an entity at the time that was set."""

    def add_point(self, path: str, values: Sequence[float]) -> None:
        """Add a point of the curves of an entity."""


@dataclass(frozen=True, slots=True)
class Clock:
    """Places the rows of one frame on all timelines; on those of time and strain only where these are known."""

    stream: rr.RecordingStream
    frame: int
    first: int  # value on `sweep` of the frame's first row
    last: int  # value on `sweep` of the last row; equals first if the frame has one row
    time: float = np.nan  # [s]
    strain: float = np.nan  # accumulated strain since frame 0
    rows: RowSink | None = None  # of rows that columns hold; None: they are sent at once

    def start(self) -> None:
        """Set the time of the next data to the first row of the frame."""
        self._set(self.first)

    def end(self) -> None:
        """Set the time of the next data to the last row of the frame."""
        self._set(self.last)

    def _set(self, sweep: int | None) -> None:
        moment: dict[str, int | np.timedelta64] = {entities.FRAME: self.frame}
        if np.isfinite(self.time):
            moment[entities.TIME] = _nanoseconds(self.time)
        if np.isfinite(self.strain):
            moment[entities.STRAIN] = _millionths(self.strain)
        if sweep is not None:
            moment[entities.SWEEP] = sweep
        self.stream.reset_time()
        for timeline, value in moment.items():
            if isinstance(value, np.timedelta64):
                self.stream.set_time(timeline, duration=value)
            else:
                self.stream.set_time(timeline, sequence=value)
        if self.rows is not None:
            self.rows.begin(tuple(moment.items()))

    def log(self, path: str, *parts: rr.AsComponents, static: bool = False) -> None:
        """Send archetypes of an entity at the time that was set, or at all times.

        As rows they need a message of the file together with those of many frames; the stream would hold each for
        itself, in several times the memory of its values.
        """
        if self.rows is None or static:
            self.stream.log(path, *parts, static=static)
        else:
            self.rows.add_row(path, [batch for part in parts for batch in part.as_component_batches()])

    def send(self, path: str, when: Iterable[rr.TimeColumn], columns: Iterable[rr.ComponentColumn]) -> None:
        """Send rows of an entity at their times."""
        if self.rows is None:
            self.stream.send_columns(path, when, columns)
        else:
            self.rows.add(path, when, columns)

    def send_point(self, path: str, values: Sequence[float]) -> None:
        """Send a point of the curves of an entity at the time that was set; no values are a gap."""
        if self.rows is None:
            self.stream.log(path, rr.Scalars(values))
        else:
            self.rows.add_point(path, values)

    def columns(self, rows: NDArray[np.int64]) -> list[rr.TimeColumn]:
        """Return the columns of all timelines for rows (k,) of this frame, counted from its first."""
        columns = [
            rr.TimeColumn(entities.FRAME, sequence=np.full(len(rows), self.frame, np.int64)),
            rr.TimeColumn(entities.SWEEP, sequence=self.first + rows),
        ]
        if np.isfinite(self.time):
            columns.append(rr.TimeColumn(entities.TIME, duration=np.full(len(rows), _nanoseconds(self.time))))
        if np.isfinite(self.strain):
            strain = np.full(len(rows), _millionths(self.strain), np.int64)
            columns.append(rr.TimeColumn(entities.STRAIN, sequence=strain))
        return columns


def _nanoseconds(seconds: float) -> np.timedelta64:
    return np.timedelta64(round(1e9 * seconds), "ns")


def _millionths(strain: float) -> int:
    return round(1e6 * strain)
