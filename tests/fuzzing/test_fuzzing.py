"""Corrupted input of every kind ends with status 0 or 2 and one line, fast, in little memory, without partial files."""

from __future__ import annotations

import pytest

from .attempt import attempt, run_all
from .campaign import SEED, gather, run_pieces
from .cases import make_cases
from .table import MUTATIONS, note

QUICK = 63


@pytest.mark.thorough
def test_some_corrupted_inputs_do_no_harm(originals):
    count, problems = run_all(make_cases(originals, QUICK, SEED))
    assert problems == []
    assert count == QUICK


@pytest.mark.thorough
def test_the_shortcut_runs_commands_like_the_parser(originals):
    for _, make in list(make_cases(originals, QUICK, SEED))[::8]:
        arguments, _ = make()
        shorter, whole = attempt(arguments, parsed=False), attempt(arguments)
        assert (shorter.status, shorter.errors) == (whole.status, whole.errors), arguments


@pytest.mark.slow
def test_many_corrupted_inputs_do_no_harm(originals, tmp_path):
    file = tmp_path / "pieces.jsonl"
    run_pieces(originals, file)
    tried, problems = gather([file])
    note("mutations", tried=tried, wrong=len(problems))
    assert problems == []
    assert tried == MUTATIONS
