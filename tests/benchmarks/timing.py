"""Times of the processor and of the clock, and the table that benchmarks print."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

TURNS = 5


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the table; turns and their unit, where it goes into the history."""

    what: str
    found: str
    aim: str = ""
    turns: tuple[float, ...] = ()
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Took:
    """Seconds."""

    processor: float
    clock: float

    def __truediv__(self, count: int) -> Took:
        return Took(self.processor / count, self.clock / count)

    def __str__(self) -> str:
        return f"{_told(self.processor)} of processor, {_told(self.clock)} of the clock"


def fastest(way: Callable[[], object], turns: int = TURNS) -> Took:
    """The least of several turns after a first one, processor and clock each by themselves."""
    return least(several(way, turns))


def several(way: Callable[[], object], turns: int = TURNS) -> list[Took]:
    """Every turn after a first one."""
    way()
    return [once(way) for _ in range(turns)]


def least(took: list[Took]) -> Took:
    return Took(min(each.processor for each in took), min(each.clock for each in took))


def in_processor_time(what: str, took: list[Took], aim: str = "") -> Row:
    """A row of the fastest turn, with the processor's seconds of all of them."""
    return Row(what, str(least(took)), aim, tuple(each.processor for each in took), "s")


def once(way: Callable[[], object]) -> Took:
    processor, clock = time.process_time(), time.perf_counter()
    way()
    return Took(time.process_time() - processor, time.perf_counter() - clock)


def by_turns(ways: dict[str, Callable[[], object]], turns: int = TURNS) -> dict[str, list[float]]:
    """Processor seconds of every turn of each; they take turns, so that what else runs weighs on all alike."""
    for way in ways.values():
        way()
    found: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(turns):
        for name, way in ways.items():
            found[name].append(once(way).processor)
    return found


def shares(ours: list[float], theirs: list[float]) -> tuple[float, ...]:
    """Ours of theirs, turn by turn."""
    return tuple(one / other for one, other in zip(ours, theirs, strict=True))


def format_table(title: str, rows: list[Row]) -> str:
    lines = [f"### {title}", "", "| what | measured | aim |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {row.what} | {row.found} | {row.aim} |" for row in rows), ""])


def processor_name() -> str:
    """What the machine calls its processor."""
    try:
        told = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        told = ""
    names = [line.partition(":")[2].strip() for line in told.splitlines() if line.startswith("model name")]
    flags = next((line for line in told.splitlines() if line.startswith("flags")), "").split()
    vectors = next((each for each in ("avx512f", "avx2") if each in flags), "no AVX2")
    return f"{names[0]} ({vectors}), {len(names)} cores" if names else "unknown processor"


def _told(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"
