"""The list of kernels fits the program."""

from __future__ import annotations

from functools import reduce
from importlib import import_module

import numba
import pytest
from rodsight.compilation.kernel_list import decode, encode, read_kernels

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs compiled kernels")


def test_every_kernel_of_the_list_exists_takes_its_arguments_and_stands_behind_those_it_calls() -> None:
    kernels = read_kernels()
    assert len(kernels) > 50
    for place, kernel in enumerate(kernels):
        dispatcher = reduce(getattr, kernel.function.split("."), import_module(f"rodsight.{kernel.module}"))
        parameters = dispatcher.py_func.__code__.co_argcount
        assert parameters == len(kernel.arguments), f"{kernel.function}: write the list again"
        assert [encode(decode(each)) for each in kernel.arguments] == list(kernel.arguments)
        assert all(called < place for called in kernel.calls)


@pytest.mark.parametrize(
    "kind",
    [
        numba.float32[:, :], numba.types.Array(numba.int64, 1, "C", readonly=True), numba.boolean[::1],
        numba.types.UniTuple(numba.int64, 2), numba.types.Tuple((numba.int32, numba.float64)),
    ],
)  # fmt: skip
def test_types_are_read_back(kind) -> None:
    assert decode(encode(kind)) == kind


def test_a_named_tuple_with_other_fields_than_listed_is_refused() -> None:
    with pytest.raises(TypeError, match="write the list of kernels again"):
        decode({"solver.nlgs.problem.ContactProblem": ["float64 2 C"]})


@pytest.mark.parametrize("kind", [numba.types.literal(3), numba.types.Omitted(None), numba.types.unicode_type])
def test_types_that_no_listed_kernel_has_are_refused(kind) -> None:
    with pytest.raises(TypeError, match="no kernel had an argument of this type"):
        encode(kind)
