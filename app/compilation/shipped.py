"""Archives of compiled kernels for a wheel: one for each level of processors.

    python -m rodsight.compilation.shipped FOLDER [LEVEL …]

compiles all listed kernels for each level, or takes them from the user's folder of kernels, and writes an archive that
an installed wheel unpacks. `.ci/wheel` builds a wheel with them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

from ..process.kernel_cache import (
    FEATURES_VARIABLE,
    NAME_VARIABLE,
    archive_name,
    folder_of_sources,
    kernel_folder,
    kernel_key,
)
from ..process.machine.processor import FEATURES, LEVELS
from ..process.sources import program_sources
from .ahead import KernelsAhead
from .kernel_list import read_kernels

PACK = "from rodsight.compilation.shipped import pack; pack({!r})"


def main(arguments: Sequence[str] | None = None) -> None:
    """Write an archive for every level, each from a process that compiles for this level."""
    folder, *levels = sys.argv[1:] if arguments is None else arguments
    Path(folder).mkdir(parents=True, exist_ok=True)
    for level in levels or LEVELS:
        environment = {**os.environ, NAME_VARIABLE: level, FEATURES_VARIABLE: FEATURES[level]}
        subprocess.run([sys.executable, "-c", PACK.format(folder)], env=environment, check=True)


def pack(target: str) -> Path:
    """Compile the listed kernels for the chosen processor and write their archive.

    Ends the process where a kernel was not compiled: the list is old, or another process compiles.
    """
    ahead, parts = KernelsAhead(), tuple({each.module.partition(".")[0] + "." for each in read_kernels()})
    with ahead.compiling(parts, all_uses=True):
        for part in parts:
            ahead.wait(part)
    folder = kernel_folder()
    if folder is None or not ahead.is_complete:
        sys.exit(
            "some kernels were not compiled: another process compiles, or the list is old "
            "(python -m tests.benchmarks.kernels writes it)"
        )
    file = Path(target) / archive_name(kernel_key())
    sources = {name.rpartition("/")[0] for name in program_sources().compiled}
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for source in sorted(sources):
            for kernel in sorted((folder / folder_of_sources(source)).glob("*.nb[ic]")):
                archive.write(kernel, f"{source}/{kernel.name}")
    return file


if __name__ == "__main__":
    main()
