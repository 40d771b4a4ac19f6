"""Vectorised spline interpolation: several taps in one instruction.

Interpolation takes nearly all of the time of correlation. Compilers multiply the taps of one point one by one; here
each row of taps is one vector. The order of additions is fixed, so that results are bit-identical on every machine.
Without compilation, the plain functions of `interpolation` are used.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from ...solver.bodies.grains import Array
from . import interpolation

SINGLE, DOUBLE, INDEX, BYTE = ir.FloatType(), ir.DoubleType(), ir.IntType(32), ir.IntType(8)
SINGLE_BYTES = 4

# Columns of a patch's data: the position, then the images that a photograph is projected on.
PLACE, PROJECTED = 2, 4


def weight_polynomials(degree: int, first: int, lanes: int) -> Array:
    """Coefficients (degree + 1, lanes) of the powers of 0 ≤ t < 1 in the weights of the taps first, first + 1, …"""
    from scipy.interpolate import BSpline  # slow to import, and compiled readers do not need it

    spline = BSpline.basis_element(np.arange(degree + 2) - 0.5 * (degree + 1), extrapolate=False)
    t = np.linspace(0.0, 1.0, degree + 1)
    weight = np.nan_to_num(spline(t[:, None] - (first + np.arange(lanes))))
    return np.asarray(np.linalg.solve(np.vander(t, degree + 1, increasing=True), weight), np.float64)


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
            across = _polynomial(builder, polynomials, part_x, vector)
            down = _polynomial(builder, polynomials, part_y, vector)
            total = None
            for k in range(taps):
                pixels = _load(builder, array.data, offset, vector, SINGLE_BYTES)
                weight = _broadcast(builder, down, k + padding)
                product = builder.fmul(pixels, weight)
                total = product if total is None else _fused_multiply_add(builder, pixels, weight, total)
                offset = builder.add(offset, stride)
            return _sum_lanes(builder, builder.fmul(total, across))

        return signature, build

    return read


def _polynomial(builder, coefficients: Array, t, vector):
    """Evaluate Σ c[d] t^d in every lane by Horner's rule."""
    single = builder.insert_element(ir.Constant(vector, ir.Undefined), t, INDEX(0))
    t = _broadcast(builder, single, 0)
    constants = [ir.Constant(vector, [float(np.float32(value)) for value in row]) for row in coefficients]
    result = constants[-1]
    for constant in reversed(constants[:-1]):
        result = _fused_multiply_add(builder, result, t, constant)
    return result


def _load(builder, data, offset, vector, alignment: int):
    """Load the vector at an offset [bytes]."""
    begin = builder.gep(builder.bitcast(data, BYTE.as_pointer()), [offset])
    loaded = builder.load(builder.bitcast(begin, vector.as_pointer()))
    loaded.align = alignment
    return loaded


def _broadcast(builder, vector, lane: int):
    """Copy one lane to every lane."""
    chosen = ir.Constant(ir.VectorType(INDEX, vector.type.count), [lane] * vector.type.count)
    return builder.shuffle_vector(vector, ir.Constant(vector.type, ir.Undefined), chosen)


def _fused_multiply_add(builder, a, b, c):
    """Compute a · b + c, rounded once."""
    kind = f"v{a.type.count}f{64 if a.type.element == DOUBLE else 32}"
    multiply_add = cgutils.get_or_insert_function(
        builder.module, ir.FunctionType(a.type, (a.type,) * 3), f"llvm.fma.{kind}"
    )
    return builder.call(multiply_add, (a, b, c))


def _sum_lanes(builder, vector):
    """Sum all lanes, halves onto halves."""
    while vector.type.count > 1:
        half = vector.type.count // 2
        lanes = ir.VectorType(INDEX, half)
        parts = [ir.Constant(lanes, list(range(begin, begin + half))) for begin in (0, half)]
        low, high = (builder.shuffle_vector(vector, vector, part) for part in parts)
        vector = builder.fadd(low, high)
    return builder.extract_element(vector, INDEX(0))


@intrinsic
def _add_projections(typing, sums, data, p, g):
    """Add g · data[p, 2:6] to sums (4,) in double precision."""
    signature = types.void(sums, data, types.intp, types.float32)

    def build(context, builder, signature, arguments):
        total, rows, p, g = arguments
        total = context.make_array(signature.args[0])(context, builder, total)
        rows = context.make_array(signature.args[1])(context, builder, rows)
        stride = builder.extract_value(rows.strides, 0)
        offset = builder.add(builder.mul(p, stride), ir.Constant(stride.type, PLACE * SINGLE_BYTES))
        singles, doubles = (ir.VectorType(kind, PROJECTED) for kind in (SINGLE, DOUBLE))
        row = builder.fpext(_load(builder, rows.data, offset, singles, SINGLE_BYTES), doubles)
        one = builder.insert_element(ir.Constant(doubles, ir.Undefined), builder.fpext(g, DOUBLE), INDEX(0))
        address = builder.bitcast(total.data, doubles.as_pointer())
        before = builder.load(address)
        before.align = 8
        array = builder.store(_fused_multiply_add(builder, row, _broadcast(builder, one, 0), before), address)
        array.align = 8
        return context.get_dummy_value()

    return signature, build


def _add_projections_plainly(sums: Array, data: Array, p: int, g: float) -> None:
    sums += np.float64(g) * data[p, PLACE : PLACE + PROJECTED]


# (coefficients, ix, iy, tx, ty): the spline at (ix + tx, iy + ty), 0 ≤ t < 1, as in `interpolation`.
read_cubic: Any
read_quintic: Any
add_projections: Any
if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
    read_cubic, read_quintic = interpolation.interpolate_cubic, interpolation.interpolate_quintic
    add_projections = _add_projections_plainly
else:
    read_cubic, read_quintic = _spline_reader(3, 4), _spline_reader(5, 8)
    add_projections = _add_projections
