"""Rows of several frames, joined to large messages: the index of a recording has an entry for every message.

An entry takes some tens of kilobytes of memory until the file is complete, however little the message holds. Rows
therefore wait, in a bounded memory: the longer the run, the larger the messages of the entities with the most values.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import cast

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from ...process.machine.free_memory import release_free_memory
from ..look.clock import Moment

WAITING = 24_000_000  # [bytes] of all rows, from which on those of the entity with the most are sent
HELD = 3_000_000  # [bytes] of all rows that are sent at once, from which on the stream is flushed between entities
PIECES = 32  # arrays that are joined to one: each takes some hundred bytes beside its values

_Names = tuple["rr.ComponentDescriptor | str", ...]
_Key = tuple[_Names, _Names, tuple[pa.DataType, ...]]  # timelines, components, types


@dataclass(slots=True)
class _Rows:
    """Rows of one entity that have the same timelines and components."""

    columns: list[list[pa.Array]]  # of the timelines, then of the components

    def add(self, arrays: Sequence[pa.Array]) -> int:
        """Add one array to every column; return their size [bytes]."""
        for column, each in zip(self.columns, arrays, strict=True):
            column.append(each)
        if len(self.columns[0]) >= PIECES:
            self.columns = [[_joined(column)] for column in self.columns]
        return sum(each.nbytes for each in arrays)


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
        return _joined(self.arrays)


@dataclass(slots=True)
class _Times:
    """The moments at which points were added, on the same timelines."""

    first: Moment
    times: list[array[int]]  # of every timeline
    last: Moment = ()

    def place(self, moment: Moment) -> int:
        """Return the number of a moment, which is added if it is not the last one."""
        if moment != self.last:
            for times, (_, value) in zip(self.times, moment, strict=True):
                times.append(_whole(value))
            self.last = moment
        return len(self.times[0]) - 1


@dataclass(slots=True)
class _Points:
    """Points of the curves of one entity, in a hundredth of the memory of their rows."""

    places: array[int] = field(default_factory=lambda: array("i"))  # numbers of their moments
    counts: array[int] = field(default_factory=lambda: array("H"))
    values: array[float] = field(default_factory=lambda: array("d"))


class RowBatches:
    """Collects rows and points of curves of a stream until they are many, or until `send` is called.

    Rows of one entity are sent together: where several have the same time on a timeline, the viewer shows the one that
    was sent last.

    Parameters
    ----------
    stream : RecordingStream
        The stream.
    flush : callable
        Sends all logged data of the stream.
    """

    def __init__(
        self, stream: rr.RecordingStream, flush: Callable[[rr.RecordingStream], None] = rr.RecordingStream.flush
    ) -> None:
        self._stream, self._flush = stream, flush
        self._moment: Moment = ()
        self._times: list[pa.Array] | None = None  # of the moment
        self._moments: dict[_Names, _Times] = {}  # of points, by timelines: most curves have one at each
        self._points: dict[tuple[str, _Names], _Points] = {}
        self._rows: dict[str, dict[_Key, _Rows]] = {}  # by path; keys stay, in the order of their first rows
        self._sizes: dict[str, int] = {}  # [bytes] of the rows of a path
        self._size = 0  # [bytes] of all rows

    def begin(self, moment: Moment) -> None:
        """Set the time of the rows and points that follow."""
        self._moment, self._times = moment, None

    def add_point(self, path: str, values: Sequence[float]) -> None:
        """Add a point of the curves of an entity."""
        timelines = tuple(name for name, _ in self._moment)
        moments = self._moments.get(timelines)
        if moments is None:
            moments = self._moments[timelines] = _Times(self._moment, [array("q") for _ in timelines])
        points = self._points.setdefault((path, timelines), _Points())
        points.places.append(moments.place(self._moment))
        points.counts.append(len(values))
        points.values.extend(values)

    def add_row(self, path: str, parts: Sequence[rr.DescribedComponentBatch]) -> None:
        """Add one row of an entity at the time that was set."""
        if self._times is None:
            self._times = [_times(value, np.array([_whole(value)], np.int64)) for _, value in self._moment]
        values = [_one_row(each.as_arrow_array()) for each in parts]
        descriptors = tuple(each.component_descriptor() for each in parts)
        self._add(path, tuple(name for name, _ in self._moment), descriptors, [*self._times, *values])

    def add(self, path: str, when: Iterable[rr.TimeColumn], columns: Iterable[rr.ComponentColumn]) -> None:
        """Add rows of an entity."""
        times = {each.timeline_name(): each.as_arrow_array() for each in when}
        parts = {each.component_descriptor(): each.as_arrow_array() for each in columns}
        self._add(path, tuple(times), tuple(parts), [*times.values(), *parts.values()])

    def send(self) -> None:
        """Send all rows and points that were added; what the stream holds of them meanwhile is bounded."""
        held = 0
        for path in list(self._sizes):
            held = self._flush_beyond(held + self._sizes[path])
            self._send(path)
        for (path, timelines), points in self._points.items():
            moments, at = self._moments[timelines], np.array(points.places)
            when = [
                _Joined(name, [_times(value, np.array(times)[at])])
                for (name, value), times in zip(moments.first, moments.times, strict=True)
            ]
            held = self._flush_beyond(held + 8 * (len(points.values) + len(at) * len(when)))
            columns = rr.Scalars.columns(scalars=np.array(points.values))
            self._stream.send_columns(path, when, columns.partition(np.array(points.counts)))
        self._points.clear()
        self._moments.clear()

    def _flush_beyond(self, held: int) -> int:
        """Flush the stream if it holds HELD bytes or more; return what it holds then [bytes]."""
        if held < HELD:
            return held
        self._flush(self._stream)
        release_free_memory()
        return 0

    def _add(self, path: str, timelines: _Names, components: _Names, arrays: list[pa.Array]) -> None:
        of_path = self._rows.setdefault(path, {})
        key = timelines, components, tuple(each.type for each in arrays)
        rows = of_path.get(key)
        if rows is None:
            rows = of_path[key] = _Rows([[] for _ in arrays])
        size = rows.add(arrays)
        self._sizes[path] = self._sizes.get(path, 0) + size
        self._size += size
        if self._size >= WAITING:
            self._send(max(self._sizes, key=self._sizes.__getitem__))

    def _send(self, path: str) -> None:
        self._size -= self._sizes.pop(path, 0)
        for (timelines, components, _), rows in self._rows[path].items():
            if not rows.columns[0]:
                continue
            columns = [
                _Joined(name, arrays) for name, arrays in zip(chain(timelines, components), rows.columns, strict=True)
            ]
            rows.columns = [[] for _ in rows.columns]
            when, values = columns[: len(timelines)], columns[len(timelines) :]
            # The SDK takes the name and the array of a column, and no more.
            self._stream.send_columns(path, when, cast("list[rr.ComponentColumn]", values))


def _whole(value: int | np.timedelta64) -> int:
    """Return the value on a timeline as a whole number, of nanoseconds for a duration."""
    return int(value.astype("m8[ns]").astype(np.int64)) if isinstance(value, np.timedelta64) else value


def _times(kind: int | np.timedelta64, values: NDArray[np.int64]) -> pa.Array:
    """Return whole numbers as times of the kind of a value."""
    return pa.array(values.view("m8[ns]") if isinstance(kind, np.timedelta64) else values)


def _one_row(values: pa.Array) -> pa.Array:
    return pa.ListArray.from_arrays(np.array([0, len(values)], np.int32), values)


def _joined(arrays: list[pa.Array]) -> pa.Array:
    # The default pool would keep several times the memory of arrays that grow.
    return pa.concat_arrays(arrays, memory_pool=pa.system_memory_pool())
