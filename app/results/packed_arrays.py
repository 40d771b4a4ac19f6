"""Arrays by name as bytes, and back: a list of what there is, then the numbers one after the other.

A frame has more than a hundred small arrays; numpy's own files take longer for the name of each than for its numbers.
"""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np

LENGTH = 8  # bytes that tell the length of the list
ALIGNED = 64  # bytes that every array begins at a multiple of


def pack(arrays: Mapping[str, np.ndarray]) -> bytes:
    """All arrays with type, shape and order in memory. Raises ValueError for arrays of objects."""
    parts: list[bytes] = []
    told = []
    for name, array in arrays.items():
        if array.dtype.hasobject:
            raise ValueError(f"{name} is an array of objects, which have no bytes")
        by_column = array.flags.f_contiguous and not array.flags.c_contiguous
        content = array.tobytes("F" if by_column else "C")
        told.append((name, array.dtype.str, array.shape, by_column))
        parts += content, bytes(-len(content) % ALIGNED)
    listed = json.dumps(told).encode()
    listed += b" " * (-(LENGTH + len(listed)) % ALIGNED)
    return b"".join([len(listed).to_bytes(LENGTH, "little"), listed, *parts])


def unpack(content: bytes) -> dict[str, np.ndarray]:
    """The arrays again, each for itself: they may be written to."""
    start = LENGTH + int.from_bytes(content[:LENGTH], "little")
    arrays = {}
    for name, kind, shape, by_column in json.loads(content[LENGTH:start]):
        order = "F" if by_column else "C"
        array = np.ndarray(tuple(shape), np.dtype(kind), content, start, order=order).copy(order)
        arrays[name] = array
        start += array.nbytes + -array.nbytes % ALIGNED
    return arrays
