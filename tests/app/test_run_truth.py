"""True forces belong to the grains of the run."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.process.errors import InputError
from rodsight.results.results import TruthContacts
from rodsight.run_truth import _of_same_grains

pytestmark = pytest.mark.unit

ROW = SimpleNamespace(
    tracks=SimpleNamespace(radius=np.full(9, 0.5), position=np.stack([[[float(x), 0.0] for x in range(9)]] * 2)),
    grains=SimpleNamespace(count=9),
    walls=SimpleNamespace(cell=None),
)


def chain_of(order: list[int]) -> TruthContacts:
    """Forces between neighbours in this order, and one on a wall."""
    i, j = np.minimum(order[:-1], order[1:]), np.maximum(order[:-1], order[1:])
    i, j = np.append(i, 0), np.append(j, 9)
    return TruthContacts(np.zeros(len(i), np.int64), i, j, np.ones(len(i)), np.zeros(len(i)))


def test_a_truth_of_the_same_grains_is_kept() -> None:
    truth = chain_of(list(range(9)))
    assert _of_same_grains(truth, ROW, Path("truth.csv")) is truth


def test_a_truth_of_other_ids_is_refused() -> None:
    with pytest.raises(InputError, match=r"truth\.csv: names other grains than this run: [78] of its 8 forces"):
        _of_same_grains(chain_of([0, 5, 1, 6, 2, 7, 3, 8, 4]), ROW, Path("truth.csv"))
