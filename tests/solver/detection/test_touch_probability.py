import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.motion import Snapshot
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.detection.touch_probability import (
    ContactProbabilitySettings,
    find_touch_candidates,
    probable_contacts,
    smooth_gaps,
    touch_probability,
    window_of,
)

SIGMA = 14e-6  # m, of a gap
SCALE = 75e-6  # m per interval
FRAMES = 8
EXACT = 1e-9  # rounding of 8 normalised steps over 49 states


def probability(gap: np.ndarray, **settings: float) -> np.ndarray:
    gap = np.atleast_2d(gap.T).T
    return touch_probability(
        gap, np.full(gap.shape, SIGMA), np.full(len(gap) - 1, SCALE), ContactProbabilitySettings(**settings)
    )


def enumerate_paths(gap: np.ndarray, state_gap: np.ndarray, start: np.ndarray, step: np.ndarray) -> np.ndarray:
    """P(state 0) per frame by summing over every path."""
    frames, states = len(gap), len(state_gap)
    weight = np.zeros((frames, states))
    for path in np.ndindex(*([states] * frames)):
        p = start[path[0]]
        for f in range(frames):
            p *= max(np.exp(-0.5 * ((gap[f] - state_gap[path[f]]) / SIGMA) ** 2), 1e-12)
            if f:
                p *= step[path[f - 1], path[f]]
        for f in range(frames):
            weight[f, path[f]] += p
    return weight[:, 0] / weight.sum(axis=1)


def test_pair_that_stays_at_zero_gap_touches():
    assert probability(np.zeros(FRAMES)).min() > 0.95


def test_large_gap_does_not_touch():
    assert probability(np.full(FRAMES, 10 * SIGMA)).max() < 1e-6


def test_gap_of_the_size_of_the_noise_stays_uncertain():
    certain = probability(np.full(FRAMES, 2.0 * SIGMA))[FRAMES // 2, 0]
    assert 0.05 < certain < 0.95


def test_more_photographs_increase_the_probability():
    once = probability(np.zeros(1))[0, 0]
    often = probability(np.zeros(FRAMES))[FRAMES // 2, 0]
    assert 0.5 < once < often


def test_opening_contact_is_found():
    gap = np.array([0, 0, 0, 0, 60, 120, 180, 240]) * 1e-6
    touch = probability(gap)[:, 0]
    assert touch[:3].min() > 0.9
    assert touch[4:].max() < 1e-3


def test_closing_pair_is_open_at_first():
    gap = np.array([5e-3, 3e-3, 1e-3, 0, 0, 0, 0, 0])
    touch = probability(gap)[:, 0]
    assert touch[:3].max() < 1e-9
    assert touch[4:].min() > 0.9


def test_missing_photograph_is_interpolated():
    gap = np.zeros(FRAMES)
    gap[3:5] = np.nan
    assert probability(gap).min() > 0.9
    assert probability(np.where(np.isnan(gap), gap, 10 * SIGMA)).max() < 0.05


def test_short_and_empty_sequences_are_valid():
    assert probability(np.zeros(2)).shape == (2, 1)
    assert probability(np.empty((3, 0))).shape == (3, 0)
    np.testing.assert_array_equal(probability(np.full(3, np.nan)), 0.5)


def test_deep_overlap_still_touches():
    gap = np.zeros(FRAMES)
    gap[4] = -30 * SIGMA
    assert probability(gap).min() > 0.9


def test_result_is_nearly_symmetric_in_time():
    gap = np.abs(np.random.default_rng(0).normal(size=(FRAMES, 40))) * 3 * SIGMA
    gap[:, 0] = 0.0
    forward, backward = probability(gap), probability(gap[::-1])[::-1]
    # The chain is not exactly reversible (it opens by an exponential law, closes from any gap): compare classes.
    assert np.mean((forward > 0.5) == (backward > 0.5)) > 0.95


def test_half_the_overlap_is_added_to_the_gap():
    gap = np.full((FRAMES, 1), 1.2 * SIGMA)
    shifted = touch_probability(
        gap - 20e-6,
        np.full(gap.shape, SIGMA),
        np.full(FRAMES - 1, SCALE),
        ContactProbabilitySettings(overlap=40e-6),
    )
    np.testing.assert_allclose(shifted, probability(gap), atol=EXACT)


def as_matrix(step: np.ndarray, state_gap: np.ndarray, width: np.ndarray, scale: float) -> np.ndarray:
    """Transition matrix (q, q), from row to column, of the rows of a transition."""
    _, opens, closes, spreads = step
    apart = np.abs(state_gap[:, None] - state_gap[None, :])
    matrix = spreads[:, None] * np.exp(-apart / scale) * width[None, :]
    matrix[:, 0], matrix[0] = closes, opens
    matrix[0, 0] = 0.95
    return matrix


def test_smoother_agrees_with_summing_over_all_paths():
    from rodsight.solver.detection import touch_probability as module
    from rodsight.solver.detection.touch_probability_kernels import smooth_candidates

    rng = np.random.default_rng(1)
    states, frames = 4, 4
    state_gap, width = np.array([0.0, 10e-6, 30e-6, 70e-6]), np.array([0.0, 20e-6, 20e-6, 60e-6])
    start = np.array([0.5, 0.1, 0.2, 0.2])
    step = module.find_transition(state_gap, width, 25e-6)
    gap = rng.uniform(0, 70e-6, (frames, 5))
    touch = np.empty((frames, 5))
    smooth_candidates(
        gap, np.full(gap.shape, SIGMA), module.LOWEST_GAP, state_gap, start, np.repeat(step[None], frames - 1, axis=0),
        width, module.STAY, 1e-12,
        np.empty((frames, states)), np.empty((frames, states)), np.empty((2, states)), np.empty((3, states)), touch,
        np.zeros(states), np.full(gap.shape, SIGMA**2), np.empty(gap.shape), np.empty(gap.shape),
    )  # fmt: skip
    expected = np.stack(
        [enumerate_paths(gap[:, c], state_gap, start, as_matrix(step, state_gap, width, 25e-6)) for c in range(5)],
        axis=1,
    )
    np.testing.assert_allclose(touch, expected, atol=EXACT)


def test_posterior_of_a_lasting_contact_is_narrower_than_the_noise():
    gap = np.random.default_rng(3).normal(0.0, SIGMA, (FRAMES, 200))
    sigma, scale = np.full(gap.shape, SIGMA), np.full(FRAMES - 1, SCALE)
    found = smooth_gaps(gap, sigma, scale, ContactProbabilitySettings())
    certain = found.touch > 0.9
    assert certain.mean() > 0.5
    assert np.sqrt(found.variance[certain]).max() < SIGMA
    assert np.abs(found.mean[certain]).mean() < 0.5 * np.abs(gap[certain]).mean()


def test_unknown_gap_is_inferred_from_other_frames():
    gap = np.zeros((FRAMES, 1))
    gap[FRAMES // 2] = np.nan
    found = smooth_gaps(gap, np.full(gap.shape, SIGMA), np.full(FRAMES - 1, SCALE), ContactProbabilitySettings())
    assert np.isfinite(found.mean).all()
    assert found.variance[FRAMES // 2, 0] > found.variance[0, 0]


@pytest.mark.parametrize("scale", [1e-9, 1e-6, 1e-4, 1e-1])
def test_transitions_are_probabilities_at_any_scale(scale: float):
    from rodsight.solver.detection.touch_probability import _states, find_transition

    state_gap, width = _states(5e-4)
    matrix = as_matrix(find_transition(state_gap, width, scale), state_gap, width, scale)
    assert matrix.min() >= 0
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, atol=EXACT)


def test_impossible_noise_or_scale_is_refused():
    gap = np.zeros((3, 2))
    with pytest.raises(ValueError, match="positive"):
        touch_probability(gap, np.zeros((3, 2)), np.full(2, SCALE))
    with pytest.raises(ValueError, match="positive"):
        touch_probability(gap, np.full((3, 2), SIGMA), np.zeros(2))
    with pytest.raises(ValueError, match="one length per interval"):
        touch_probability(gap, np.full((3, 2), SIGMA), np.full(3, SCALE))


def three_grains() -> tuple[Grains, np.ndarray, list[Walls]]:
    grains = Grains.of_rods(np.full(3, 0.01), density=2700.0, length=0.06)
    position = np.zeros((2, 3, 2))
    position[0] = [[0.01, 0.01], [0.03, 0.01], [0.06, 0.05]]
    position[1] = [[0.01, 0.01], [0.03, 0.01], [0.03, 0.03 + 2e-5]]
    endpoints = np.array([[[0.0, 0.0], [0.1, 0.0]]])
    return grains, position, [Walls.at_rest(endpoints)] * 2


def test_candidates_are_close_in_some_frame_and_measured_in_all():
    grains, position, walls = three_grains()
    sigma = np.full((2, 3), 1e-5)
    found = find_touch_candidates(grains, position, np.ones((2, 3), bool), sigma, walls, ContactProbabilitySettings())
    assert list(zip(found.i.tolist(), found.j.tolist(), strict=True)) == [(0, 1), (0, 3), (1, 2), (1, 3)]
    np.testing.assert_allclose(found.gap[:, 2], [np.hypot(0.03, 0.04) - 0.02, 2e-5], atol=1e-15)
    np.testing.assert_allclose(found.sigma[0], 1e-5 * np.sqrt([2, 1, 2, 1]))


def test_lost_grain_has_no_gap():
    grains, position, walls = three_grains()
    position[0, 1] = 7.0
    present = np.array([[True, False, True], [True, True, True]])
    found = find_touch_candidates(grains, position, present, np.full((2, 3), 1e-5), walls, ContactProbabilitySettings())
    touches = (found.i == 1) | (found.j == 1)
    assert touches.any()
    assert np.all(np.isnan(found.gap[0, touches]))
    assert np.all(np.isfinite(found.gap[1]))


def test_reach_of_candidates_includes_noise_overlap_and_radii():
    grains, position, walls = three_grains()
    sigma = np.full((2, 3), 1e-5)
    position = np.repeat(position[1:], 2, axis=0)
    settings = ContactProbabilitySettings(overlap=4e-6, radius_sd=5e-6, margin=20e-6, reach=6.0)
    # 6 · √(σ² + overlap²/2) + margin + 3 · 5 µm
    reach = 6.0 * np.sqrt(1e-10 + 0.5 * 16e-12) + 20e-6 + 15e-6
    for gap, found in ((0.999 * reach, True), (1.001 * reach, False)):
        position[:, 2] = [0.03, 0.03 + gap]
        named = find_touch_candidates(grains, position, np.ones((2, 3), bool), sigma, walls, settings)
        assert ((1, 2) in zip(named.i.tolist(), named.j.tolist(), strict=True)) is found


def test_window_has_four_frames_before_and_three_after():
    assert list(window_of(10, 40)) == [6, 7, 8, 9, 10, 11, 12, 13]
    assert list(window_of(1, 40)) == [0, 1, 2, 3, 4]
    assert list(window_of(38, 40)) == [34, 35, 36, 37, 38, 39]


def test_improbable_pairs_and_those_of_an_absent_grain_are_omitted():
    grains, position, walls = three_grains()
    position = np.repeat(position[1:], 3, axis=0)
    position[:, 2, 1] += 5e-5
    window = [
        Snapshot(float(f), position[f], np.zeros(3), np.ones(3, bool), walls[0].endpoints, 1e-5) for f in range(3)
    ]
    everything = ContactProbabilitySettings(least=0.0)
    contacts, touch = probable_contacts(grains, window, 1, everything)
    pairs = list(zip(contacts.i.tolist(), contacts.j.tolist(), strict=True))
    assert pairs == [(0, 1), (0, 3), (1, 2), (1, 3)]
    uncertain = touch[pairs.index((1, 2))]
    assert 0.0 < uncertain < 0.3
    fewer, kept = probable_contacts(grains, window, 1, ContactProbabilitySettings(least=1.01 * uncertain))
    assert fewer.count == 3
    assert np.array_equal(np.delete(touch, pairs.index((1, 2))), kept)
    absent = Snapshot(1.0, position[1], np.zeros(3), np.array([True, False, True]), walls[0].endpoints, 1e-5)
    contacts, _ = probable_contacts(grains, [window[0], absent, window[2]], 1, everything)
    assert list(zip(contacts.i.tolist(), contacts.j.tolist(), strict=True)) == [(0, 3)]
