"""Generation of vector instructions for kernels that the compiler does not vectorise by itself.

LLVM maps vectors to the instructions of the processor: AVX-512, AVX2, NEON. Modules that use this define each function
in plain Python and register an LLVM implementation for compiled code.
"""

from __future__ import annotations

from collections.abc import Callable
from inspect import signature

from llvmlite import ir  # numba reaches such vectors only through llvmlite
from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable

NUMBER, INDEX = ir.DoubleType(), ir.IntType(64)
SINGLE, WORD = ir.FloatType(), ir.IntType(32)
_FUSED = ("contract",)  # allows fused multiply-add


def llvm_implementation_of(plain: Callable, returned: types.Type = types.void) -> Callable:
    """Register the decorated function as the LLVM implementation of a plain function, by default without return value.

    The decorated function receives the LLVM builder, the types of the arguments and their values; arrays are passed as
    pointers to their first number. It returns the value of the type `returned`.
    """

    def register(generate):  # type: ignore[no-untyped-def]
        def typed(*arguments):  # type: ignore[no-untyped-def]
            return returned

        typed.__signature__ = signature(plain)  # type: ignore[attr-defined]
        type_callable(plain)(lambda context: typed)

        def lower(context, builder, call, values):  # type: ignore[no-untyped-def]
            value = generate(builder, call.args, _pointers(context, builder, call.args, values))
            return context.get_dummy_value() if returned is types.void else value

        lower_builtin(plain, types.VarArg(types.Any))(lower)
        return generate

    return register


def _pointers(context, builder, kinds, values):  # type: ignore[no-untyped-def]
    """Arrays as pointers to their first number, other values unchanged."""
    return [
        cgutils.create_struct_proxy(kind)(context, builder, value=value).data
        if isinstance(kind, types.Array)
        else value
        for kind, value in zip(kinds, values, strict=True)
    ]


def load(builder, place, count, kind: ir.Type = NUMBER):  # type: ignore[no-untyped-def]
    loaded = builder.load(builder.bitcast(place, ir.VectorType(kind, count).as_pointer()))
    loaded.align = _bytes_of(kind)
    return loaded


def store(builder, vector, place):  # type: ignore[no-untyped-def]
    builder.store(vector, builder.bitcast(place, vector.type.as_pointer())).align = _bytes_of(vector.type.element)


def _bytes_of(kind):  # type: ignore[no-untyped-def]
    """Alignment of a vector of such numbers: arrays are aligned to numbers, not to vectors."""
    return 4 if kind in (SINGLE, WORD) else 8


def shuffle(builder, a, b, lanes):  # type: ignore[no-untyped-def]
    lanes = list(lanes)
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(WORD, len(lanes)), lanes))


def broadcast(builder, number, count):  # type: ignore[no-untyped-def]
    """A vector of equal numbers."""
    empty = ir.Constant(ir.VectorType(NUMBER, count), ir.Undefined)
    first = builder.insert_element(empty, number, WORD(0))
    return shuffle(builder, first, empty, [0] * count)


def add_product(builder, to, a, b):  # type: ignore[no-untyped-def]
    return builder.fadd(to, builder.fmul(a, b, flags=_FUSED), flags=_FUSED)


def subtract_product(builder, to, a, b):  # type: ignore[no-untyped-def]
    return builder.fsub(to, builder.fmul(a, b, flags=_FUSED), flags=_FUSED)


def total(builder, vector):  # type: ignore[no-untyped-def]
    """Sum of the numbers of a vector, added pairwise."""
    parts = [builder.extract_element(vector, WORD(k)) for k in range(vector.type.count)]
    while len(parts) > 1:
        parts = [builder.fadd(parts[k], parts[k + 1]) for k in range(0, len(parts), 2)]
    return parts[0]
