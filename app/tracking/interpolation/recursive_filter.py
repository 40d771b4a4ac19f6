"""The quintic spline's coefficients of a photograph, by recursive filters along its columns and rows.

The inverse of the sampled quintic B-spline is a product of four filters along each axis, two of them backwards (Unser,
Aldroubi & Eden 1993): with poles z₁ and z₂, a[k] = λ s[k] + z₁ a[k − 1], b[k] = a[k] + z₂ b[k − 1], and the same from
the other end. That is four multiplications a pixel and axis instead of the 35 of the truncated inverse.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from ...experiment.pictures.image import Image
from .lanes import (
    ADDRESS,
    COMPILED,
    SINGLE,
    SINGLE_BYTES,
    broadcast,
    fused_multiply_add,
    load,
    store,
    transpose,
)

# Poles of the quintic spline: the roots below one of z⁴ + 26 z³ + 66 z² + 26 z + 1.
FIRST_POLE, SECOND_POLE = np.float32(-0.4305753470999738), np.float32(-0.04309628820326465)
# λ = 120 z₁ z₂ of each axis: the coefficients of a constant are that constant.
GAIN = np.float32((120.0 * 0.4305753470999738 * 0.04309628820326465) ** 2)
# Pixels that a filter begins before the first one: z₁¹⁷ is less than 1e-6.
LEAD = 17
# Rows that are filtered at a time, so that they stay in the cache, and columns of a tile.
BLOCK, TILE = 32, 8


def quintic_coefficients(image: Image) -> Image:
    """Compute the quintic spline coefficients c of an image (H, W), mirrored at its borders."""
    height, width = image.shape
    padded = -(-(width + 2 * LEAD) // TILE) * TILE
    result = np.empty((height, width), np.float32)
    filter_image(
        np.ascontiguousarray(image, np.float32), result, np.empty((BLOCK + LEAD, width), np.float32),
        np.zeros((BLOCK, padded), np.float32), np.empty((padded, BLOCK), np.float32),
        np.empty((3, width), np.float32), np.empty((2, BLOCK), np.float32),
    )  # fmt: skip
    return result


def _tile_filter(forwards: bool) -> Any:
    """An intrinsic that filters a tile of eight rows and columns along its rows.

    Forwards, the tile is read from an image and its columns are written as rows; backwards, it returns to the image.
    """
    vector = ir.VectorType(SINGLE, TILE)

    @intrinsic
    def _filter_tile(typing, image, row, column, first_pole, second_pole, state, columns):
        single = types.float32
        signature = types.void(image, types.intp, types.intp, single, single, state, columns)

        def build(context, builder, signature, arguments):
            image, row, column, first_pole, second_pole, state, columns = arguments
            image, state, columns = (
                context.make_array(signature.args[k])(context, builder, each)
                for k, each in ((0, image), (5, state), (6, columns))
            )
            beside = _offsets(builder, image, row, column)
            turned = _offsets(builder, columns, column, row)
            states = _offsets(builder, state, ir.Constant(ADDRESS, 0), row)[:2]
            z1, z2 = broadcast(builder, first_pole, vector), broadcast(builder, second_pole, vector)
            a, b = (load(builder, state.data, offset, vector) for offset in states)
            source, offsets = (image, beside) if forwards else (columns, turned)
            tile = [load(builder, source.data, offset, vector) for offset in offsets]
            tile = transpose(builder, tile) if forwards else tile
            for k in range(TILE) if forwards else reversed(range(TILE)):
                a = fused_multiply_add(builder, a, z1, tile[k])
                b = fused_multiply_add(builder, b, z2, a)
                tile[k] = b
            for each, offset in zip((a, b), states, strict=True):
                store(builder, each, state.data, offset)
            target, offsets = (columns, turned) if forwards else (image, beside)
            tile = tile if forwards else transpose(builder, tile)
            for each, offset in zip(tile, offsets, strict=True):
                store(builder, each, target.data, offset)
            return context.get_dummy_value()

        return signature, build

    return _filter_tile


def _offsets(builder, array, row, column) -> list:
    """Offsets [bytes] of the vectors that begin at a column, in eight rows."""
    stride = builder.extract_value(array.strides, 0)
    first = builder.add(builder.mul(row, stride), builder.mul(column, ir.Constant(ADDRESS, SINGLE_BYTES)))
    return [builder.add(first, builder.mul(stride, ir.Constant(ADDRESS, k))) for k in range(TILE)]


def _filter_forwards_plainly(image, row, column, first_pole, second_pole, state, columns):
    rows = slice(row, row + TILE)
    for k in range(column, column + TILE):
        state[0, rows] = state[0, rows] * first_pole + image[rows, k]
        state[1, rows] = state[1, rows] * second_pole + state[0, rows]
        columns[k, rows] = state[1, rows]


def _filter_backwards_plainly(image, row, column, first_pole, second_pole, state, columns):
    rows = slice(row, row + TILE)
    for k in reversed(range(column, column + TILE)):
        state[0, rows] = state[0, rows] * first_pole + columns[k, rows]
        state[1, rows] = state[1, rows] * second_pole + state[0, rows]
        image[rows, k] = state[1, rows]


def _filter_row_plainly(row, gain, state, before, after):
    state[:] = row * gain + FIRST_POLE * state
    after[:] = state + SECOND_POLE * before


@njit(cache=True, nogil=True, error_model="numpy")
def _filter_row_compiled(row, gain, state, before, after):
    """Filter along columns: one row (w,) with the state of the first pole and the result of the row before."""
    for k in range(len(row)):
        state[k] = row[k] * gain + FIRST_POLE * state[k]
        after[k] = state[k] + SECOND_POLE * before[k]


_forwards: Any
_backwards: Any
_filter_row: Any
if COMPILED:
    _forwards, _backwards, _filter_row = _tile_filter(True), _tile_filter(False), _filter_row_compiled
else:
    _forwards, _backwards = _filter_forwards_plainly, _filter_backwards_plainly
    _filter_row = _filter_row_plainly


@njit(cache=True, nogil=True)
def _mirror(k, count):
    """Index within 0 … count − 1 of a sequence that is mirrored at its first and last element."""
    if count == 1:
        return 0
    k = k % (2 * count - 2)
    return k if k < count else 2 * count - 2 - k


@njit(cache=True, nogil=True)
def _set_zero(rows):
    """Set an array (n, m) to zero."""
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            rows[i, k] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def filter_image(image, result, down, across, turned, column_state, row_state):
    """Filter a photograph along both axes.

    Parameters
    ----------
    image : (h, w) array
        The photograph.
    result : (h, w) array
        Receives the coefficients.
    down : (BLOCK + LEAD, w) array
        Workspace: rows filtered downwards.
    across : (BLOCK, p) array
        Workspace: a block filtered along its columns, with mirrored pixels on either side; p: a multiple of TILE.
    turned : (p, BLOCK) array
        Workspace: its columns as rows.
    column_state, row_state : (3, w) and (2, BLOCK) array
        Workspace.
    """
    height, width = image.shape
    padded = across.shape[1]
    one = np.float32(1.0)
    state, back, beyond = column_state[0:1], column_state[1:2], column_state[2:3]
    last = down[BLOCK + LEAD - 1]
    _set_zero(state)
    _set_zero(down[BLOCK + LEAD - 1 :])
    for y in range(-LEAD, 0):
        _filter_row(image[_mirror(y, height)], GAIN, state[0], last, last)
    for y in range(LEAD):
        _filter_row(image[_mirror(y, height)], GAIN, state[0], last if y == 0 else down[BLOCK + y - 1], down[BLOCK + y])
    for top in range(0, height, BLOCK):
        rows = min(BLOCK, height - top)
        for i in range(LEAD):
            for k in range(width):
                down[i, k] = down[BLOCK + i, k]
        for i in range(LEAD, LEAD + BLOCK):
            _filter_row(image[_mirror(top + i, height)], GAIN, state[0], down[i - 1], down[i])
        _set_zero(back)
        _set_zero(beyond)
        for i in range(rows + LEAD - 1, rows - 1, -1):
            _filter_row(down[i], one, back[0], beyond[0], beyond[0])
        for i in range(rows - 1, -1, -1):
            within = across[i, LEAD : LEAD + width]
            after = beyond[0] if i == rows - 1 else across[i + 1, LEAD : LEAD + width]
            _filter_row(down[i], one, back[0], after, within)
            for k in range(LEAD):
                across[i, k] = within[_mirror(k - LEAD, width)]
            for k in range(width, padded - LEAD):
                across[i, LEAD + k] = within[_mirror(k, width)]
        _set_zero(row_state)
        for x in range(0, padded, TILE):
            for y in range(0, BLOCK, TILE):
                _forwards(across, y, x, FIRST_POLE, SECOND_POLE, row_state, turned)
        _set_zero(row_state)
        for x in range(padded - TILE, -1, -TILE):
            for y in range(0, BLOCK, TILE):
                _backwards(across, y, x, FIRST_POLE, SECOND_POLE, row_state, turned)
        for i in range(rows):
            for k in range(width):
                result[top + i, k] = across[i, LEAD + k]
