"""Named arrays as bytes: a header with names, types and shapes, then the values one after the other.

A frame has more than a hundred small arrays; numpy's own file format takes longer for each name than for the values.
"""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np

LENGTH = 8  # bytes of the header's length
ALIGNMENT = 64  # bytes: every array begins at a multiple of it
COPIED = 4096  # bytes: smaller arrays are copied


def pack(arrays: Mapping[str, np.ndarray]) -> list[bytes | memoryview]:
    """Return arrays as pieces of bytes, with their types, shapes and memory order.

    Large arrays are not copied: the pieces are valid as long as the arrays do not change. Raises ValueError for arrays
    of objects.
    """
    parts: list[bytes | memoryview] = []
    header = []
    for name, array in arrays.items():
        if array.dtype.hasobject:
            raise ValueError(f"{name} is an array of objects, which have no bytes")
        by_column = array.flags.f_contiguous and not array.flags.c_contiguous
        header.append((name, array.dtype.str, array.shape, by_column))
        if array.nbytes < COPIED:
            parts.append(array.tobytes("F" if by_column else "C"))
        else:
            rows = np.ascontiguousarray(array.T if by_column else array)
            parts.append(rows.reshape(-1).view(np.uint8).data)
        parts.append(bytes(-array.nbytes % ALIGNMENT))
    text = json.dumps(header).encode()
    text += b" " * (-(LENGTH + len(text)) % ALIGNMENT)
    return [len(text).to_bytes(LENGTH, "little"), text, *parts]


def unpack(content: bytes | memoryview, prefixes: tuple[str, ...] = ("",)) -> dict[str, np.ndarray]:
    """Return the arrays of packed bytes whose names begin with one of the prefixes, as writable copies."""
    start = LENGTH + int.from_bytes(content[:LENGTH], "little")
    arrays = {}
    for name, kind, shape, by_column in json.loads(bytes(content[LENGTH:start])):
        order = "F" if by_column else "C"
        array = np.ndarray(tuple(shape), np.dtype(kind), content, start, order=order)
        if name.startswith(prefixes):
            arrays[name] = array.copy(order)
        start += array.nbytes + -array.nbytes % ALIGNMENT
    return arrays
