"""Sequences whose items are made on access: a run of any length needs the memory of one frame."""

from __future__ import annotations

import operator
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar, overload

T = TypeVar("T")


class LazySequence(Sequence[T], Generic[T]):
    """A sequence of `count` items, each made again on every access."""

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
            raise IndexError(f"index {index} is out of range: there are {self._count} frames")
        return self._item(k)

    def _item(self, k: int) -> T:
        # Caches override this: their own method as `_make` would be a reference cycle, which outlives its last use.
        return self._make(k)

    def __reduce__(self) -> tuple[Any, ...]:
        return list, (list(self),)  # another process cannot make the items


class CachedSequence(LazySequence[T]):
    """A lazy sequence with a cache of the most recent items."""

    def __init__(self, count: int, make: Callable[[int], T], size: Callable[[T], int], capacity: int) -> None:
        """Make a sequence of `count` items; size: bytes of an item; capacity: bytes of the cache."""
        super().__init__(count, make)
        self._size, self._capacity = size, capacity
        self._cache: OrderedDict[int, tuple[T, int]] = OrderedDict()
        self._used = 0
        self._lock = threading.Lock()

    def extend_to(self, count: int) -> None:
        """Set a larger number of items."""
        self._count = count

    def _item(self, k: int) -> T:
        with self._lock:
            if k in self._cache:
                self._cache.move_to_end(k)
                return self._cache[k][0]
        item = self._make(k)
        size = self._size(item)
        with self._lock:
            if k not in self._cache:
                self._cache[k] = item, size
                self._used += size
            while self._used > self._capacity and len(self._cache) > 1:
                self._used -= self._cache.popitem(last=False)[1][1]
        return item
