"""Forces of neighbouring photographs, averaged as far as they differ by errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.contacts.contacts import Contacts
from rodsight.solver.mixture.force_smoothing import neighbour_weights, smooth_forces
from rodsight.solver.posterior.frame_posterior import FramePosterior

NO_PAIRS = np.empty(0, np.int64)
GRAINS = 4001  # grain 0 is near all others: the key of a pair is the other one


def walk(frames: int, error: float, step: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """True forces (f, c) whose steps have this standard deviation, and the same with errors."""
    rng = np.random.default_rng(seed)
    true = 5.0 + np.cumsum(rng.normal(0.0, step, (frames, 4000)), axis=0)
    return true, true + rng.normal(0.0, error, true.shape)


def posterior_of(fn: np.ndarray, key: np.ndarray | None = None) -> FramePosterior:
    count, nothing = len(fn), np.zeros(len(fn))
    key = np.arange(1, count + 1) if key is None else key
    contacts = Contacts(
        np.zeros(count, np.int32), key.astype(np.int32), nothing, np.tile([1.0, 0.0], (count, 1)),
        np.zeros((count, 2)), GRAINS, 0,
    )  # fmt: skip
    return FramePosterior(
        contacts, fn, 0.1 * fn, 0.2 * fn, 0.1 * fn, np.full(count, 0.5), np.zeros((1, 2)), np.zeros(1), 0.0, 0.0, 0.0,
        0.9, 0.9, np.zeros(1), np.zeros(1),
    )  # fmt: skip


def test_errors_that_change_with_every_photograph_are_averaged_as_well_as_can_be() -> None:
    true, measured = walk(9, error=1.0, step=1.0)
    weight = neighbour_weights(measured, 4)
    assert weight.sum() == pytest.approx(1.0)
    best = np.linalg.solve(np.eye(9) + np.diff(np.eye(9), axis=0).T @ np.diff(np.eye(9), axis=0), np.eye(9)[4])
    np.testing.assert_allclose(weight, best, atol=0.05)
    assert np.mean((weight @ measured - true[4]) ** 2) < 0.5  # 1 of the photograph alone


def test_true_changes_are_no_errors() -> None:
    true, _ = walk(9, error=0.0, step=1.0)
    assert neighbour_weights(true, 4)[4] == pytest.approx(1.0, abs=0.02)
    rising = np.linspace(0.0, 1.0, 9)[:, None] * np.linspace(1.0, 2.0, 50)
    np.testing.assert_array_equal(neighbour_weights(rising, 0), np.eye(9)[0])


def test_forces_are_not_averaged_over_a_jump() -> None:
    _, measured = walk(9, error=1.0, step=0.3)
    jump = np.where(np.arange(9) > 4, np.random.default_rng(1).normal(0.0, 20.0, (4000, 1)), 0.0).T
    weight = neighbour_weights(measured + jump, 4)
    assert np.abs(weight[5:]).sum() < 0.05
    assert weight[:4].sum() > 0.3


def test_few_photographs_and_copies_show_no_error() -> None:
    _, measured = walk(3, error=1.0, step=0.1)
    np.testing.assert_array_equal(neighbour_weights(measured[:2], 0), [1.0, 0.0])
    assert neighbour_weights(measured, 1)[1] < 0.6
    np.testing.assert_array_equal(neighbour_weights(np.tile(measured[:1], (4, 1)), 1), np.eye(4)[1])
    apart = np.full((4, 8), np.nan)
    apart[np.repeat(np.arange(4), 2), np.arange(8)] = 1.0  # no pair is listed twice
    np.testing.assert_array_equal(neighbour_weights(apart, 1), np.eye(4)[1])


def test_forces_are_averaged_over_their_sums() -> None:
    _, measured = walk(5, error=1.0, step=0.1)
    alike = measured / measured.sum(axis=1, keepdims=True)
    load = np.array([1.0, 2.0, 4.0, 2.0, 1.0])
    found = smooth_forces([posterior_of(each) for each in load[:, None] * alike], 2, NO_PAIRS)
    expected = 4.0 * neighbour_weights(alike, 2) @ alike
    np.testing.assert_allclose(found.fn, expected)
    np.testing.assert_allclose(found.ft, 0.1 * expected)
    variance = neighbour_weights(alike, 2) @ (4.0 * 0.2 * alike) ** 2
    np.testing.assert_allclose(found.fn_sd, np.sqrt(variance))
    np.testing.assert_allclose(found.ft_sd, 0.5 * np.sqrt(variance))
    np.testing.assert_allclose(found.bearing_probability, 0.5)


def test_pairs_are_those_of_the_photograph_and_bear_nothing_where_they_are_not_listed() -> None:
    _, measured = walk(5, error=1.0, step=0.1)
    window = [posterior_of(each) for each in measured]
    window[1] = posterior_of(measured[1, 1:], np.arange(2, 4001))
    window[2] = posterior_of(measured[2, :-1], np.arange(1, 4000))
    found = smooth_forces(window, 2, np.array([7]))
    np.testing.assert_array_equal(found.contacts.key, window[2].contacts.key)
    assert found.bearing_probability[0] < 0.45
    assert found.bearing_probability[1] == pytest.approx(0.5)
    assert found.fn[6] == window[2].fn[6]  # a reviewer has judged it here
    assert found.fn[5] != window[2].fn[5]


def test_a_photograph_without_errors_stays_as_it_is() -> None:
    true, _ = walk(5, error=0.0, step=1.0)
    rising = [posterior_of(each) for each in 10.0 + np.linspace(0.0, 1.0, 5)[:, None] * true[:1]]
    assert smooth_forces(rising, 2, NO_PAIRS) is rising[2]
    without = [*rising[:4], replace(rising[4], fn=np.zeros(4000))]
    assert smooth_forces(without, 2, NO_PAIRS) is rising[2]
