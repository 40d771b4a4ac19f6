"""Photographs as they arrive: one counts once it is whole, and once those that belong before it are there.

A camera's program, or a copy over a network, writes a file for a while, and files overtake one another. A file is whole
when its size and time have stayed for a moment and it can be read; one whose number leaves a gap is held back for a
while, for the one in between may be late.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from ..errors import InputError
from ..experiment.photographs import natural_key, read_photograph

STEADY = 0.5  # [s] that a file must have stayed as it is
LATE = 20.0  # [s] that a file is waited for whose successor is there


@dataclass(slots=True)
class Arrivals:
    """The photographs of a folder that is being filled."""

    folder: Path
    pattern: str
    steady: float = STEADY
    late: float = LATE
    clock: Callable[[], float] = time.monotonic
    _seen: dict[Path, tuple[tuple[int, int], float]] = field(default_factory=dict)  # what a file was, and since when
    _whole: dict[Path, tuple[int, int]] = field(default_factory=dict)
    _gap_since: float | None = None

    def look(self) -> list[Path]:
        """The photographs that are there for good, in natural order."""
        files = sorted((file for file in self.folder.glob(self.pattern) if file.is_file()), key=natural_key)
        whole = [self._is_whole(file) for file in files]
        first_torn = whole.index(False) if False in whole else len(files)
        return self._without_gap(files[:first_torn])  # what comes after half a file waits for it

    def _is_whole(self, file: Path) -> bool:
        try:
            told = file.stat()
        except OSError:  # renamed meanwhile
            return False
        stamp = told.st_size, told.st_mtime_ns
        if self._whole.get(file) == stamp:
            return True
        known = self._seen.get(file)
        if known is None or known[0] != stamp:
            self._seen[file] = stamp, self.clock()
            return False
        if self.clock() - known[1] < self.steady:
            return False
        try:
            read_photograph(file)
        except InputError:  # half of it, which may stay so for a while
            return False
        self._whole[file] = stamp
        return True

    def _without_gap(self, files: list[Path]) -> list[Path]:
        """Without what comes after a number that is missing, until that has been waited for long enough."""
        number = [_last_number(file) for file in files]
        step = [b - a for a, b in pairwise(number) if a is not None and b is not None]
        if len(step) < 2 or min(step) <= 0:
            return files
        gap = next((k + 1 for k, each in enumerate(step) if each > min(step)), None)
        if gap is None:
            self._gap_since = None
            return files
        if self._gap_since is None:
            self._gap_since = self.clock()
        return files if self.clock() - self._gap_since > self.late else files[:gap]


def _last_number(file: Path) -> int | None:
    found = re.findall(r"\d+", file.stem)
    return int(found[-1]) if found else None
