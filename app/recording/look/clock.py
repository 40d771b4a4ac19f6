"""Where rows stand on the timelines: of photographs by number, time and strain, and of sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.strain import way_of

from . import entities


@dataclass(frozen=True, slots=True)
class Clock:
    """Puts rows at the right place of all timelines. Where time or strain are not known, rows are not on theirs."""

    stream: rr.RecordingStream
    frame: int
    first: int  # value on `sweep` of the frame's first row
    last: int  # … of its last row, first where the frame has one row only
    time: float = np.nan  # [s]
    strain: float = np.nan  # way of the strain since frame 0

    def start(self) -> None:
        """What is logged next belongs to the frame's first row."""
        self._set(self.first)

    def end(self) -> None:
        """What is logged next belongs to the frame's last row."""
        self._set(self.last)

    def frame_only(self) -> None:
        """What is logged next belongs to the frame on its own timelines, and to nothing on `sweep`."""
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
        """All timelines for rows of this frame, counted from its first (k,)."""
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


class StrainWay:
    """How far the strain of a packing has gone since frame 0, frame by frame."""

    def __init__(self) -> None:
        self._gone = np.nan
        self._former: Array | None = None

    def go(self, strain: Array | None) -> float:
        """The way up to a frame of this strain (2, 2) since frame 0; where it is not known, that of the frame before.

        NaN until one is known.
        """
        if strain is None or not np.isfinite(strain).all():
            return self._gone
        self._gone = 0.0 if self._former is None else self._gone + way_of(strain - self._former)
        self._former = strain
        return self._gone


def strain_ways(strains: Sequence[Array | None]) -> list[float]:
    """The ways of all frames of a run, from their strains (2, 2) since frame 0."""
    way = StrainWay()
    return [way.go(strain) for strain in strains]


def _nanoseconds(seconds: float) -> np.timedelta64:
    return np.timedelta64(round(1e9 * seconds), "ns")


def _millionths(strain: float) -> int:
    return round(1e6 * strain)
