"""Sequences whose members are made when they are asked for: a run of any length takes the memory of one frame."""

from __future__ import annotations

import operator
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar, overload

T = TypeVar("T")


class Lazily(Sequence[T], Generic[T]):
    """`count` members, each made anew whenever it is asked for."""

    def __init__(self, count: int, make: Callable[[int], T]) -> None:
        self._count, self._make = count, make

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> list[T]: ...
    def __getitem__(self, index: int | slice) -> T | list[T]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(self._count))]
        k = operator.index(index)
        k += self._count if k < 0 else 0
        if not 0 <= k < self._count:
            raise IndexError(f"there is no frame {index} of {self._count}")
        return self._make(k)

    def __reduce__(self) -> tuple[Any, ...]:
        return list, (list(self),)  # another process cannot make them


class Remembered(Lazily[T]):
    """The same, of which as many as find room are kept, those that were asked for last."""

    def __init__(self, count: int, make: Callable[[int], T], size: Callable[[T], int], room: int) -> None:
        """size, room [bytes]: of a member, and of all that are kept."""
        super().__init__(count, self._recall)
        self._anew, self._size, self._room = make, size, room
        self._kept: OrderedDict[int, tuple[T, int]] = OrderedDict()
        self._taken = 0
        self._lock = threading.Lock()

    def grow(self, count: int) -> None:
        """There are more of them now."""
        self._count = count

    def _recall(self, k: int) -> T:
        with self._lock:
            if k in self._kept:
                self._kept.move_to_end(k)
                return self._kept[k][0]
        member = self._anew(k)
        size = self._size(member)
        with self._lock:
            if k not in self._kept:
                self._kept[k] = member, size
                self._taken += size
            while self._taken > self._room and len(self._kept) > 1:
                self._taken -= self._kept.popitem(last=False)[1][1]
        return member
