"""Queues, estimates of accuracy, agreement, and the threshold that fits the verdicts."""

from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.reviewing.judging.candidate_pairs import CandidatePairs
from rodsight.reviewing.judging.estimate import NO, UNJUDGED, YES, estimate_detector
from rodsight.reviewing.judging.queue import (
    STRATUM_COUNT,
    frame_queue,
    influence_priority,
    influence_queue,
    sampled_queue,
    strata,
)
from rodsight.reviewing.judging.threshold import fit_threshold, threshold_curve
from rodsight.solver.contacts.contacts import Contacts
from rodsight.verdicts.log import Entry, Verdict, VerdictLog
from rodsight.verdicts.reviewers import DETECTOR, cohen_kappa, reviewer_kappas


def candidates(frame, probability):
    c = len(probability)
    i = np.zeros(c, np.int32)
    contacts = Contacts(
        i, np.arange(1, c + 1, dtype=np.int32), np.zeros(c), np.zeros((c, 2)), np.zeros((c, 2)), c + 1, 0
    )
    return CandidatePairs(frame, contacts, np.ones(c), probability, probability >= 0.5, 1e-4)


@pytest.fixture
def frames():
    rng = np.random.default_rng(3)
    return [candidates(k, rng.beta(0.3, 0.1, 300)) for k in range(4)]


def test_the_most_ambiguous_come_first(frames):
    queue = frame_queue(frames[0])
    ambiguity = dict(zip(frames[0].key.tolist(), frames[0].ambiguity, strict=True))
    inside = [ambiguity[key] for key in queue.key.tolist()]
    assert min(inside[:10]) > 0.6
    assert max(inside[-10:]) < 0.02
    assert (np.diff(queue.stratum) >= 0).all()
    assert sorted(queue.key.tolist()) == frames[0].key.tolist()


def test_next_wraps_around_and_skips_judged_pairs(frames):
    queue = frame_queue(frames[0])
    pairs = list(zip(queue.frame.tolist(), queue.key.tolist(), strict=True))
    assert queue.next_place([]) == 0
    assert queue.next_place(pairs[:3]) == 3
    assert queue.next_place(pairs[:3], after=pairs[5]) == 6
    assert queue.next_place(pairs[:3], after=pairs[-1]) == 3
    assert queue.next_place(pairs) is None
    assert queue.next_place(pairs[:-1], after=pairs[-1]) == len(pairs) - 1


def test_influence_comes_first_and_blind_order_is_random(frames):
    """Ambiguity times force: of two equally ambiguous pairs the one with the larger force precedes."""
    found = candidates(0, np.array([0.5, 0.5, 0.9, 0.999]))
    forces = SimpleNamespace(contacts=SimpleNamespace(key=found.key[:3]), fn=np.array([1.0, 3.0, 40.0]))
    results = SimpleNamespace(frames=[forces], statistics=[SimpleNamespace(mean_fn=2.0)])
    np.testing.assert_allclose(influence_priority(results, found), [1.0, 3.0, 8.0, 0.004])
    queue = influence_queue(results, found)
    assert queue.key.tolist() == found.key[[2, 1, 0, 3]].tolist()
    assert not queue.random
    blind = frame_queue(frames[0], blind=True)
    assert blind.random
    ambiguity = dict(zip(frames[0].key.tolist(), frames[0].ambiguity, strict=True))
    order = np.array([ambiguity[key] for key in blind.key.tolist()])
    assert abs(np.corrcoef(order, np.arange(len(order)))[0, 1]) < 0.2
    assert sampled_queue(frames, blind=True).key.tolist() != sampled_queue(frames).key.tolist()


def test_a_sample_meets_every_stratum_early_and_every_candidate_once(frames):
    queue = sampled_queue(frames)
    every = {(each.frame, key) for each in frames for key in each.key.tolist()}
    assert set(zip(queue.frame.tolist(), queue.key.tolist(), strict=True)) == every
    assert queue.count == len(every)
    present = set(np.concatenate([strata(each) for each in frames]).tolist())
    assert set(queue.stratum[: 48 + STRATUM_COUNT].tolist()) == present


@pytest.mark.thorough
def test_the_interval_contains_the_truth_at_its_stated_rate(frames):
    """The queue is a random sample: 95 % intervals contain the true precision and recall in about 95 % of draws."""
    probability = np.concatenate([each.probability for each in frames])
    place = {(each.frame, key): n for n, (each, key) in enumerate((e, k) for e in frames for k in e.key.tolist())}
    queue = sampled_queue(frames)
    order = np.array([place[pair] for pair in zip(queue.frame.tolist(), queue.key.tolist(), strict=True)])
    held = np.zeros(2)
    draws = 200
    for draw in range(draws):
        rng = np.random.default_rng(draw)
        true = (rng.random(len(probability)) < probability)[order]
        outcome = np.full(queue.count, UNJUDGED)
        outcome[:300] = np.where(true[:300], YES, NO)
        found = estimate_detector(
            queue.stratum, queue.detected, queue.probability, outcome, outcome != UNJUDGED, 0, rng
        )
        precision = true[queue.detected].mean()
        recall = queue.detected[true].mean()
        held += [
            found.precision.low <= precision <= found.precision.high,
            found.recall.low <= recall <= found.recall.high,
        ]
    assert (held / draws > 0.88).all()  # 95 % less four standard deviations of 200 draws


def test_once_all_are_judged_the_interval_is_a_point(frames):
    queue = frame_queue(frames[0])
    true = np.random.default_rng(0).random(queue.count) < 0.7
    outcome = np.where(true, YES, NO)
    found = estimate_detector(
        queue.stratum,
        queue.detected,
        queue.probability,
        outcome,
        np.ones(queue.count, bool),
        5,
        np.random.default_rng(1),
    )
    assert found.precision.low == found.precision.high == pytest.approx(true[queue.detected].mean())
    assert found.recall.low == found.recall.high == pytest.approx(true[queue.detected].sum() / (true.sum() + 5))


def test_picked_pairs_do_not_change_the_estimate_of_the_rest(frames):
    """A reviewer who clicks every error does not lower the estimate of the whole frame."""
    queue = frame_queue(frames[0])
    outcome = np.full(queue.count, UNJUDGED)
    outcome[queue.detected] = np.where(np.arange(queue.detected.sum()) < 10, NO, UNJUDGED)
    rng = np.random.default_rng(1)
    picked = estimate_detector(
        queue.stratum, queue.detected, queue.probability, outcome, np.zeros(queue.count, bool), 0, rng
    )
    drawn = estimate_detector(queue.stratum, queue.detected, queue.probability, outcome, outcome != UNJUDGED, 0, rng)
    assert picked.precision.high > drawn.precision.high


def test_kappa_of_a_known_table():
    """Both yes 20, first alone 5, second alone 10, both no 15: observed .7, by chance .5, κ = .4."""
    first = np.repeat([True, True, False, False], [20, 5, 10, 15])
    second = np.repeat([True, False, True, False], [20, 5, 10, 15])
    observed, kappa, error = cohen_kappa(first, second)
    assert observed == pytest.approx(0.7)
    assert kappa == pytest.approx(0.4)
    assert error == pytest.approx(np.sqrt(0.7 * 0.3 / 50) / 0.5)
    assert np.isnan(cohen_kappa(np.ones(5, bool), np.ones(5, bool))[1])


def test_people_are_compared_with_each_other_and_with_the_detector(tmp_path):
    log = VerdictLog(tmp_path / "verdicts.jsonl")
    for b in range(2, 12):
        log.append(Entry(0, "anna", 1, b, Verdict.CONTACT if b % 2 else Verdict.NO_CONTACT))
        log.append(Entry(0, "ben", b, 1, Verdict.CONTACT if b % 2 else Verdict.NO_CONTACT))
    log.append(Entry(0, "ben", 1, 2, Verdict.UNSURE))
    found = {(each.first, each.second): each for each in reviewer_kappas(log, {(0, 1, b): True for b in range(2, 12)})}
    assert set(found) == {("anna", "ben"), ("anna", DETECTOR), ("ben", DETECTOR)}
    assert found["anna", "ben"].count == 9
    assert found["anna", "ben"].kappa == pytest.approx(1.0)
    assert found["anna", DETECTOR].observed == pytest.approx(0.5)


def test_the_threshold_separates_contacts_from_gaps_and_the_radius_is_found():
    """Radii 20 µm too small: contacts measure +40 µm between grains and +20 µm at walls, open pairs from 120 µm on."""
    rng = np.random.default_rng(5)
    wall = np.arange(400) % 5 == 0
    touching = np.arange(400) < 300
    gap = np.where(
        touching, np.where(wall, 20e-6, 40e-6) + 5e-6 * rng.standard_normal(400), rng.uniform(12e-5, 3e-4, 400)
    )
    found = fit_threshold(gap, touching.astype(float), wall, np.ones(400, bool), 1e-5, rng)
    assert gap[touching].max() < found.threshold < gap[~touching].min()
    assert found.threshold_sigmas == pytest.approx(found.threshold / 1e-5)
    assert found.radius_change == pytest.approx(20e-6, abs=4 * found.radius_change_sd)
    assert found.radius_change_sd < 1e-6
    assert found.threshold_with_change == pytest.approx(found.threshold - 40e-6, abs=10e-6)


def test_the_curve_of_a_small_case():
    gap, touching = np.array([-1.0, 0.0, 1.0, 2.0]), np.array([1.0, 1.0, 0.0, 1.0])
    curve = threshold_curve(gap, touching, np.array([-2.0, 0.5, 1.5, 3.0]))
    assert np.isnan(curve.precision[0])
    assert curve.precision[1:] == pytest.approx([1.0, 2 / 3, 0.75])
    assert curve.recall == pytest.approx([0.0, 2 / 3, 2 / 3, 1.0])


def test_verdicts_of_one_kind_fit_no_threshold():
    with pytest.raises(ValueError, match="both kinds"):
        fit_threshold(np.zeros(3), np.ones(3), np.zeros(3, bool), np.ones(3, bool), 1.0, np.random.default_rng(0))
