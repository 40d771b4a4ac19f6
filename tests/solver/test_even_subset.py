"""Rows of a sample."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.even_subset import even_subset

pytestmark = pytest.mark.unit


def test_all_rows_of_few():
    assert even_subset(4, 9).tolist() == [0, 1, 2, 3]


def test_both_ends_and_even_steps_of_many():
    rows = even_subset(1001, 11)
    assert rows.tolist() == list(range(0, 1001, 100))
    assert np.ptp(np.diff(even_subset(1000, 7))) <= 1


@pytest.mark.parametrize(("count", "most"), [(0, 5), (5, 0), (-3, 4)])
def test_none_of_none(count: int, most: int):
    assert len(even_subset(count, most)) == 0
