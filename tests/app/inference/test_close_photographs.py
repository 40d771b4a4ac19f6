"""Photographs closer together than noise: sliding is read over several, and only there."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.inference.correction.close_photographs import choose_span, count_alike
from rodsight.tracks import Tracks, TrackStatus

pytestmark = pytest.mark.unit

SIDE, FRAMES, NOISE = 12, 33, 1e-5


def tracks_moving(step: float, noise: float = NOISE) -> Tracks:
    """Rods that wander apart steadily by `step` [m] a photograph, rms of one component, seen with noise."""
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
    place = 0.016 * np.column_stack([x.ravel(), y.ravel()])
    n = len(place)
    velocity = rng.normal(0.0, step, (n, 2))
    position = place + velocity * np.arange(FRAMES)[:, None, None] + rng.normal(0.0, noise, (FRAMES, n, 2))
    flat = np.zeros((FRAMES, n))
    status = np.full((FRAMES, n), TrackStatus.GIVEN, np.uint8)
    return Tracks(
        np.arange(n), np.full(n, 0.008), np.arange(FRAMES), position, flat, np.full((FRAMES, n), noise), flat, status
    )


@pytest.mark.parametrize(("step", "span"), [(7.5e-6, 6), (9.5e-6, 5), (5e-6, 8), (3.8e-6, 8)])
def test_sliding_is_read_over_a_span_where_noise_hides_it(step: float, span: int) -> None:
    found, sentence = choose_span(tracks_moving(step))
    assert found == span
    assert f"read over {span} photographs" in sentence
    assert "noise is 28 µm" in sentence


def test_sliding_is_read_from_one_photograph_to_the_next_where_rods_move_enough_or_not_at_all() -> None:
    assert choose_span(tracks_moving(7e-5)) == (1, "")
    assert choose_span(tracks_moving(7e-5, noise=4e-5)) == (1, "")
    assert choose_span(tracks_moving(0.0)) == (1, "")  # no span would show anything
    assert choose_span(tracks_moving(7.5e-6).frames(0, 5)) == (1, "")


def test_photographs_share_an_estimate_from_positions_while_grains_move_less_than_noise_shows() -> None:
    assert count_alike(tracks_moving(1.2e-5)) == 4  # sliding is read from one to the next
    assert choose_span(tracks_moving(1.2e-5))[0] in (1, 4)
    assert count_alike(tracks_moving(7e-5)) == 1
    assert count_alike(tracks_moving(0.0)) == 1  # forces may change without motion
    assert count_alike(tracks_moving(1.2e-5).frames(0, 7)) == 1  # too few intervals
