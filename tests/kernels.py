"""python -m tests.kernels: compile the kernels that are missing, which several processes would else compile each."""

from __future__ import annotations

from rodsight.compilation.ahead import KernelsAhead


def compile_missing_kernels() -> None:
    """Compile all kernels of the list that are not there, on all cores."""
    kernels = KernelsAhead()
    with kernels.compiling(("",), all_uses=True):
        kernels.wait("")


if __name__ == "__main__":
    compile_missing_kernels()
