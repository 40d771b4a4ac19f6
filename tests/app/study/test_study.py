"""The studies run on packings far too small to conclude anything from: that they run and count is all."""

from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console
from rodsight.inference.inference import infer_frames
from rodsight.study.accuracy import measure_accuracy
from rodsight.study.claims import study_claims
from rodsight.study.truths import agreement_of, observe, simulate, starts_of, truth_keys

GRAINS, TURN, WINDOW = 30, 3.0, 7


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    kept = tmp_path_factory.mktemp("truths")
    simulate(0, grains=GRAINS, folder=kept, turn=TURN)
    return kept


@pytest.fixture(scope="module")
def truth(folder):
    return simulate(0, grains=GRAINS, folder=folder, turn=TURN)


def test_a_truth_is_simulated_once_and_read_back_the_same(truth, folder, monkeypatch):
    def never(*_args, **_kwargs):
        raise AssertionError("simulated again")

    monkeypatch.setattr("rodsight.study.truths.prepare_packing", never)
    again = simulate(0, grains=GRAINS, folder=folder, turn=TURN)
    assert np.array_equal(truth.fn, again.fn)
    assert again.wall_names == truth.wall_names
    assert len(truth.position) == 2 * round(TURN / 0.25) + 1


def test_windows_lie_on_either_side_of_the_turn(truth):
    up, back = starts_of(truth, WINDOW)
    turn = len(truth.position) // 2
    assert up + WINDOW <= turn <= back
    with pytest.raises(ValueError, match="do not fit"):
        starts_of(truth, 60)


def test_true_forces_agree_perfectly_with_themselves(truth):
    start = starts_of(truth, WINDOW)[0]
    inputs = observe(truth, range(start, start + 2), 0.0, np.random.default_rng(0), estimator="nlgs")
    found = agreement_of(next(infer_frames(inputs)).forces, truth, start)
    assert found.contact_recall == 1.0
    assert -1.0 <= found.r_fn <= 1.0


def test_the_accuracy_of_exact_tracks_is_measured(truth):
    row = measure_accuracy([truth], 0.0, "ensemble", window=WINDOW)
    assert row.late > 0.85  # 30 grains, no noise
    assert 0.9 < row.scale < 1.1
    assert row.cpu > 0


@pytest.mark.slow
def test_the_papers_claims_are_listed_with_a_verdict(folder, monkeypatch):
    monkeypatch.setattr("rodsight.study.claims.simulate", lambda seed, **kw: simulate(seed, **{**kw, "turn": TURN}))
    shown = StringIO()
    verdicts = study_claims([0], grains=GRAINS, folder=folder, console=Console(file=shown, width=200), window=WINDOW)
    assert len(verdicts) == 5
    assert all(row.measured and row.verdict for row in verdicts)
    assert "settles in about five photographs" in shown.getvalue()


def test_forces_of_a_packing_with_an_inferred_rod_are_compared_body_by_body(truth):
    start = starts_of(truth, WINDOW)[0]
    frame = next(infer_frames(observe(truth, range(start, start + WINDOW), 1e-6, np.random.default_rng(1)))).forces
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
    strange = replace(wider, j=np.where(np.arange(wider.count) == 0, rods, wider.j).astype(np.int32))
    assert truth_keys(strange, truth)[1].tolist() == [False, *[True] * (wider.count - 1)]
