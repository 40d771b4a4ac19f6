"""The studies run and count on packings that are too small for conclusions."""

from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console
from rodsight.inference.infer_sequence import infer_sequence
from rodsight.study.accuracy import measure_accuracy
from rodsight.study.claims import study_claims
from rodsight.study.truths import agreement_of, observe, simulate, truth_keys, window_starts

GRAINS, REVERSAL_ANGLE, WINDOW = 30, 3.0, 7


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    cached = tmp_path_factory.mktemp("truths")
    simulate(0, grains=GRAINS, folder=cached, reversal_angle=REVERSAL_ANGLE)
    return cached


@pytest.fixture(scope="module")
def truth(folder):
    return simulate(0, grains=GRAINS, folder=folder, reversal_angle=REVERSAL_ANGLE)


@pytest.mark.thorough
def test_a_truth_is_simulated_once_and_read_back_the_same(truth, folder, monkeypatch):
    def fail(*_args, **_kwargs):
        raise AssertionError("simulated again")

    monkeypatch.setattr("rodsight.study.truths.prepare_packing", fail)
    again = simulate(0, grains=GRAINS, folder=folder, reversal_angle=REVERSAL_ANGLE)
    assert np.array_equal(truth.fn, again.fn)
    assert again.wall_names == truth.wall_names
    assert len(truth.position) == 2 * round(REVERSAL_ANGLE / 0.25) + 1


def test_windows_lie_on_either_side_of_the_reversal(truth):
    up, back = window_starts(truth, WINDOW)
    reversal = len(truth.position) // 2
    assert up + WINDOW <= reversal <= back
    with pytest.raises(ValueError, match="do not fit"):
        window_starts(truth, 60)


def test_true_forces_agree_perfectly_with_themselves(truth):
    start = window_starts(truth, WINDOW)[0]
    inputs = observe(truth, range(start, start + 2), 0.0, np.random.default_rng(0), estimator="nlgs")
    found = agreement_of(infer_sequence(inputs).frames[0], truth, start)
    assert found.contact_recall == 1.0
    assert -1.0 <= found.r_fn <= 1.0


@pytest.mark.thorough
def test_the_accuracy_of_exact_tracks_is_measured(truth):
    row = measure_accuracy([truth], 0.0, "ensemble", window=WINDOW)
    assert row.late > 0.85  # 30 grains, no noise
    assert 0.9 < row.scale < 1.1
    assert row.cpu > 0


@pytest.mark.slow
def test_the_papers_claims_are_listed_with_a_verdict(folder, monkeypatch):
    monkeypatch.setattr(
        "rodsight.study.claims.simulate", lambda seed, **kw: simulate(seed, **{**kw, "reversal_angle": REVERSAL_ANGLE})
    )
    shown = StringIO()
    verdicts = study_claims([0], grains=GRAINS, folder=folder, console=Console(file=shown, width=200), window=WINDOW)
    assert len(verdicts) == 5
    assert all(row.measured and row.verdict for row in verdicts)
    assert "settles in about five photographs" in shown.getvalue()


@pytest.mark.thorough
def test_forces_of_a_packing_with_an_inferred_rod_are_compared_body_by_body(truth):
    start = window_starts(truth, WINDOW)[0]
    frame = infer_sequence(observe(truth, range(start, start + WINDOW), 1e-6, np.random.default_rng(1))).frames[0]
    contacts, rods = frame.contacts, len(truth.radius)
    wider = replace(
        contacts, grain_count=rods + 1, j=np.where(contacts.with_wall, contacts.j + 1, contacts.j).astype(np.int32)
    )
    own, seen = truth_keys(contacts, truth)
    other, also_seen = truth_keys(wider, truth)
    assert seen.all()
    assert also_seen.all()
    np.testing.assert_array_equal(own, contacts.key)
    np.testing.assert_array_equal(other, own)
    unknown = replace(wider, j=np.where(np.arange(wider.count) == 0, rods, wider.j).astype(np.int32))
    assert truth_keys(unknown, truth)[1].tolist() == [False, *[True] * (wider.count - 1)]
