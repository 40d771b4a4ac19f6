"""Abilities of the processor that compiled kernels depend on.

Kernels are compiled for a level of x86-64 that many processors share, so that those of one machine serve another:
v3 (AVX2) or v4 (AVX-512). Any other processor gets kernels for itself alone.
"""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Set
from pathlib import Path

X86_64 = ("x86_64", "amd64")
V3 = frozenset({
    "cx16", "lahf_lm", "popcnt", "sse4_1", "sse4_2", "ssse3", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm",
    "movbe", "xsave",
})  # fmt: skip
V4 = V3 | frozenset(f"avx512{part}" for part in ("f", "bw", "cd", "dq", "vl"))
LEVELS = {"x86-64-v4": V4, "x86-64-v3": V3}  # the first that a processor reaches
# Vectors of 512 bits: the compiler prefers 256 for this level, and sweeps then take 23 % longer (AMD EPYC, Zen 5).
FEATURES = {"x86-64-v4": "-prefer-256-bit", "x86-64-v3": "+avx2"}  # an empty value cannot be set on Windows
# Names of the compiler for flags of Linux.
OTHER_NAMES = {"lahf_lm": "sahf", "abm": "lzcnt", "bmi1": "bmi", "sse4_1": "sse4.1", "sse4_2": "sse4.2"}


def processor_level() -> str | None:
    """Return the level of x86-64 of this processor, or None for another one."""
    if platform.machine().lower() not in X86_64:
        return None
    return level_of(_flags())


def level_of(flags: Set[str]) -> str | None:
    """Return the highest level all of whose flags, by their names in Linux, are there."""
    return next((level for level, needed in LEVELS.items() if needed <= flags), None)


def described_processor() -> list[str]:
    """Return the machine and what Linux reports of its processor."""
    known = ("vendor_id", "model name", "flags", "Features", "CPU part")
    machine = os.uname().machine if hasattr(os, "uname") else os.environ.get("PROCESSOR_IDENTIFIER", "")
    return [machine, *(line for line in _first_processor().splitlines() if line.startswith(known))]


def _flags() -> frozenset[str]:
    for line in _first_processor().splitlines():
        if line.startswith("flags"):
            return frozenset(line.partition(":")[2].split())
    if sys.platform == "linux":
        return frozenset()
    from llvmlite.binding import get_host_cpu_features  # as the compiler finds them; it is slow to import

    features = get_host_cpu_features()
    return frozenset(name for name in V4 if features.get(OTHER_NAMES.get(name, name)))


def _first_processor() -> str:
    try:
        return Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").split("\n\n")[0]
    except OSError:  # not Linux
        return ""
