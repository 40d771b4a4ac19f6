"""Spoiled input of every kind ends in status 0 or 2, with one line, soon, in little memory, nothing half-written."""

from __future__ import annotations

import pytest

from .attempt import try_all
from .cases import make_cases
from .table import MUTATIONS, note

QUICK, SEED = 500, 20


def test_some_spoiled_inputs_do_no_harm(originals):
    count, wrong = try_all(make_cases(originals, QUICK, SEED))
    assert wrong == []
    assert count == QUICK


@pytest.mark.slow
def test_many_spoiled_inputs_do_no_harm(originals):
    count, wrong = try_all(make_cases(originals, MUTATIONS, SEED + 1))
    note("mutations", tried=count, wrong=len(wrong))
    assert wrong == []
    assert count == MUTATIONS
