"""Which photographs of an experiment a run covers: from one to another, or every so many of them."""

from __future__ import annotations

from typing import NamedTuple


class FrameRange(NamedTuple):
    """The photographs start, start + step, … before stop; row k of a run is photograph start + k step."""

    start: int = 0
    stop: int | None = None  # None: after the last one
    step: int = 1

    def __str__(self) -> str:
        """Return it as on the command line."""
        stop = "" if self.stop is None else str(self.stop)
        return f"{self.start}:{stop}" + (f":{self.step}" if self.step != 1 else "")

    @property
    def stored(self) -> tuple[int, ...]:
        """Start, stop (−1: after the last one) and, unless it is 1, the step, as files store them."""
        ends = (self.start, -1 if self.stop is None else self.stop)
        return ends if self.step == 1 else (*ends, self.step)

    def covers(self, other: FrameRange) -> bool:
        """Whether all photographs of another range are among these."""
        ends = self.stop is None or (other.stop is not None and other.stop <= self.stop)
        steps = other.step % self.step == 0 and (other.start - self.start) % self.step == 0
        return ends and steps and other.start >= self.start

    def number(self, row: int) -> int:
        """Return the photograph of a row of the run."""
        return self.start + row * self.step


ALL_FRAMES = FrameRange()
