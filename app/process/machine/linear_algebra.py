"""Threads of the linear algebra libraries.

Their products of small matrices are shared out to threads that wait for one another in loops: on busy cores a product
of a fifth of a millisecond takes twenty. Work is divided among cores by frames, members and chains instead, so that
results have the same bits on any number of cores.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")


def one_thread_each(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
    """Decorate a function during which products of matrices use one thread."""

    @wraps(function)
    def limited(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Returned:
        with threadpool_limits(1, user_api="blas"):
            return function(*args, **kwargs)

    return limited
