"""A process that compiles kernels: reads places in the list from standard input and answers each with a line."""

from __future__ import annotations

import sys

from .kernel_list import read_kernels

COMPILED, SKIPPED = "compiled", "skipped"


def main() -> None:
    """Compile the kernels that are requested, until the input ends."""
    kernels = read_kernels()
    for line in sys.stdin:
        try:
            kernels[int(line)].compile()
            answer = COMPILED
        except Exception as error:  # the list is old: the kernel is compiled when it is called, and its errors raised
            answer = f"{SKIPPED}: {type(error).__name__}"
        print(answer, flush=True)
