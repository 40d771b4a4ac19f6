"""Arrival of photographs: a photograph is used once its file is complete and its predecessors are there.

Cameras and network copies write a file over some time, and files may arrive out of order. A file is complete when its
size and time have not changed for a moment and it can be read; a file after a gap in the numbers is held back for a
while, since the missing one may be late.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from ..experiment.pictures.picture_file import read_photograph
from ..experiment.reading.photograph_order import in_order, last_number
from ..process.errors import InputError

STEADY_TIME = 0.5  # [s] without a change of the file
MAX_DELAY = 20.0  # [s] to wait for a file whose successor is there


@dataclass(slots=True)
class Arrivals:
    """The photographs that arrive in a folder."""

    folder: Path
    pattern: str
    steady_time: float = STEADY_TIME
    max_delay: float = MAX_DELAY
    clock: Callable[[], float] = time.monotonic
    _seen: dict[Path, tuple[tuple[int, int], float]] = field(default_factory=dict)  # state of a file, and its time
    _complete: dict[Path, tuple[int, int]] = field(default_factory=dict)
    _gap_since: float | None = None

    def complete_files(self) -> list[Path]:
        """Return the complete photographs in natural order."""
        files = list(in_order(file for file in self.folder.glob(self.pattern) if file.is_file()))
        complete = [self._is_complete(file) for file in files]
        first_incomplete = complete.index(False) if False in complete else len(files)
        return self._without_gap(files[:first_incomplete])

    def _is_complete(self, file: Path) -> bool:
        try:
            state = file.stat()
        except OSError:  # renamed or removed
            return False
        stamp = state.st_size, state.st_mtime_ns
        if self._complete.get(file) == stamp:
            return True
        known = self._seen.get(file)
        if known is None or known[0] != stamp:
            self._seen[file] = stamp, self.clock()
            return False
        if self.clock() - known[1] < self.steady_time:
            return False
        try:
            read_photograph(file)
        except InputError:  # incomplete
            return False
        self._complete[file] = stamp
        return True

    def _without_gap(self, files: list[Path]) -> list[Path]:
        """Leave out files after a missing number, until the maximum delay is over."""
        number = [last_number(file) for file in files]
        step = [b - a for a, b in pairwise(number) if a is not None and b is not None]
        if len(step) < 2 or min(step) <= 0:
            return files
        gap = next((k + 1 for k, each in enumerate(step) if each > min(step)), None)
        if gap is None:
            self._gap_since = None
            return files
        if self._gap_since is None:
            self._gap_since = self.clock()
        return files if self.clock() - self._gap_since > self.max_delay else files[:gap]
