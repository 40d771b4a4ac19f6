"""Splines between the pixels, several taps in one instruction.

Reading a photograph between its pixels is nearly all that correlation does. Compilers leave the taps of one point as
single multiplications; here each row of them is one vector. The order of additions is written down, so that the bits
are the same on every machine. Uncompiled, the plain functions of `interpolation` stand in.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from scipy.interpolate import BSpline

from solver.bodies.grains import Array

from . import interpolation

SINGLE, DOUBLE, INDEX, BYTE = ir.FloatType(), ir.DoubleType(), ir.IntType(32), ir.IntType(8)
SINGLE_BYTES = 4

# Columns of a patch's data: where it is, then what a photograph is projected on.
PLACE, PROJECTED = 2, 4


def weight_polynomials(degree: int, first: int, lanes: int) -> Array:
    """Coefficients (degree + 1, lanes) of the powers of 0 ≤ t < 1 in the weights of the taps first, first + 1, …"""
    spline = BSpline.basis_element(np.arange(degree + 2) - 0.5 * (degree + 1), extrapolate=False)
    t = np.linspace(0.0, 1.0, degree + 1)
    weight = np.nan_to_num(spline(t[:, None] - (first + np.arange(lanes))))
    return np.asarray(np.linalg.solve(np.vander(t, degree + 1, increasing=True), weight), np.float64)


def _reader(degree: int, lanes: int):
    """What reads a spline of some degree; lanes: the taps of a row with as many of weight zero as fill a vector.

    One column beyond the taps of either side is loaded where lanes are to spare: it must be in memory, no more.
    """
    taps = degree + 1
    spare = (lanes - taps) // 2
    before = degree // 2  # rows and columns of taps before the point's own
    polynomials = weight_polynomials(degree, -before - spare, lanes)
    vector = ir.VectorType(SINGLE, lanes)

    @intrinsic
    def read(typing, coefficients, ix, iy, tx, ty):
        signature = types.float32(coefficients, types.intp, types.intp, types.float32, types.float32)

        def build(context, builder, signature, arguments):
            photograph, column, row, part_x, part_y = arguments
            stored = context.make_array(signature.args[0])(context, builder, photograph)
            stride = builder.extract_value(stored.strides, 0)
            whole = stride.type
            row = builder.sub(row, ir.Constant(whole, before))
            column = builder.sub(column, ir.Constant(whole, before + spare))
            at = builder.add(builder.mul(row, stride), builder.mul(column, ir.Constant(whole, SINGLE_BYTES)))
            across = _polynomial(builder, polynomials, part_x, vector)
            down = _polynomial(builder, polynomials, part_y, vector)
            total = None
            for k in range(taps):
                pixels = _load(builder, stored.data, at, vector, SINGLE_BYTES)
                weight = _repeat(builder, down, k + spare)
                product = builder.fmul(pixels, weight)
                total = product if total is None else _add_product(builder, pixels, weight, total)
                at = builder.add(at, stride)
            return _sum(builder, builder.fmul(total, across))

        return signature, build

    return read


def _polynomial(builder, coefficients: Array, t, vector):
    """Σ c[d] t^d of every lane, by Horner's rule."""
    single = builder.insert_element(ir.Constant(vector, ir.Undefined), t, INDEX(0))
    t = _repeat(builder, single, 0)
    constants = [ir.Constant(vector, [float(np.float32(value)) for value in row]) for row in coefficients]
    result = constants[-1]
    for constant in reversed(constants[:-1]):
        result = _add_product(builder, result, t, constant)
    return result


def _load(builder, data, offset, vector, alignment: int):
    """The vector at an offset [bytes]."""
    begin = builder.gep(builder.bitcast(data, BYTE.as_pointer()), [offset])
    loaded = builder.load(builder.bitcast(begin, vector.as_pointer()))
    loaded.align = alignment
    return loaded


def _repeat(builder, vector, lane: int):
    """One lane in every lane."""
    chosen = ir.Constant(ir.VectorType(INDEX, vector.type.count), [lane] * vector.type.count)
    return builder.shuffle_vector(vector, ir.Constant(vector.type, ir.Undefined), chosen)


def _add_product(builder, a, b, c):
    """a · b + c, rounded once."""
    kind = f"v{a.type.count}f{64 if a.type.element == DOUBLE else 32}"
    multiply_add = cgutils.get_or_insert_function(
        builder.module, ir.FunctionType(a.type, (a.type,) * 3), f"llvm.fma.{kind}"
    )
    return builder.call(multiply_add, (a, b, c))


def _sum(builder, vector):
    """All lanes, halves onto halves."""
    while vector.type.count > 1:
        half = vector.type.count // 2
        lanes = ir.VectorType(INDEX, half)
        parts = [ir.Constant(lanes, list(range(begin, begin + half))) for begin in (0, half)]
        low, high = (builder.shuffle_vector(vector, vector, part) for part in parts)
        vector = builder.fadd(low, high)
    return builder.extract_element(vector, INDEX(0))


@intrinsic
def _add_projections(typing, sums, data, p, g):
    """sums (4,) += g · data[p, 2:6], in double precision."""
    signature = types.void(sums, data, types.intp, types.float32)

    def build(context, builder, signature, arguments):
        total, rows, p, g = arguments
        total = context.make_array(signature.args[0])(context, builder, total)
        rows = context.make_array(signature.args[1])(context, builder, rows)
        stride = builder.extract_value(rows.strides, 0)
        at = builder.add(builder.mul(p, stride), ir.Constant(stride.type, PLACE * SINGLE_BYTES))
        singles, doubles = (ir.VectorType(kind, PROJECTED) for kind in (SINGLE, DOUBLE))
        row = builder.fpext(_load(builder, rows.data, at, singles, SINGLE_BYTES), doubles)
        one = builder.insert_element(ir.Constant(doubles, ir.Undefined), builder.fpext(g, DOUBLE), INDEX(0))
        there = builder.bitcast(total.data, doubles.as_pointer())
        before = builder.load(there)
        before.align = 8
        stored = builder.store(_add_product(builder, row, _repeat(builder, one, 0), before), there)
        stored.align = 8
        return context.get_dummy_value()

    return signature, build


def _add_projections_plainly(sums: Array, data: Array, p: int, g: float) -> None:
    sums += np.float64(g) * data[p, PLACE : PLACE + PROJECTED]


# (coefficients, ix, iy, tx, ty): the spline at (ix + tx, iy + ty), 0 ≤ t < 1, as `interpolation` reads it.
read_cubic: Any
read_quintic: Any
add_projections: Any
if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
    read_cubic, read_quintic = interpolation.interpolate, interpolation.interpolate_finely
    add_projections = _add_projections_plainly
else:
    read_cubic, read_quintic = _reader(3, 4), _reader(5, 8)
    add_projections = _add_projections
