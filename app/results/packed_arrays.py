"""Named arrays as bytes: a header with names, types and shapes, then the values one after the other.

A frame has more than a hundred small arrays; numpy's own file format takes longer for each name than for the values.
"""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np

LENGTH = 8  # bytes of the header's length
ALIGNMENT = 64  # bytes: every array begins at a multiple of it


def pack(arrays: Mapping[str, np.ndarray]) -> bytes:
    """Return arrays as bytes, with their types, shapes and memory order. Raises ValueError for arrays of objects."""
    parts: list[bytes] = []
    header = []
    for name, array in arrays.items():
        if array.dtype.hasobject:
            raise ValueError(f"{name} is an array of objects, which have no bytes")
        by_column = array.flags.f_contiguous and not array.flags.c_contiguous
        content = array.tobytes("F" if by_column else "C")
        header.append((name, array.dtype.str, array.shape, by_column))
        parts += content, bytes(-len(content) % ALIGNMENT)
    text = json.dumps(header).encode()
    text += b" " * (-(LENGTH + len(text)) % ALIGNMENT)
    return b"".join([len(text).to_bytes(LENGTH, "little"), text, *parts])


def unpack(content: bytes) -> dict[str, np.ndarray]:
    """Return the arrays of packed bytes as writable copies."""
    start = LENGTH + int.from_bytes(content[:LENGTH], "little")
    arrays = {}
    for name, kind, shape, by_column in json.loads(content[LENGTH:start]):
        order = "F" if by_column else "C"
        array = np.ndarray(tuple(shape), np.dtype(kind), content, start, order=order).copy(order)
        arrays[name] = array
        start += array.nbytes + -array.nbytes % ALIGNMENT
    return arrays
