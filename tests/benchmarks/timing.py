"""Processor and clock times, and the table that benchmarks print."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

ROUNDS = 5
SECONDS = {"s": 1.0, "ms": 1e-3, "ns": 1e-9}
AIM = re.compile(r"([≤≥]) \+?([\d .]*\d) ?([^\s\d]*)")
MEASURED = re.compile(r"(\.?\d[\d.]*)(?: against [\d.]+)? ?([^\s\d]*)")


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the table; values of all rounds and their unit for the history."""

    label: str
    measured: str
    aim: str = ""
    rounds: tuple[float, ...] = ()
    unit: str = ""

    @property
    def is_met(self) -> bool:
        """Whether the first measured number in the unit of the aim meets it; True without an aim."""
        aim = AIM.match(self.aim)
        if aim is None:
            return True
        limit, unit = float(aim[2].replace(" ", "")), aim[3]
        scale = SECONDS.get(unit, 1.0)
        for number, other in MEASURED.findall(self.measured.replace("*", "")):
            if unit == "" or other == unit or {unit, other} <= SECONDS.keys():
                value = float(number) * (SECONDS[other] if other in SECONDS and unit in SECONDS else 1.0)
                return value <= limit * scale if aim[1] == "≤" else value >= limit * scale
        return True


@dataclass(frozen=True, slots=True)
class Duration:
    """Processor and clock time [s]."""

    processor: float
    clock: float

    def __truediv__(self, count: int) -> Duration:
        return Duration(self.processor / count, self.clock / count)

    def __str__(self) -> str:
        return f"{_format_seconds(self.processor)} of processor, {_format_seconds(self.clock)} of the clock"


def time_fastest(function: Callable[[], object], rounds: int = ROUNDS) -> Duration:
    """Least processor time and least clock time of several rounds after a first one."""
    return fastest_of(time_rounds(function, rounds))


def time_rounds(function: Callable[[], object], rounds: int = ROUNDS) -> list[Duration]:
    """Time several rounds after a first one, which compiles."""
    function()
    return [time_once(function) for _ in range(rounds)]


def fastest_of(durations: list[Duration]) -> Duration:
    return Duration(min(each.processor for each in durations), min(each.clock for each in durations))


def in_processor_time(label: str, durations: list[Duration], aim: str = "") -> Row:
    """Row of the fastest round, with the processor times of all."""
    return Row(label, str(fastest_of(durations)), aim, tuple(each.processor for each in durations), "s")


def time_once(function: Callable[[], object]) -> Duration:
    processor, clock = time.process_time(), time.perf_counter()
    function()
    return Duration(time.process_time() - processor, time.perf_counter() - clock)


def time_alternately(functions: dict[str, Callable[[], object]], rounds: int = ROUNDS) -> dict[str, list[float]]:
    """Processor times [s] of alternate rounds of all functions: other processes slow all of them equally."""
    for function in functions.values():
        function()
    measured: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(rounds):
        for name, function in functions.items():
            measured[name].append(time_once(function).processor)
    return measured


def duration_ratios(ours: list[float], theirs: list[float]) -> tuple[float, ...]:
    """Ratio of our time to theirs in every round."""
    return tuple(one / other for one, other in zip(ours, theirs, strict=True))


def format_table(title: str, rows: list[Row]) -> str:
    lines = [f"### {title}", "", "| what | measured | aim |", "|---|---|---|"]
    aims = (row.aim if row.is_met else f"{row.aim} (not met)" for row in rows)
    return "\n".join(
        [*lines, *(f"| {r.label} | {r.measured} | {aim} |" for r, aim in zip(rows, aims, strict=True)), ""]
    )


def processor_name() -> str:
    """Processor of this machine with its vector unit and number of cores."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        text = ""
    names = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name")]
    flags = next((line for line in text.splitlines() if line.startswith("flags")), "").split()
    vectors = next((each for each in ("avx512f", "avx2") if each in flags), "no AVX2")
    return f"{names[0]} ({vectors}), {len(names)} cores" if names else "unknown processor"


def _format_seconds(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"
