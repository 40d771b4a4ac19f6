"""The list of compiled kernels with the types that they are called with, so that they can be compiled before a call.

A line of `kernel_list.jsonl` is one kernel. `python -m tests.benchmarks.kernels` writes the list from the compilations
of a few runs. A kernel that is missing in it is compiled at its first call, an entry that fits no kernel is skipped:
an old list costs time, never a wrong result.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import reduce
from importlib import import_module
from pathlib import Path
from typing import Any

FILE = Path(__file__).with_name("kernel_list.jsonl")
PACKAGE = __name__.split(".")[0]
GENERATOR = "NumPyRandomGeneratorType"


@dataclass(frozen=True, slots=True)
class Kernel:
    """One kernel and the types of its arguments, as `encode` writes them."""

    module: str  # in this package, such as solver.nlgs.sweeping.kernels
    function: str
    arguments: tuple[Any, ...]
    seconds: float  # of processor time to compile it, without the kernels that it calls
    calls: tuple[int, ...] = ()  # places in the list of the kernels to compile before
    of_run: bool = True  # `rodsight run` on photographs needs it

    def compile(self) -> None:
        """Compile the kernel, or load it. Raises AttributeError, ImportError or TypeError if it fits no kernel."""
        module = import_module(f"{PACKAGE}.{self.module}")
        dispatcher: Any = reduce(getattr, self.function.split("."), module)
        dispatcher.compile(tuple(decode(each) for each in self.arguments))

    @property
    def line(self) -> str:
        return json.dumps(asdict(self))


def read_kernels(file: Path = FILE) -> tuple[Kernel, ...]:
    """Read the list; every kernel stands behind those that it calls."""
    rows = map(json.loads, file.read_text(encoding="utf-8").splitlines())
    return tuple(Kernel(**{**row, "arguments": tuple(row["arguments"]), "calls": tuple(row["calls"])}) for row in rows)


def critical_times(kernels: Sequence[Kernel], chosen: Collection[int]) -> list[float]:
    """Return the time [s] from the beginning of each kernel to the end of the last chosen one that depends on it.

    Where the largest begins first, no process waits at the end for a long one that another compiles.
    """
    times = [0.0] * len(kernels)
    for place in sorted(chosen, reverse=True):  # every kernel stands behind those that it calls
        times[place] += kernels[place].seconds
        for called in kernels[place].calls:
            times[called] = max(times[called], times[place])
    return times


def write_kernels(kernels: Sequence[Kernel], file: Path = FILE) -> None:
    """Write the list."""
    file.write_text("".join(f"{kernel.line}\n" for kernel in kernels), encoding="utf-8")


def encode(kind: Any) -> Any:
    """Return a type of the compiler as plain data.

    Raises
    ------
    TypeError
        If no argument of a kernel has had such a type yet.

    Examples
    --------
    >>> import numba
    >>> encode(numba.float64[:, ::1])
    'float64 2 C'
    """
    from numba import types

    if isinstance(kind, types.Array) and type(kind) is types.Array:
        return f"{kind.dtype} {kind.ndim} {kind.layout}{'' if kind.mutable else ' readonly'}"
    if isinstance(kind, types.BaseTuple):
        members: Any = kind
        parts = [encode(each) for each in members]
        owner = getattr(kind, "instance_class", None)
        return {_name_of(owner): parts} if owner is not None else parts
    if isinstance(kind, types.NumPyRandomGeneratorType):
        return GENERATOR
    if isinstance(kind, (types.Integer, types.Float, types.Boolean)) and not isinstance(kind, types.Literal):
        return str(kind)
    raise TypeError(f"{kind}: no kernel had an argument of this type yet; add it to encode and decode")


def decode(kind: Any) -> Any:
    """Return the type of the compiler that `encode` has written.

    Raises
    ------
    TypeError
        If a named tuple has other fields by now.

    Examples
    --------
    >>> decode("float64 2 C")
    Array(float64, 2, 'C', False, aligned=True)
    """
    from numba import types

    if isinstance(kind, list):
        return types.BaseTuple.from_types(_decoded(kind))
    if isinstance(kind, dict):
        ((name, parts),) = kind.items()
        module, _, owner = name.rpartition(".")
        made = getattr(import_module(f"{PACKAGE}.{module}"), owner)
        if len(made._fields) != len(parts):
            raise TypeError(
                f"{name} has {len(made._fields)} fields, not {len(parts)}: write the list of kernels again, "
                "python -m tests.benchmarks.kernels"
            )
        return types.BaseTuple.from_types(_decoded(parts), made)
    if kind == GENERATOR:
        return types.NumPyRandomGeneratorType(GENERATOR)
    name, *shape = kind.split()
    scalar = types.boolean if name == "bool" else getattr(types, name)
    if not shape:
        return scalar
    return types.Array(scalar, int(shape[0]), shape[1], readonly="readonly" in shape)


def _decoded(kinds: Iterable[Any]) -> tuple[Any, ...]:
    return tuple(map(decode, kinds))


def _name_of(owner: type) -> str:
    return f"{owner.__module__.removeprefix(f'{PACKAGE}.')}.{owner.__qualname__}"
