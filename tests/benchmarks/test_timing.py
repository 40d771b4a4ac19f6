"""What the tables of the benchmarks are made of."""

import time

import pytest

from tests.benchmarks.timing import Row, Took, by_turns, fastest, format_table, once, processor_name

pytestmark = pytest.mark.unit


def spin():
    until = time.process_time() + 0.02  # [s]
    while time.process_time() < until:
        pass


def test_seconds_of_the_processor_and_of_the_clock_are_told():
    took = once(spin)
    assert 0.02 <= took.processor < 10.0
    assert took.clock >= 0.019
    assert str(Took(0.0214, 3.21) / 2) == "10.7 ms of processor, 1.6 s of the clock"
    assert fastest(lambda: None, 2).processor < 0.01
    found = by_turns({"long": spin, "short": lambda: None}, 2)
    assert min(found["long"]) >= 0.02
    assert len(found["short"]) == 2


def test_a_table_has_a_line_for_every_row():
    lines = format_table("Some", [Row("a", "1 ms", "≤ 2 ms"), Row("b", "3")]).splitlines()
    assert lines[0] == "### Some"
    assert lines[2:] == ["| what | measured | aim |", "|---|---|---|", "| a | 1 ms | ≤ 2 ms |", "| b | 3 |  |"]
    assert "core" in processor_name() or processor_name() == "unknown processor"
