"""The fast parser of plain tables gives the same cells and the same errors as the csv module."""

from __future__ import annotations

import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rodsight.experiment.reading import plain_rows, tables
from rodsight.experiment.reading.plain_rows import split_plain
from rodsight.process.errors import InputError

ROWS = b"frame,id,x\n0,1,2.5\n0, 2 ,3\r\n1,1,-1e3\n"
PIECES = [",", "\n", "\r\n", "\r", '"', " ", "1", "2.5", "x", "é", "\0", "\ufeff", "id", "\u2028", "\x1f"]


def read(file, *, plain):
    with pytest.MonkeyPatch.context() as patch:
        if not plain:
            patch.setattr(tables, "split_plain", lambda *_: None)
        try:
            table = tables.read_table(file, ("id", "x"), optional=("y",))
        except InputError as error:
            return str(error)
        return {name: table.text(name) for name in table.names}, [table.where(row) for row in range(len(table))]


@given(
    body=st.lists(st.sampled_from(PIECES), max_size=30).map("".join),
    rows=st.integers(0, 3),
    block=st.sampled_from((3, plain_rows.BLOCK)),
)
def test_any_table_reads_as_by_the_csv_module(body, rows, block, tmp_path_factory):
    file = tmp_path_factory.getbasetemp() / "some.csv"
    file.write_bytes(("x,id,y\n" + rows * "1,2,3\n" + body).encode())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plain_rows, "BLOCK", block)
        patch.setattr(plain_rows, "CELLS", 1)
        assert read(file, plain=True) == read(file, plain=False)


@pytest.mark.parametrize("block", [3, plain_rows.BLOCK])
def test_plain_rows_are_split_into_columns(block, monkeypatch):
    monkeypatch.setattr(plain_rows, "BLOCK", block)
    monkeypatch.setattr(plain_rows, "CELLS", 1)
    found = split_plain(ROWS, ("id", "x"), ("y", "frame"))
    assert found is not None
    values = {name: list(cells) for name, cells in found.values.items()}
    assert values == {"id": ["1", "2", "1"], "x": ["2.5", "3", "-1e3"], "frame": ["0", "0", "1"]}
    assert list(found.line) == [2, 3, 4]


@pytest.mark.parametrize(
    "content",
    [b"id,x\n", b"id,x\n1,2\n\n3,4\n", b"id,x\n1,2\n3\n", b'id,x\n"1",2\n', b"id,x\r1,2\r", b"id,x\n,\n",
     b"id,id,x\n1,2,3\n", b"id,y\n1,2\n", b"id,x\n1,\xff\n", b"id,x\n1," + (1 << 17) * b"2" + b"\n"],
)  # fmt: skip
def test_tables_that_are_not_plain_are_left_to_the_csv_module(content):
    assert split_plain(content, ("id", "x"), ()) is None


@pytest.mark.thorough
def test_a_long_table_is_read_in_little_more_memory_than_that_of_its_file(tmp_path):
    file = tmp_path / "long.csv"
    file.write_text("id,x\n" + "".join(f"{row % 250},{row * 1.000001!r}\n" for row in range(100_000)))

    def most() -> int:
        tracemalloc.start()
        try:
            tables.read_table(file, ("id", "x")).numbers("x")
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    most()  # modules that are loaded once
    assert most() < 4 * file.stat().st_size  # the numbers included; decoded as a whole, six times
