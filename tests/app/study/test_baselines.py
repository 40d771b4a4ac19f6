"""Baselines are compared with the run on its own pairs and truth."""

from __future__ import annotations

import json

import numpy as np
import pytest
from rodsight.results.results import Results, TruthContacts
from rodsight.study.baselines import BaselineAgreement, baseline_lists, describe_baselines, score_baselines

from tests.app.recording.fake_results import make_results, make_truth


@pytest.fixture(scope="module")
def results() -> Results:
    return make_results(frame_count=2)


def own_forces(results: Results) -> TruthContacts:
    frames = results.frames
    return TruthContacts(
        np.concatenate([np.full(f.contacts.count, k) for k, f in enumerate(frames)]),
        *(np.concatenate([getattr(f.contacts, side) for f in frames]).astype(np.int64) for side in ("i", "j")),
        *(np.concatenate([getattr(f, name) for f in frames]) for name in ("fn", "ft")),
    )


def test_forces_that_are_the_truth_correlate_perfectly(results: Results) -> None:
    found = score_baselines(results, own_forces(results))
    assert [row.r_ours for row in found] == pytest.approx([1.0, 1.0])
    assert all(row.r_static < 0.999 for row in found)


def test_wrong_forces_correlate_imperfectly(results: Results) -> None:
    for row in score_baselines(results, make_truth(results, np.random.default_rng(3))):
        assert -1.0 <= row.r_ours < 0.9999


def test_contacts_of_the_truth_alone_count(results: Results) -> None:
    """The truth has one more strong contact, between rods that are far apart."""
    truth = own_forces(results)
    strong = 20.0 * truth.fn.max()
    more = TruthContacts(
        np.append(truth.frame, 1), np.append(truth.i, 0), np.append(truth.j, 40), np.append(truth.fn, strong),
        np.append(truth.ft, 0.0),
    )  # fmt: skip
    assert score_baselines(results, more)[1].r_ours < 0.5


def test_missing_correlations_are_none_in_lists_and_left_out_of_sentences() -> None:
    nan = float("nan")
    rows = [BaselineAgreement(0.5, nan, 0.25, nan), BaselineAgreement(0.75, nan, nan, 0.125)]
    lists = baseline_lists(rows)
    assert lists == {
        "r_ours": [0.5, 0.75], "r_static": [None, None], "r_overlap": [0.25, None], "r_uniform": [None, 0.125],
    }  # fmt: skip
    json.dumps(lists, allow_nan=False)
    assert "these forces 0.625; " in describe_baselines(rows)
    assert "in equilibrium –, nearest to the overlaps 0.250, uniform 0.125." in describe_baselines(rows)
