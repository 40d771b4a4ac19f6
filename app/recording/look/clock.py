"""Positions of rows on the timelines: frame number, time, strain and sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from . import entities


@dataclass(frozen=True, slots=True)
class Clock:
    """Places the rows of one frame on all timelines; on those of time and strain only where these are known."""

    stream: rr.RecordingStream
    frame: int
    first: int  # value on `sweep` of the frame's first row
    last: int  # value on `sweep` of the last row; equals first if the frame has one row
    time: float = np.nan  # [s]
    strain: float = np.nan  # accumulated strain since frame 0

    def start(self) -> None:
        """Set the time of the next data to the first row of the frame."""
        self._set(self.first)

    def end(self) -> None:
        """Set the time of the next data to the last row of the frame."""
        self._set(self.last)

    def frame_only(self) -> None:
        """Set the time of the next data to the frame, without a value on `sweep`."""
        self.stream.reset_time()
        self.stream.set_time(entities.FRAME, sequence=self.frame)
        if np.isfinite(self.time):
            self.stream.set_time(entities.TIME, duration=_nanoseconds(self.time))
        if np.isfinite(self.strain):
            self.stream.set_time(entities.STRAIN, sequence=_millionths(self.strain))

    def _set(self, sweep: int) -> None:
        self.frame_only()
        self.stream.set_time(entities.SWEEP, sequence=sweep)

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
