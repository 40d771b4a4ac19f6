"""Projection of a photograph on the images of a patch: eight pixels at a time.

Interpolation takes nearly all of the time of correlation. Pixel by pixel, most of it is waiting: weights depend on the
place, the value on the weights. Here places and weights of eight pixels are one vector each, each row of taps of a
pixel is another one, and the eight results are one vector again.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .lanes import (
    ADDRESS,
    BYTE,
    COMPILED,
    DOUBLE,
    INDEX,
    SINGLE,
    SINGLE_BYTES,
    broadcast,
    broadcast_lane,
    constant,
    fused_multiply_add,
    load,
    shuffle,
    sum_lanes,
    transpose,
)
from .spline_values import interpolate_cubic, interpolate_quintic
from .spline_weights import build_weights

# Pixels of a block, and their numbers: dx, dy, then the images that a photograph is projected on.
LANES, COLUMNS = 8, 6
PROJECTED = 4
# Sums: of the photograph times each image, of the photograph, and of its square.
SUMS = PROJECTED + 2

SINGLES, DOUBLES, INDICES = (ir.VectorType(kind, LANES) for kind in (SINGLE, DOUBLE, INDEX))
BLOCK_BYTES, ROW_BYTES = COLUMNS * LANES * SINGLE_BYTES, LANES * SINGLE_BYTES


def _projection(degree: int) -> Any:
    """An intrinsic that projects a photograph, interpolated with a spline of degree 3 or 5.

    Arguments: coefficients (h, w); blocks (b, 6, 8) of a patch's pixels; the number of pixels; column and row that
    places are relative to, so that single precision suffices; x and y of the centre, relative to them [px]; cosine and
    sine of the rotation; the grey level that is subtracted; and sums (6,) that are written.

    The vector of a quintic row loads two columns beyond its taps. They exist in memory: the lowest pixels of a disc
    are not the rightmost ones.
    """
    taps, before = degree + 1, degree // 2
    row_of_taps = ir.VectorType(SINGLE, 4 if taps <= 4 else 8)

    @intrinsic
    def _project(typing, coefficients, blocks, count, column, row, x, y, cos, sin, level, sums):
        single, whole = types.float32, types.intp
        signature = types.void(
            coefficients, blocks, whole, whole, whole, single, single, single, single, single, sums
        )  # fmt: skip

        def build(context, builder, signature, arguments):
            photograph, pixels, sums = (
                context.make_array(signature.args[k])(context, builder, arguments[k]) for k in (0, 1, 10)
            )
            count, column, row = arguments[2:5]
            x, y, cos, sin, level = (broadcast(builder, each, SINGLES) for each in arguments[5:10])
            stride = builder.extract_value(photograph.strides, 0)
            rows = _rows_of_taps(builder, photograph, column, row, before, taps)
            columns = builder.trunc(builder.sdiv(stride, ADDRESS(SINGLE_BYTES)), INDEX)
            columns = broadcast(builder, columns, INDICES)
            totals = [cgutils.alloca_once_value(builder, constant(DOUBLES, 0.0)) for _ in range(SUMS)]
            with cgutils.for_range(builder, builder.sdiv(builder.add(count, ADDRESS(LANES - 1)), ADDRESS(LANES))) as at:
                begin = builder.mul(at.index, ADDRESS(BLOCK_BYTES))
                dx, dy, *images = (
                    load(builder, pixels.data, builder.add(begin, ADDRESS(k * ROW_BYTES)), SINGLES)
                    for k in range(COLUMNS)
                )
                place_x = fused_multiply_add(builder, builder.fneg(sin), dy, x)
                place_x = fused_multiply_add(builder, cos, dx, place_x)
                place_y = fused_multiply_add(builder, cos, dy, y)
                place_y = fused_multiply_add(builder, sin, dx, place_y)
                ix, iy = (builder.fptosi(each, INDICES) for each in (place_x, place_y))
                part_x = builder.fsub(place_x, builder.sitofp(ix, SINGLES))
                part_y = builder.fsub(place_y, builder.sitofp(iy, SINGLES))
                places = builder.add(builder.mul(iy, columns), ix)
                g = _interpolate(builder, rows, row_of_taps, places, build_weights(builder, degree, part_x),
                                 build_weights(builder, degree, part_y))  # fmt: skip
                left = builder.trunc(builder.sub(count, builder.mul(at.index, ADDRESS(LANES))), INDEX)
                counted = builder.icmp_signed(
                    "<", ir.Constant(INDICES, list(range(LANES))), broadcast(builder, left, INDICES)
                )  # fmt: skip
                g = builder.select(counted, builder.fsub(g, level), constant(SINGLES, 0.0))
                _add(builder, totals, builder.fpext(g, DOUBLES), [builder.fpext(each, DOUBLES) for each in images])
            for k, total in enumerate(totals):
                builder.store(sum_lanes(builder, builder.load(total)), builder.gep(sums.data, [ADDRESS(k)]))
            return context.get_dummy_value()

        return signature, build

    return _project


def _rows_of_taps(builder, photograph, column, row, before: int, taps: int) -> list:
    """Addresses of the first tap of the point at a column and row, in each row of taps."""
    stride = builder.extract_value(photograph.strides, 0)
    first = builder.mul(builder.sub(row, ADDRESS(before)), stride)
    first = builder.add(first, builder.mul(builder.sub(column, ADDRESS(before)), ADDRESS(SINGLE_BYTES)))
    rows = [builder.gep(builder.bitcast(photograph.data, BYTE.as_pointer()), [first])]
    for _ in range(taps - 1):
        rows.append(builder.gep(rows[-1], [stride]))
    return rows


def _interpolate(builder, rows: list, row_of_taps, places, across: list, down: list):
    """Values at eight places: rows of taps times the weights down, transposed, times the weights across."""
    lanes = row_of_taps.count
    values = []
    for k in range(LANES):
        place = builder.sext(builder.extract_element(places, INDEX(k)), ADDRESS)
        offset = builder.mul(place, ADDRESS(SINGLE_BYTES))
        total = None
        for address, weights in zip(rows, down, strict=True):
            taps = load(builder, address, offset, row_of_taps)
            weight = broadcast_lane(builder, weights, k, lanes)
            total = builder.fmul(taps, weight) if total is None else fused_multiply_add(builder, taps, weight, total)
        values.append(total)
    if lanes < LANES:  # two squares side by side
        values = [shuffle(builder, values[k], values[k + lanes], list(range(2 * lanes))) for k in range(lanes)]
    columns = transpose(builder, values)
    value = builder.fmul(columns[0], across[0])
    for column, weight in zip(columns[1 : len(across)], across[1:], strict=True):
        value = fused_multiply_add(builder, column, weight, value)
    return value


def _add(builder, totals: list, g, images: list) -> None:
    """Add eight values times the images, the values, and their squares."""
    for total, image in zip(totals, images, strict=False):
        builder.store(fused_multiply_add(builder, image, g, builder.load(total)), total)
    builder.store(builder.fadd(builder.load(totals[PROJECTED]), g), totals[PROJECTED])
    builder.store(fused_multiply_add(builder, g, g, builder.load(totals[-1])), totals[-1])


def _plain_projection(interpolate: Any) -> Any:
    def _project(coefficients, blocks, count, column, row, x, y, cos, sin, level, sums):
        pixels = blocks.transpose(0, 2, 1).reshape(-1, COLUMNS)[:count]
        dx, dy = pixels[:, 0], pixels[:, 1]
        place_x, place_y = x + cos * dx - sin * dy, y + sin * dx + cos * dy
        ix, iy = place_x.astype(int), place_y.astype(int)
        g = interpolate(
            coefficients, column + ix, row + iy, place_x - ix.astype(np.float32), place_y - iy.astype(np.float32)
        )  # fmt: skip
        g = (g - level).astype(np.float64)
        sums[:PROJECTED] = g @ pixels[:, COLUMNS - PROJECTED :]
        sums[PROJECTED:] = g.sum(), g @ g

    return _project


project_cubic: Any
project_quintic: Any
if COMPILED:
    project_cubic, project_quintic = _projection(3), _projection(5)
else:
    project_cubic, project_quintic = _plain_projection(interpolate_cubic), _plain_projection(interpolate_quintic)
