import numpy as np
import pytest
from rodsight.solver.bodies.interpolation import interpolate_ignored_frames, interpolate_lost_grains
from rodsight.solver.bodies.motion import Snapshot

EXACT = 1e-12  # rounding of centimetres
DRIFT = np.array([1e-3, -2e-3])  # m per frame, of everything


def moving_lattice(lost: dict[int, list[int]], frames: int = 4) -> list[Snapshot]:
    """A lattice with uniform translation and rotation; lost: frame → missing grains, with arbitrary poses."""
    start = 0.02 * np.stack(np.meshgrid(np.arange(5), np.arange(5)), axis=-1).reshape(-1, 2)
    snapshots = []
    for f in range(frames):
        position, rotation, present = start + f * DRIFT, np.full(25, 0.01 * f), np.ones(25, bool)
        for grain in lost.get(f, []):
            position[grain], rotation[grain], present[grain] = 99.0, 99.0, False
        snapshots.append(Snapshot(30.0 * f, position, rotation, present, np.empty((0, 2, 2)), 1e-5))
    return snapshots


def test_grain_seen_before_and_after_is_interpolated():
    complete = moving_lattice({})
    frame, interpolated = interpolate_lost_grains(moving_lattice({1: [7], 2: [7]}), 2)
    np.testing.assert_allclose(frame.position, complete[2].position, atol=EXACT)
    np.testing.assert_allclose(frame.rotation, complete[2].rotation, atol=EXACT)
    assert np.flatnonzero(interpolated).tolist() == [7]
    assert frame.present.all()


def test_grain_not_seen_again_follows_its_neighbours():
    complete = moving_lattice({})
    frame, interpolated = interpolate_lost_grains(moving_lattice({2: [12, 13], 3: [12]}), 3)
    np.testing.assert_allclose(frame.position, complete[3].position, atol=EXACT)
    assert np.flatnonzero(interpolated).tolist() == [12]


def test_grain_not_seen_before_follows_its_neighbours():
    complete = moving_lattice({})
    frame, _ = interpolate_lost_grains(moving_lattice({0: [0]}), 0)
    np.testing.assert_allclose(frame.position, complete[0].position, atol=EXACT)


def test_grain_that_is_never_seen_stays_absent():
    frame, interpolated = interpolate_lost_grains(moving_lattice({f: [3] for f in range(4)}), 1)
    assert not frame.present[3]
    assert not interpolated.any()


def test_snapshot_without_lost_grains_is_unchanged():
    window = moving_lattice({1: [4]})
    frame, interpolated = interpolate_lost_grains(window, 2)
    np.testing.assert_array_equal(frame.position, window[2].position)
    assert not interpolated.any()
    np.testing.assert_array_equal(window[1].position[4], 99.0)


def test_interpolation_is_linear_in_time():
    first, lost, last = moving_lattice({1: [7]}, frames=3)
    late = Snapshot(48.0, lost.position, lost.rotation, lost.present, lost.endpoints, lost.sigma)
    frame, _ = interpolate_lost_grains([first, late, last], 1)
    start = first.position[7]
    np.testing.assert_allclose(frame.position[7], start + 48.0 / 60.0 * (last.position[7] - start), atol=EXACT)
    np.testing.assert_allclose(frame.rotation[7], 48.0 / 60.0 * 0.02, atol=EXACT)


def test_ignored_frame_is_interpolated():
    position, ends = np.array([[0.0, 0.0], [0.02, 0.0], [0.04, 0.0], [0.5, 0.5]]), np.arange(8.0).reshape(2, 2, 2)

    def snapshot(time, shift, sigma=1e-5, present=(True,) * 4):
        return Snapshot(time, position + shift, np.full(4, 10.0 * shift), np.array(present), ends + shift, sigma)

    half = [True, True, False, True]
    snapshots = [snapshot(0.0, 0.0, present=half), snapshot(10.0, 9.9), snapshot(40.0, 0.04, 2e-5), snapshot(50.0, 7.7)]
    found = interpolate_ignored_frames(snapshots, {1, 3, 9})
    assert found[1].position == pytest.approx(position + 0.01)
    assert found[1].rotation == pytest.approx(np.full(4, 0.1))
    assert found[1].endpoints == pytest.approx(ends + 0.01)
    assert (found[1].time, found[1].sigma) == (10.0, 2e-5)
    assert found[1].present.tolist() == half
    assert found[3].position == pytest.approx(position + 0.04)  # constant after the last valid frame
    assert found[0] is snapshots[0]
    with pytest.raises(ValueError, match="all frames are ignored"):
        interpolate_ignored_frames(snapshots[:1], {0})
