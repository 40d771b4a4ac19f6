"""Processor and clock times, and tables of the benchmarks."""

import time

import pytest

from tests.benchmarks.timing import (
    Duration,
    Row,
    format_table,
    processor_name,
    time_alternately,
    time_fastest,
    time_once,
)

pytestmark = pytest.mark.unit


def spin():
    until = time.process_time() + 0.02  # [s]
    while time.process_time() < until:
        pass


def test_processor_and_clock_time_are_measured():
    duration = time_once(spin)
    assert 0.02 <= duration.processor < 10.0
    assert duration.clock >= 0.019
    assert str(Duration(0.0214, 3.21) / 2) == "10.7 ms of processor, 1.6 s of the clock"
    assert time_fastest(lambda: None, 2).processor < 0.01
    measured = time_alternately({"long": spin, "short": lambda: None}, 2)
    assert min(measured["long"]) >= 0.02
    assert len(measured["short"]) == 2


def test_a_table_has_a_line_for_every_row():
    lines = format_table("Some", [Row("a", "1 ms", "≤ 2 ms"), Row("b", "3")]).splitlines()
    assert lines[0] == "### Some"
    assert lines[2:] == ["| what | measured | aim |", "|---|---|---|", "| a | 1 ms | ≤ 2 ms |", "| b | 3 |  |"]
    assert "(not met)" not in "".join(lines)
    assert "| ≤ 2 ms (not met) |" in format_table("Some", [Row("a", "3 ms", "≤ 2 ms")])
    assert "core" in processor_name() or processor_name() == "unknown processor"


@pytest.mark.parametrize(
    ("measured", "aim", "met"),
    [
        ("112 ms of processor, 88.4 ms of the clock", "≤ .06 s", False),
        ("6.39 ms of processor, 6.39 ms of the clock", "≤ .3 s", True),
        ("**0.20** of a plain numba kernel: 2.0 against 10.4 ns per contact and sweep", "≤ .25", True),
        ("**0.043** of Clarabel: 6.9 against 158 ms", "≤ 6 ms", False),
        ("**+64%** of the sweeps themselves", "≤ +30 %", False),
        ("**+9%** of the sweeps themselves", "≤ +30 %", True),
        ("**40818 grains/s** of one core", "≥ 40 000 grains/s", True),
        ("**37116 grains/s** of one core", "≥ 40 000 grains/s", False),
        (".99 ms of processor", "≤ 10 ms", True),
        ("147 ms of processor", "", True),
    ],
)
def test_an_aim_that_is_not_met_is_known(measured, aim, met):
    assert Row("a", measured, aim).is_met == met
