"""Spoiled input of every kind ends in status 0 or 2, with one line, soon, in little memory, nothing half-written."""

from __future__ import annotations

import pytest

from .attempt import attempt, try_all
from .campaign import SEED, gather, try_pieces
from .cases import make_cases
from .table import MUTATIONS, note

QUICK = 250


def test_some_spoiled_inputs_do_no_harm(originals):
    count, wrong = try_all(make_cases(originals, QUICK, SEED))
    assert wrong == []
    assert count == QUICK


def test_the_shortcut_begins_commands_as_the_parser_does(originals):
    for _, make in list(make_cases(originals, 63, SEED))[::8]:
        arguments, _ = make()
        shorter, whole = attempt(arguments, parsed=False), attempt(arguments)
        assert (shorter.status, shorter.said) == (whole.status, whole.said), arguments


@pytest.mark.slow
def test_many_spoiled_inputs_do_no_harm(originals, tmp_path):
    file = tmp_path / "pieces.jsonl"
    try_pieces(originals, file)
    tried, wrong = gather([file])
    note("mutations", tried=tried, wrong=len(wrong))
    assert wrong == []
    assert tried == MUTATIONS
