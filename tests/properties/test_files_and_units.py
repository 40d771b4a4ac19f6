"""Files are read as written, errors are located, and conversions of units are invertible."""

import csv
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rodsight.experiment.lens import BrownLens
from rodsight.experiment.reading.tables import LARGEST, check_frames, check_unique, read_table, write_table
from rodsight.experiment.units import Scale, pixel_size_between
from rodsight.process.errors import InputError
from rodsight.verdicts.log import Entry, Flag, Origin, Verdict, VerdictLog

NUMBERS = st.floats(-LARGEST, LARGEST)
# Cells of a spreadsheet: no control characters and no surrounding blanks, which a reader removes.
WORDS = st.text(st.characters(exclude_categories=("Cc", "Cs", "Z")), min_size=1, max_size=8)
LENGTHS = st.floats(1e-5, 1e-2)


@given(st.lists(st.tuples(st.integers(0, 2**53), NUMBERS, WORDS), min_size=1, max_size=6))
def test_table_preserves_every_digit(rows):
    frame, value, name = zip(*rows, strict=True)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "table.csv"
        write_table(file, {"frame": frame, "passed over": frame, "value": value, "name": name})
        table = read_table(file, ("name", "value", "frame"))
    assert table.integers("frame").tolist() == list(frame)
    assert table.numbers("value").tolist() == list(value)
    assert table.text("name") == list(name)


@given(st.integers(1, 8), st.data())
def test_bad_cell_is_named_with_its_row(count, data):
    bad = data.draw(st.integers(0, count - 1))
    text, problem = data.draw(
        st.sampled_from([("nan", "finite"), ("inf", "finite"), ("1,5", "cells"), ("x", "number")])
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "table.csv"
        lines = [f"{k},{text if k == bad else 0.5}" for k in range(count)]
        file.write_text("frame,x\n\n" + "\n".join(lines) + "\n", encoding="utf-8")  # an empty line counts as a line
        with pytest.raises(InputError, match=f"row {bad + 3}.*{problem}"):
            read_table(file, ("frame", "x")).numbers("x")


@given(st.lists(st.integers(0, 6), min_size=1, max_size=8))
def test_frames_count_from_zero_without_gaps(frames):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "table.csv"
        write_table(file, {"frame": frames})
        table = read_table(file, ("frame",))
    whole = sorted(set(frames)) == list(range(len(set(frames))))
    if whole:
        assert check_frames(table, np.array(frames)) == len(set(frames))
    else:
        with pytest.raises(InputError, match="without gaps"):
            check_frames(table, np.array(frames))
    if len(set(frames)) == len(frames):
        check_unique(table, "frame", np.array(frames))
    else:
        again = next(k for k, frame in enumerate(frames) if frame in frames[:k])
        with pytest.raises(InputError, match=f"row {again + 2}, .*twice"):
            check_unique(table, "frame", np.array(frames))


@given(LENGTHS, st.floats(0.8, 1.25), st.integers(10, 6000), st.floats(-50, 6000), st.floats(-50, 6000))
def test_pixels_to_metres_and_back_is_exact(size, ratio, height, column, row):
    scale = Scale(size, height, ratio * size)
    point = scale.to_world(np.array([column, row]))
    assert scale.to_pixels(point) == pytest.approx([column, row], abs=1e-9 * height)
    assert scale.to_world(np.array([0.0, height - 1.0])).tolist() == [0.0, 0.0]  # the bottom left pixel
    up = scale.to_world(np.array([column, row - 1.0])) - point
    assert up == pytest.approx([0.0, ratio * size], abs=1e-9 * size * height)
    assert scale.size_at(np.array([column, row])) == pytest.approx(size * np.sqrt(ratio))
    assert scale.angle_to_world(scale.angle_to_world(0.3)) == 0.3
    assert scale.angle_to_world(0.3) == -0.3  # y goes down in a photograph, and up in the world


@given(st.floats(-4e-9, 4e-9), st.floats(0, 1800), st.floats(0, 1100))
def test_lens_distortion_is_invertible(bend, column, row):
    lens = BrownLens(xc=900.0, yc=550.0, K1=bend, K2=0.0, K3=0.0, P1=0.0, P2=0.0)
    scale = Scale(2e-4, 1100, None, lens)
    there = scale.to_world(np.array([[column, row]]))
    assert scale.to_pixels(there) == pytest.approx(np.array([[column, row]]), abs=1e-4)


@given(LENGTHS, st.floats(0, 2 * np.pi), st.floats(10, 3000))
def test_pixel_size_follows_from_a_known_distance(size, angle, pixels):
    start = np.array([100.0, 200.0])
    end = start + pixels * np.array([np.cos(angle), np.sin(angle)])
    assert pixel_size_between(start, end, size * pixels) == pytest.approx(size, rel=1e-9)


VERDICTS = st.builds(
    Entry, frame=st.integers(0, 500), reviewer=WORDS, a=st.integers(0, 99), b=st.one_of(st.integers(100, 199), WORDS),
    verdict=st.sampled_from(Verdict), seconds=st.integers(0, 9999).map(lambda k: k / 1000),
    origin=st.sampled_from(Origin), blind=st.booleans(), time=st.just("2026-01-01T00:00:00+00:00"),
)  # fmt: skip
FLAGS = st.builds(
    Entry, frame=st.integers(0, 500), reviewer=WORDS, flag=st.sampled_from(Flag), on=st.booleans(),
    time=st.just("2026-01-01T00:00:00+00:00"),
)  # fmt: skip


@given(st.lists(st.one_of(VERDICTS, FLAGS), max_size=5))
def test_log_returns_the_written_entries(entries):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "verdicts.jsonl"
        written = VerdictLog(file).append_all(entries)
        read = VerdictLog(file).entries()
    assert read == written
    assert [each.subject for each in read] == [each.subject for each in entries]
    assert [each.verdict for each in read] == [each.verdict for each in entries]


@given(st.lists(VERDICTS, min_size=1, max_size=4), st.binary(min_size=1, max_size=6))
def test_incomplete_line_damages_no_other_entry(entries, rest):
    rest = b"{" + rest.replace(b"\n", b"")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "verdicts.jsonl"
        first = VerdictLog(file).append_all(entries[:1])
        with file.open("ab") as stream:
            stream.write(rest)
        later = VerdictLog(file).append_all(entries[1:]) if entries[1:] else []
        log = VerdictLog(file)
        assert log.entries() == first + later
        assert log.damaged_lines == (1 if later else 0)  # without a later line it may still be under way


def test_tables_are_valid_csv(tmp_path):
    file = tmp_path / "table.csv"
    write_table(file, {"name": ['a "quoted", one', "ä"], "x": [0.1, 1e-300]})
    with file.open(newline="", encoding="utf-8") as stream:
        assert list(csv.reader(stream)) == [["name", "x"], ['a "quoted", one', "0.1"], ["ä", "1e-300"]]
