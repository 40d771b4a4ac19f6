"""The history of the benchmarks: added to, read, drawn."""

from __future__ import annotations

from tests.benchmarks import growth, history
from tests.benchmarks.timing import Row, Took, in_processor_time, shares


def test_every_asking_adds_the_spread_of_what_has_turns(tmp_path):
    file = tmp_path / "history.csv"
    rows = [
        in_processor_time("a stage", [Took(0.3, 1.0), Took(0.1, 1.0), Took(0.2, 1.0)]),
        Row("in words", "7 MB"),
        Row("a ratio", "**0.5**", "", shares([1.0, 3.0], [2.0, 3.0]), "of another"),
    ]
    history.append(rows, "1a2b3c", file)
    assert history.append(rows, "4d5e6f", file) == 2
    entries = history.read(file)
    assert [(entry.commit, entry.figure) for entry in entries] == [
        ("1a2b3c", "a stage"), ("1a2b3c", "a ratio"), ("4d5e6f", "a stage"), ("4d5e6f", "a ratio"),
    ]  # fmt: skip
    assert entries[0][5:] == (0.2, 0.1, 0.3, 3)
    assert entries[1][4:] == ("of another", 0.75, 0.5, 1.0, 2)


def test_the_page_shows_the_history_as_it_is(tmp_path):
    entries = history.read()
    assert len(entries) >= 2
    assert all(entry.least <= entry.median <= entry.greatest for entry in entries)
    history.draw(entries, tmp_path / "drawn.svg")
    assert (tmp_path / "drawn.svg").read_text() == history.PICTURE.read_text(), "python -m tests.benchmarks.history"


def test_the_page_shows_the_growth_as_it_is(tmp_path):
    jobs = growth.read()
    assert {each.kind for each in jobs} == set(growth.COLOURS)
    growth.draw(jobs, tmp_path / "drawn.svg")
    assert (tmp_path / "drawn.svg").read_text() == growth.DRAWN.read_text(), "python -m tests.benchmarks.growth"


def test_growth_is_told_as_a_power_of_the_rods():
    small, large = (
        growth.Job("2026-01-01", "a machine", growth.IN_A_CELL, rods, frames, solving, 1.0, 1.0, 1.0, 100.0)
        for rods, frames, solving in ((100, 6, 6.0), (400, 3, 24.0))
    )
    (solving, *_), aim = growth._rows_of(large, growth._power([small, large])), "growth n^1.50"
    assert solving.found.endswith(aim)
    assert growth._power([small]) == ""
