"""Spoiled input of every kind ends in status 0 or 2, with one line, soon, in little memory, nothing half-written."""

from __future__ import annotations

import pytest

from .attempt import try_all
from .campaign import SEED, gather, try_pieces
from .cases import make_cases
from .table import MUTATIONS, note

QUICK = 500


def test_some_spoiled_inputs_do_no_harm(originals):
    count, wrong = try_all(make_cases(originals, QUICK, SEED))
    assert wrong == []
    assert count == QUICK


@pytest.mark.slow
def test_many_spoiled_inputs_do_no_harm(originals, tmp_path):
    file = tmp_path / "pieces.jsonl"
    try_pieces(originals, file)
    tried, wrong = gather([file])
    note("mutations", tried=tried, wrong=len(wrong))
    assert wrong == []
    assert tried == MUTATIONS
