"""Elementary functions and uniform random numbers for many contacts at a time, in single precision.

Loops over LANES numbers that call these functions become vector instructions, because nothing in them branches; the
mathematical library's functions would be called number by number. Draws need no more digits than random numbers have.
"""

from __future__ import annotations

import math

import numpy as np
from llvmlite import ir
from numba import njit, types
from numpy.typing import NDArray

from ...vectors import INDEX, SINGLE, WORD, llvm_implementation_of, load, store

LANES = 16  # numbers of single precision in the widest registers
ZERO, HALF, ONE, TWO = (np.float32(x) for x in (0.0, 0.5, 1.0, 2.0))
GREATEST_EXPONENT, LEAST_EXPONENT = np.float32(88.0), np.float32(-87.0)  # beyond which exp leaves single precision
ROOT_HALF_BITS = 0x3F3504F3  # of √½, the least mantissa
MANTISSA_BITS, EXPONENT_BIAS = 23, 127
ROUNDING = np.float32(1.5 * 2.0**23)  # added and subtracted, it leaves an integer
LOG2_E = np.float32(1.0 / math.log(2.0))
# ln 2 in two parts: the first is short, so that its products with integers are exact.
LN2_HIGH, LN2_LOW = np.float32(355.0 / 512.0), np.float32(math.log(2.0) - 355.0 / 512.0)
E2, E3, E4, E5, E6 = (np.float32(1.0 / math.factorial(k)) for k in range(2, 7))  # Taylor: 2e-8 up to ½ ln 2
# Coefficients of (ln(1 + t) − t + t²/2)/t³, fitted at Chebyshev points of √½ − 1 … √2 − 1: 5e-8 of the logarithm.
C0, C1, C2, C3, C4, C5, C6 = (
    np.float32(x)
    for x in (0.333334103, -0.250009217, 0.199851278, -0.165928563, 0.146763966, -0.141184249, 0.0927221424)
)

_WORDS, _SINGLES = ir.VectorType(WORD, LANES), ir.VectorType(SINGLE, LANES)


def exponent_of(x):  # type: ignore[no-untyped-def]
    """Return k of x = 2^k (1 + t), √½ ≤ 1 + t < √2, of a positive normal number."""
    fraction, exponent = math.frexp(x)
    return np.float32(exponent if fraction >= math.sqrt(0.5) else exponent - 1)


def mantissa_of(x):  # type: ignore[no-untyped-def]
    """Return 1 + t of the same."""
    fraction, _ = math.frexp(x)
    return np.float32(fraction if fraction >= math.sqrt(0.5) else 2.0 * fraction)


def power_of_two(k):  # type: ignore[no-untyped-def]
    """Return 2^k of an integer k."""
    return np.float32(2.0 ** float(k))


@llvm_implementation_of(exponent_of, types.float32)
def _exponent_of(builder, kinds, values):  # type: ignore[no-untyped-def]
    return builder.sitofp(_exponent_bits(builder, builder.bitcast(values[0], WORD)), SINGLE)


@llvm_implementation_of(mantissa_of, types.float32)
def _mantissa_of(builder, kinds, values):  # type: ignore[no-untyped-def]
    bits = builder.bitcast(values[0], WORD)
    shifted = builder.shl(_exponent_bits(builder, bits), WORD(MANTISSA_BITS))
    return builder.bitcast(builder.sub(bits, shifted), SINGLE)


@llvm_implementation_of(power_of_two, types.float32)
def _power_of_two(builder, kinds, values):  # type: ignore[no-untyped-def]
    biased = builder.add(builder.fptosi(values[0], WORD), WORD(EXPONENT_BIAS))
    return builder.bitcast(builder.shl(biased, WORD(MANTISSA_BITS)), SINGLE)


def _exponent_bits(builder, bits):  # type: ignore[no-untyped-def]
    return builder.ashr(builder.sub(bits, WORD(ROOT_HALF_BITS)), WORD(MANTISSA_BITS))


@njit(forceinline=True, error_model="numpy", fastmath={"contract"})
def exponential(x):  # type: ignore[no-untyped-def]
    """Compute e^x, between e^−87 and e^88, to a relative error of 2e-7."""
    x = min(max(x, LEAST_EXPONENT), GREATEST_EXPONENT)
    k = (x * LOG2_E + ROUNDING) - ROUNDING
    r = (x - k * LN2_HIGH) - k * LN2_LOW
    return (ONE + r * (ONE + r * (E2 + r * (E3 + r * (E4 + r * (E5 + r * E6)))))) * power_of_two(k)


@njit(forceinline=True, error_model="numpy", fastmath={"contract"})
def logarithm(x):  # type: ignore[no-untyped-def]
    """Compute ln x of a positive normal number, to an error of 2e-7 or its rounding."""
    k, t = exponent_of(x), mantissa_of(x) - ONE
    square = t * t
    rest = t * square * (C0 + t * (C1 + t * (C2 + t * (C3 + t * (C4 + t * (C5 + t * C6))))))
    return k * LN2_HIGH + (t + (k * LN2_LOW + (rest - HALF * square)))


def seed_lanes(rng: np.random.Generator) -> NDArray[np.uint32]:
    """Draw the state (4 · LANES,) of one generator in each lane."""
    return rng.integers(1, 2**32, size=4 * LANES, dtype=np.uint32)


def draw_uniform(random, out, first):  # type: ignore[no-untyped-def]
    """Draw LANES numbers of single precision, uniform in (0, 1), to out[first:]; random (4 · LANES,) changes.

    Notes
    -----
    Every lane is a generator xoshiro128++ (Blackman and Vigna 2021); its upper 24 bits k are the number (k + ½)/2²⁴.
    """
    for lane in range(LANES):
        a, b, c, d = (int(random[q * LANES + lane]) for q in range(4))
        number = (_rotated((a + d) & 0xFFFFFFFF, 7) + a) & 0xFFFFFFFF
        out[first + lane] = np.float32((number >> 8) * 2.0**-24) + np.float32(2.0**-25)
        shifted = (b << 9) & 0xFFFFFFFF
        c ^= a
        d ^= b
        b ^= c
        a ^= d
        c ^= shifted
        for q, word in enumerate((a, b, c, _rotated(d, 11))):
            random[q * LANES + lane] = word


def _rotated(word: int, bits: int) -> int:
    return ((word << bits) | (word >> (32 - bits))) & 0xFFFFFFFF


@llvm_implementation_of(draw_uniform)
def _draw_uniform(builder, kinds, values):  # type: ignore[no-untyped-def]
    random, out, first = values

    def row(q):  # type: ignore[no-untyped-def]
        return builder.gep(random, [INDEX(q * LANES)])

    def rotated(words, bits):  # type: ignore[no-untyped-def]
        return builder.or_(builder.shl(words, _equal(bits)), builder.lshr(words, _equal(32 - bits)))

    a, b, c, d = (load(builder, row(q), LANES, WORD) for q in range(4))
    number = builder.add(rotated(builder.add(a, d), 7), a)
    shifted = builder.shl(b, _equal(9))
    c, d = builder.xor(c, a), builder.xor(d, b)
    b, a = builder.xor(b, c), builder.xor(a, d)
    c, d = builder.xor(c, shifted), rotated(d, 11)
    for q, word in enumerate((a, b, c, d)):
        store(builder, word, row(q))
    upper = builder.uitofp(builder.lshr(number, _equal(8)), _SINGLES)
    drawn = builder.fadd(builder.fmul(upper, _all(2.0**-24)), _all(2.0**-25))
    store(builder, drawn, builder.gep(out, [first]))


def _equal(word: int) -> ir.Constant:
    return ir.Constant(_WORDS, [word] * LANES)


def _all(number: float) -> ir.Constant:
    return ir.Constant(_SINGLES, [number] * LANES)
