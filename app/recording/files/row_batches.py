"""Rows of several frames, joined to large messages: the index of a recording has an entry for every message.

An entry takes some tens of kilobytes of memory when the index is made, however little the message holds.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import cast

import numpy as np
import pyarrow as pa
import rerun as rr

from ..look.clock import Moment

LARGEST = 1_000_000  # [bytes] of one entity's rows from which on they are sent


@dataclass(slots=True)
class _Rows:
    """Rows of one entity that have the same timelines and components."""

    times: list[list[pa.Array]] = field(default_factory=list)
    parts: list[list[pa.Array]] = field(default_factory=list)
    size: int = 0  # [bytes]


@dataclass(frozen=True, slots=True)
class _Joined:
    """A column of times or of components."""

    name: rr.ComponentDescriptor | str
    arrays: list[pa.Array]

    def timeline_name(self) -> str:
        return str(self.name)

    def component_descriptor(self) -> rr.ComponentDescriptor:
        assert isinstance(self.name, rr.ComponentDescriptor)
        return self.name

    def as_arrow_array(self) -> pa.Array:
        return pa.concat_arrays(self.arrays)


class RowBatches:
    """Collects rows and points of curves of a stream until they are many, or until `send` is called."""

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._moment: Moment = ()
        self._points: dict[tuple[str, tuple[str, ...]], list[tuple[Moment, Sequence[float]]]] = {}
        self._rows: dict[tuple[str, tuple[str, ...], tuple[rr.ComponentDescriptor, ...]], _Rows] = {}

    def begin(self, moment: Moment) -> None:
        """Set the time of the points that follow."""
        self._moment = moment

    def add_point(self, path: str, values: Sequence[float]) -> None:
        """Add a point of the curves of an entity."""
        timelines = tuple(name for name, _ in self._moment)
        self._points.setdefault((path, timelines), []).append((self._moment, values))

    def add(self, path: str, when: Iterable[rr.TimeColumn], columns: Iterable[rr.ComponentColumn]) -> None:
        """Add rows of an entity."""
        times = {each.timeline_name(): each.as_arrow_array() for each in when}
        parts = {each.component_descriptor(): each.as_arrow_array() for each in columns}
        key = path, tuple(times), tuple(parts)
        rows = self._rows.setdefault(key, _Rows())
        rows.times.append(list(times.values()))
        rows.parts.append(list(parts.values()))
        rows.size += sum(array.nbytes for array in (*times.values(), *parts.values()))
        if rows.size >= LARGEST:
            self._send(key)

    def send(self, *, points: bool = True) -> None:
        """Send all rows that were added, and the points, which are small, unless they can wait."""
        for key in list(self._rows):
            self._send(key)
        if not points:
            return
        for (path, timelines), found in self._points.items():
            when = [_times(name, [moment[k][1] for moment, _ in found]) for k, name in enumerate(timelines)]
            columns = rr.Scalars.columns(scalars=[value for _, values in found for value in values])
            self._stream.send_columns(path, when, columns.partition([len(values) for _, values in found]))
        self._points.clear()

    def _send(self, key: tuple[str, tuple[str, ...], tuple[rr.ComponentDescriptor, ...]]) -> None:
        rows, (path, timelines, components) = self._rows.pop(key), key
        when = [
            _Joined(name, list(arrays)) for name, arrays in zip(timelines, zip(*rows.times, strict=True), strict=True)
        ]
        columns = [
            _Joined(name, list(arrays)) for name, arrays in zip(components, zip(*rows.parts, strict=True), strict=True)
        ]
        # The SDK takes the name and the array of a column, and no more.
        self._stream.send_columns(path, when, cast("list[rr.ComponentColumn]", columns))


def _times(timeline: str, values: Sequence[int | np.timedelta64]) -> rr.TimeColumn:
    if isinstance(values[0], np.timedelta64):
        return rr.TimeColumn(timeline, duration=np.array(values))
    return rr.TimeColumn(timeline, sequence=np.array(values, np.int64))
