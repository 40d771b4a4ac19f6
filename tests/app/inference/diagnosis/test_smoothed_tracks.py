"""Tracks that were smoothed in time are named; noise, slow errors and motion of any kind are not taken for that."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numba
import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.inference.diagnosis.diagnose import diagnose
from rodsight.inference.diagnosis.smoothed_tracks import (
    AVERAGED,
    EXPECTED_OF_SMOOTHED,
    SMOOTH_MOTION,
    SMOOTHED,
    TRUST_OF_SMOOTHED,
    WINDOW,
    GapChanges,
    examine_smoothing,
    find_smoothing,
    limit_for_smoothing,
    measure_gap_changes,
)
from rodsight.synthetic.scenarios.scenario_folder import make_scenario
from rodsight.tracks import Tracks, TrackStatus

from tests.app.inference.scenarios import read_inputs
from tests.app.recording.fake_results import make_results

SIDE, RADIUS, NOISE, FRAMES = 15, 0.008, 1e-5, 12
N, PITCH = SIDE * SIDE, 2.0 * RADIUS
SUDDEN = 6e-5  # [m] of the motion between two photographs, half of which is that of the photograph before


def moving_average(values: np.ndarray, count: int) -> np.ndarray:
    """Mean over so many photographs (f, …); over fewer at both ends."""
    half, f = count // 2, len(values)
    return np.stack([np.nanmean(values[max(k - half, 0) : min(k + half + 1, f)], axis=0) for k in range(f)])


def exponential(values: np.ndarray, weight: float) -> np.ndarray:
    """Exponential filter of values (f, …)."""
    smooth = [values[0]]
    for each in values[1:]:
        smooth.append((1.0 - weight) * smooth[-1] + weight * each)
    return np.stack(smooth)


def grid(
    noise: float = NOISE, *, sudden: float = 0.0, frames: int = FRAMES, slow: bool = False, renewed: float = 0.5
) -> np.ndarray:
    """Centres (f, n, 2) [m] of rods side by side, two thirds of which move, with noise.

    slow: errors with a correlation of .9 from photograph to photograph. renewed: fraction of the motion that is not
    that of the photograph before.
    """
    rng = np.random.default_rng(4)
    x, y = (each.ravel() * PITCH for each in np.meshgrid(np.arange(SIDE), np.arange(SIDE)))
    step = sudden * exponential(rng.standard_normal((frames, N, 2)), renewed) * (np.arange(N) >= N // 3)[:, None]
    error = noise * rng.standard_normal((frames, N, 2))
    if slow:
        error = exponential(error, 0.1)
    return np.stack([x, y], axis=-1) + np.cumsum(step, axis=0) + error


def tracks_of(position: np.ndarray, precision: float = NOISE) -> Tracks:
    flat = np.full(position.shape[:2], precision)
    status = np.full(flat.shape, TrackStatus.GIVEN, np.uint8)
    return Tracks(
        np.arange(N), np.full(N, RADIUS), 30.0 * np.arange(len(position)), position, np.zeros_like(flat), flat,
        np.full_like(flat, np.nan), status,
    )  # fmt: skip


def measured(position: np.ndarray) -> GapChanges:
    changes = measure_gap_changes(tracks_of(position))
    assert changes is not None
    return changes


def smoothed(position: np.ndarray, precision: float = NOISE) -> bool:
    return find_smoothing(tracks_of(position, precision)) is not None


def test_white_noise_has_the_correlations_of_differences():
    changes = measured(grid(sudden=SUDDEN))  # the gaps of the rods at rest change least
    assert changes.noise == pytest.approx(NOISE, rel=0.05)
    assert changes.correlation[0] == pytest.approx(-0.5, abs=0.05)
    assert changes.correlation[1:] == pytest.approx(0.0, abs=0.1)
    assert changes.averaged == 0
    assert measured(grid()).second_of_all == pytest.approx(-2.0 / 3.0, abs=0.03)


@pytest.mark.parametrize("count", [3, 5])
def test_a_moving_average_shifts_the_correlation_to_the_lag_of_its_length(count):
    position = moving_average(grid(), count)
    changes = measured(position)
    assert changes.averaged == count
    assert changes.correlation[count - 1] < AVERAGED
    assert changes.correlation[0] == pytest.approx(0.0, abs=0.1)
    (found,) = examine_smoothing(tracks_of(position))
    assert found.cause == "smoothed_tracks"
    assert f"after {count} photographs" in found.evidence


@pytest.mark.parametrize("weight", [0.25, 0.4])
def test_an_exponential_filter_is_known_by_the_motion_that_it_smooths(weight):
    position = exponential(grid(sudden=SUDDEN), weight)
    assert measured(position).correlation[0] == pytest.approx(-0.5 * weight, abs=0.12)
    (found,) = examine_smoothing(tracks_of(position))
    assert "photographs give -0.50" in found.evidence
    assert "after" not in found.evidence


@pytest.mark.parametrize("sudden", [0.0, SUDDEN])
def test_noise_motion_and_slow_errors_are_not_smoothed(sudden):
    for noise in (0.1 * NOISE, 0.3 * NOISE, NOISE, 4.0 * NOISE):
        assert not smoothed(grid(noise, sudden=sudden), noise)
    assert not smoothed(grid(sudden=sudden), 5.0 * NOISE)  # overstated
    assert not smoothed(grid(4.0 * NOISE, sudden=sudden, slow=True))


def test_steady_motion_with_an_overstated_noise_is_not_smoothed():
    position = grid(0.1 * NOISE, sudden=10.0 * SUDDEN, renewed=0.05)
    assert measured(position).second_of_all > SMOOTH_MOTION
    assert not smoothed(position)


def test_steady_motion_is_not_smoothed_where_the_noise_is_as_stated():
    drift = np.arange(FRAMES)[:, None, None] * SUDDEN * np.random.default_rng(2).standard_normal((N, 2))
    assert measured(grid() + drift).second_of_all < -0.6
    assert not smoothed(grid() + drift)
    assert not smoothed(grid(0.0) + np.linspace(0.0, 1.0, FRAMES)[:, None, None] ** 2 * drift, 1e-6)


@pytest.mark.parametrize(("noise", "correlation", "named"), [
    (0.2, 0.0, True), (0.04, 0.0, False), (0.6, 0.0, False), (0.2, 0.5, False), (0.2, -0.4, False),
])  # fmt: skip
def test_exact_tracks_whose_gaps_vary_by_motion_alone_are_not_smoothed(noise, correlation, named):
    lags = np.array([correlation, 0.0, 0.0, 0.0, 0.0])
    changes = GapChanges(noise * NOISE, lags, SMOOTH_MOTION + 0.3, 1000)
    assert changes.smoothed(NOISE) == named


def test_tracks_of_photographs_and_too_few_data_are_not_examined():
    tracks = tracks_of(moving_average(grid(), 5))
    tracked = replace(tracks, status=np.full(tracks.status.shape, TrackStatus.OK, np.uint8))
    assert examine_smoothing(tracked) == []
    assert examine_smoothing(tracks.frames(0, 5)) == []
    lost = tracks.position.copy()
    lost[:, 30:] = np.nan
    few = replace(tracks, position=lost, status=np.where(np.isnan(lost[..., 0]), TrackStatus.LOST, tracks.status))
    assert examine_smoothing(few) == []
    assert examine_smoothing(replace(tracks, position=np.repeat(tracks.position[:1], FRAMES, axis=0))) == []
    assert examine_smoothing(replace(tracks, position=2.0 * tracks.position)) == []  # no neighbours


def test_a_tenth_of_lost_poses_hides_no_smoothing():
    rng = np.random.default_rng(8)
    position = moving_average(grid(), 3)
    position[rng.random(position.shape[:2]) < 0.1] = np.nan
    tracks = tracks_of(position)
    status = np.where(np.isnan(position[..., 0]), TrackStatus.LOST, tracks.status)
    assert find_smoothing(replace(tracks, status=status)) is not None


def test_neighbours_of_a_part_of_a_long_test_are_enough():
    """After some photographs no pair of the first ones is near."""
    position = grid(frames=5 * WINDOW)
    apart = np.where(np.arange(len(position)) < WINDOW + 2, 1.0, 1.2)[:, None, None]  # from between two windows on
    assert not smoothed(apart * position)
    assert smoothed(apart * moving_average(position, 5))


def test_trust_in_smoothed_tracks_is_limited_with_its_reason():
    frame = make_results(1, 8, 7, sweeps=2).frames[0]
    frame = replace(frame, trust=0.95, expected_correlation=0.98, trust_penalties="noise")
    limited = limit_for_smoothing(frame)
    assert limited.trust == TRUST_OF_SMOOTHED
    assert limited.expected_correlation == EXPECTED_OF_SMOOTHED
    assert limited.trust_penalties == f"{SMOOTHED} · noise"
    low = replace(frame, trust=0.3)
    assert limit_for_smoothing(low) is low


@pytest.mark.slow
@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")
def test_smoothed_tracks_of_a_sheared_packing_are_named_and_measured_ones_are_not(tmp_path):
    inputs = read_inputs(load_experiment(make_scenario(tmp_path, "sheared", 6, grains=100).folder, ()))
    assert diagnose(inputs, None, sliding=False) == []
    for smooth in (partial(moving_average, count=5), partial(exponential, weight=0.25)):
        tracks = replace(inputs.tracks, position=smooth(inputs.tracks.position))
        walls = replace(inputs.walls, endpoints=smooth(inputs.walls.endpoints))
        (found,) = diagnose(replace(inputs, tracks=tracks, walls=walls), None)
        assert found.cause == "smoothed_tracks"
