"""Positions of rows on the timelines: frame number, time, strain and sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...solver.bodies.strain import strain_magnitude
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


class AccumulatedStrain:
    """The strain of a packing accumulated over its steps since frame 0."""

    def __init__(self) -> None:
        self._accumulated = np.nan
        self._previous: Array | None = None

    def add(self, strain: Array | None) -> float:
        """Add a frame.

        Parameters
        ----------
        strain : array (2, 2), optional
            Strain of the frame since frame 0; None or NaN: not known.

        Returns
        -------
        float
            Strain accumulated up to this frame. Where the strain is not known, the value of the frame before; NaN
            until one is known.
        """
        if strain is None or not np.isfinite(strain).all():
            return self._accumulated
        previous = self._previous
        self._accumulated = 0.0 if previous is None else self._accumulated + strain_magnitude(strain - previous)
        self._previous = strain
        return self._accumulated


def accumulated_strains(strains: Sequence[Array | None]) -> list[float]:
    """Return the accumulated strains of all frames of a run, from their strains (2, 2) since frame 0."""
    accumulated = AccumulatedStrain()
    return [accumulated.add(strain) for strain in strains]


def _nanoseconds(seconds: float) -> np.timedelta64:
    return np.timedelta64(round(1e9 * seconds), "ns")


def _millionths(strain: float) -> int:
    return round(1e6 * strain)
