"""History of the benchmarks: appended, read and drawn."""

from __future__ import annotations

import pytest

from tests.benchmarks import growth, history
from tests.benchmarks.timing import Duration, Row, duration_ratios, in_processor_time


def test_every_run_appends_median_and_range_of_rows_with_rounds(tmp_path):
    file = tmp_path / "history.csv"
    rows = [
        in_processor_time("a stage", [Duration(0.3, 1.0), Duration(0.1, 1.0), Duration(0.2, 1.0)]),
        Row("in words", "7 MB"),
        Row("a ratio", "**0.5**", "", duration_ratios([1.0, 3.0], [2.0, 3.0]), "of another"),
    ]
    history.append(rows, "1a2b3c", file)
    assert history.append(rows, "4d5e6f", file) == 2
    entries = history.read(file)
    assert [(entry.commit, entry.figure) for entry in entries] == [
        ("1a2b3c", "a stage"), ("1a2b3c", "a ratio"), ("4d5e6f", "a stage"), ("4d5e6f", "a ratio"),
    ]  # fmt: skip
    assert entries[0][5:] == (0.2, 0.1, 0.3, 3)
    assert entries[1][4:] == ("of another", 0.75, 0.5, 1.0, 2)


@pytest.mark.thorough
def test_the_plot_of_the_history_is_up_to_date(tmp_path):
    entries = history.read()
    assert len(entries) >= 2
    assert all(entry.least <= entry.median <= entry.greatest for entry in entries)
    history.draw(entries, tmp_path / "drawn.svg")
    assert (tmp_path / "drawn.svg").read_text() == history.PICTURE.read_text(), "python -m tests.benchmarks.history"


@pytest.mark.thorough
def test_the_plot_of_the_growth_is_up_to_date(tmp_path):
    jobs = growth.read()
    assert {each.kind for each in jobs} == set(growth.STYLES)
    growth.draw(jobs, tmp_path / "drawn.svg")
    assert (tmp_path / "drawn.svg").read_text() == growth.DRAWN.read_text(), "python -m tests.benchmarks.growth"


def test_curves_of_one_panel_differ_without_colour():
    panels = [
        growth.STYLES.values(),
        (growth.SOLVING, growth.RECORDING),
        map(history._style, range(len(history.COLOURS))),
    ]
    for panel in panels:
        looks = [(style["marker"], style.get("ls", "-")) for style in panel]
        assert len(set(looks)) == len(looks)


def test_growth_is_reported_as_a_power_of_the_number_of_rods():
    small, large = (
        growth.Job("2026-01-01", "a machine", growth.IN_A_CELL, rods, frames, solving, 1.0, 1.0, 1.0, 100.0)
        for rods, frames, solving in ((100, 6, 6.0), (400, 3, 24.0))
    )
    (solving, *_), aim = growth._rows_of(large, growth._power([small, large])), "growth n^1.50"
    assert solving.measured.endswith(aim)
    assert growth._power([small]) == ""
