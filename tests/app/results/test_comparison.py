"""Two runs are compared body by body, whatever ids either uses."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.results.comparison import DifferentPackingError, compare_runs, compare_with_truth
from rodsight.solver.contacts.contacts import Contacts

from tests.app.recording.fake_results import RADIUS, make_results, make_truth


@pytest.fixture(scope="module")
def results():
    return make_results(4, 5, 4)


def renamed(results, order, ids):
    """Return the run with its grains in another order (old row of each) and with other ids."""
    n = results.grains.count
    row = np.empty(n, np.int64)
    row[order] = np.arange(n)
    tracks = results.tracks
    columns = {name: getattr(tracks, name)[:, order] for name in ("position", "rotation", "sigma", "zncc", "status")}
    frames = []
    for frame in results.frames:
        old = frame.contacts
        i, j = row[old.i], np.where(old.with_wall, old.j, row[np.minimum(old.j, n - 1)])
        contacts = Contacts(i.astype(np.int32), j.astype(np.int32), old.gap, old.normal, old.point, n, old.wall_count)
        frames.append(replace(frame, contacts=contacts))
    return replace(results, tracks=replace(tracks, id=ids, radius=tracks.radius[order], **columns), frames=frames)


def forces(frame):
    return dict(zip(frame.contacts.key.tolist(), zip(frame.fn.tolist(), frame.ft.tolist(), strict=True), strict=True))


def expected(results, k):
    return forces(results.frames[k])


def test_a_run_agrees_with_itself(results):
    comparison = compare_runs(results, results)
    for agreement in comparison.agreement:
        assert (agreement.r_fn, agreement.scale, agreement.relative_l2) == (pytest.approx(1.0), pytest.approx(1.0), 0.0)
    assert comparison.notes == ()


@pytest.mark.parametrize("same_names", [True, False])
def test_grains_in_another_order_are_matched(results, same_names):
    order = np.random.default_rng(1).permutation(results.grains.count)
    ids = results.tracks.id[order] if same_names else results.tracks.id.copy()
    comparison = compare_runs(results, renamed(results, order, ids))
    for k, frame in enumerate(comparison.second.frames):
        assert forces(frame) == expected(results, k)
    assert any("positions" in note for note in comparison.notes) != same_names


def test_contacts_of_bodies_in_one_run_only_are_left_out_with_a_note(results):
    ids = results.tracks.id.copy()
    ids[3] = 999
    comparison = compare_runs(results, renamed(results, np.arange(len(ids)), ids))
    for k, frame in enumerate(comparison.second.frames):
        contacts = results.frames[k].contacts
        kept = contacts.key[(contacts.i != 3) & (contacts.j != 3)]
        assert frame.contacts.key.tolist() == kept.tolist()
    assert any("Left out" in note for note in comparison.notes)


def test_runs_over_different_frames_are_compared_where_they_overlap(results):
    later = replace(
        results, tracks=results.tracks.frames(1, 4), walls=results.walls.frames(1, 4), frames=results.frames[1:],
        statistics=results.statistics[1:],
    )  # fmt: skip
    for comparison in (
        compare_runs(results, later, starts=(0, 1)),
        compare_runs(later, results, starts=(1, 0)),
    ):
        assert len(comparison.agreement) == 3
        for agreement in comparison.agreement:
            assert agreement.relative_l2 == 0.0
    with pytest.raises(DifferentPackingError, match="no frame in common"):
        compare_runs(results, later, starts=(0, 9))


def test_another_packing_is_refused(results):
    away = replace(results, tracks=replace(results.tracks, position=results.tracks.position + 1.3 * RADIUS))
    with pytest.raises(DifferentPackingError, match="not the same packing"):
        compare_runs(results, away)


def test_pairs_of_a_truth_may_be_given_in_either_order(results):
    truth = make_truth(results, np.random.default_rng(3))
    swapped = np.random.default_rng(4).random(len(truth.i)) < 0.5
    i, j = np.where(swapped, truth.j, truth.i), np.where(swapped, truth.i, truth.j)
    given, usual = (
        compare_with_truth(results, each, name="run").second.frames for each in (replace(truth, i=i, j=j), truth)
    )
    for frame, expected_frame in zip(given, usual, strict=True):
        assert frame.contacts.key.tolist() == expected_frame.contacts.key.tolist()
        assert frame.fn.tolist() == expected_frame.fn.tolist()


def test_truth_is_compared_on_the_same_contacts(results):
    truth = make_truth(results, np.random.default_rng(3))
    comparison = compare_with_truth(results, truth, name="run")
    for k, frame in enumerate(comparison.second.frames):
        rows = truth.frame == k
        key = truth.i[rows] * results.frames[k].contacts.body_count + truth.j[rows]
        assert frame.contacts.key.tolist() == sorted(key.tolist())
        assert frame.fn.sum() == pytest.approx(truth.fn[rows].sum())
        assert 0.9 < comparison.agreement[k].r_fn < 1.0
