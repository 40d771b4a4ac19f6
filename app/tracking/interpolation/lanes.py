"""Vector instructions of compiled loops, as builders of the compiler's intermediate language.

Compilers do not find these vectors by themselves. The order of additions is fixed, so that results are bit-identical on
every machine.
"""

from __future__ import annotations

import os

import numpy as np
from llvmlite import ir
from numba.core import cgutils

SINGLE, DOUBLE, INDEX, BYTE, ADDRESS = ir.FloatType(), ir.DoubleType(), ir.IntType(32), ir.IntType(8), ir.IntType(64)
SINGLE_BYTES = 4

# Without compilation there are no vectors: every intrinsic has a plain function beside it.
COMPILED = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")


def load(builder, data, offset, vector, alignment: int = SINGLE_BYTES):
    """Load the vector at an offset [bytes]."""
    loaded = builder.load(_pointer(builder, data, offset, vector))
    loaded.align = alignment
    return loaded


def store(builder, value, data, offset, alignment: int = SINGLE_BYTES) -> None:
    """Store a vector at an offset [bytes]."""
    builder.store(value, _pointer(builder, data, offset, value.type)).align = alignment


def _pointer(builder, data, offset, vector):
    begin = builder.gep(builder.bitcast(data, BYTE.as_pointer()), [offset])
    return builder.bitcast(begin, vector.as_pointer())


def constant(vector, number: float):
    """One number in every lane, rounded to what the lanes hold."""
    number = float(np.float32(number)) if vector.element == SINGLE else float(number)
    return ir.Constant(vector, [number] * vector.count)


def shuffle(builder, first, second, lanes: list[int]):
    """Choose lanes of two vectors, those of the second counting on from the first's."""
    chosen = ir.Constant(ir.VectorType(INDEX, len(lanes)), lanes)
    return builder.shuffle_vector(first, second, chosen)


def broadcast(builder, number, vector):
    """Copy a number to every lane."""
    single = builder.insert_element(ir.Constant(vector, ir.Undefined), number, INDEX(0))
    return broadcast_lane(builder, single, 0, vector.count)


def broadcast_lane(builder, vector, lane: int, count: int):
    """Copy one lane of a vector to all lanes of another one."""
    return shuffle(builder, vector, ir.Constant(vector.type, ir.Undefined), [lane] * count)


def fused_multiply_add(builder, a, b, c):
    """Compute a · b + c, rounded once."""
    kind = f"v{a.type.count}f{64 if a.type.element == DOUBLE else 32}"
    multiply_add = cgutils.get_or_insert_function(
        builder.module, ir.FunctionType(a.type, (a.type,) * 3), f"llvm.fma.{kind}"
    )
    return builder.call(multiply_add, (a, b, c))


def evaluate_polynomial(builder, coefficients: list, t):
    """Evaluate Σ c[d] t^d by Horner's rule, of vectors c[d]."""
    result = coefficients[-1]
    for each in reversed(coefficients[:-1]):
        result = fused_multiply_add(builder, result, t, each)
    return result


def sum_lanes(builder, vector):
    """Sum all lanes, halves onto halves."""
    while vector.type.count > 1:
        half = vector.type.count // 2
        low, high = (shuffle(builder, vector, vector, list(range(begin, begin + half))) for begin in (0, half))
        vector = builder.fadd(low, high)
    return builder.extract_element(vector, INDEX(0))


def transpose(builder, rows: list) -> list:
    """Transpose a square of vectors whose number is a power of two: lane j of vector i becomes lane i of vector j.

    Longer vectors hold several squares side by side, each of which is transposed.
    """
    count, lanes = len(rows), rows[0].type.count
    half = 1
    while half < count:
        low = [lane - half + lanes if lane & half else lane for lane in range(lanes)]
        high = [lane + lanes if lane & half else lane + half for lane in range(lanes)]
        turned = list(rows)
        for i in range(count):
            if not i & half:
                turned[i] = shuffle(builder, rows[i], rows[i + half], low)
                turned[i + half] = shuffle(builder, rows[i], rows[i + half], high)
        rows, half = turned, 2 * half
    return rows
