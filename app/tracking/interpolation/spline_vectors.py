"""Vectorised spline interpolation at one point: several taps in one instruction.

Compilers multiply the taps of a point one by one; here each row of taps is one vector. Without compilation, the plain
functions of `spline_values` are used.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .lanes import (
    COMPILED,
    SINGLE,
    SINGLE_BYTES,
    broadcast,
    broadcast_lane,
    evaluate_polynomial,
    fused_multiply_add,
    load,
    sum_lanes,
)
from .spline_values import interpolate_cubic, interpolate_quintic
from .spline_weights import weight_polynomials


def _spline_reader(degree: int, lanes: int):
    """An intrinsic that interpolates a spline; lanes: length of a vector, the taps of a row and padding of weight zero.

    The padding loads a column beyond the taps on either side, which must exist in memory.
    """
    taps = degree + 1
    padding = (lanes - taps) // 2
    before = degree // 2  # rows and columns of taps before the point's own
    vector = ir.VectorType(SINGLE, lanes)

    @intrinsic
    def read(typing, coefficients, ix, iy, tx, ty):
        signature = types.float32(coefficients, types.intp, types.intp, types.float32, types.float32)

        def build(context, builder, signature, arguments):
            polynomials = weight_polynomials(degree, -before - padding, lanes)
            photograph, column, row, part_x, part_y = arguments
            array = context.make_array(signature.args[0])(context, builder, photograph)
            stride = builder.extract_value(array.strides, 0)
            whole = stride.type
            row = builder.sub(row, ir.Constant(whole, before))
            column = builder.sub(column, ir.Constant(whole, before + padding))
            offset = builder.add(builder.mul(row, stride), builder.mul(column, ir.Constant(whole, SINGLE_BYTES)))
            across, down = (
                _weights(builder, polynomials, broadcast(builder, part, vector)) for part in (part_x, part_y)
            )
            total = None
            for k in range(taps):
                pixels = load(builder, array.data, offset, vector)
                weight = broadcast_lane(builder, down, k + padding, lanes)
                product = builder.fmul(pixels, weight)
                total = product if total is None else fused_multiply_add(builder, pixels, weight, total)
                offset = builder.add(offset, stride)
            return sum_lanes(builder, builder.fmul(total, across))

        return signature, build

    return read


def _weights(builder, coefficients, t):
    """Evaluate Σ c[d] t^d in every lane; coefficients (d, lanes)."""
    constants = [ir.Constant(t.type, row.astype("f4").astype("f8").tolist()) for row in coefficients]
    return evaluate_polynomial(builder, constants, t)


# (coefficients, ix, iy, tx, ty): the spline at (ix + tx, iy + ty), 0 ≤ t < 1, as in `spline_values`.
read_cubic: Any
read_quintic: Any
if COMPILED:
    read_cubic, read_quintic = _spline_reader(3, 4), _spline_reader(5, 8)
else:
    read_cubic, read_quintic = interpolate_cubic, interpolate_quintic
