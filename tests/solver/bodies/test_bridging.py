import numpy as np
import pytest

from solver.bodies.bridging import bridge_frames, bridge_lost
from solver.bodies.motion import Snapshot

EXACT = 1e-12  # rounding of centimetres
DRIFT = np.array([1e-3, -2e-3])  # m per frame, of everything


def moving_lattice(lost: dict[int, list[int]], frames: int = 4) -> list[Snapshot]:
    """A lattice that drifts and turns evenly; lost: frame → grains it does not show, with nonsense for a pose."""
    start = 0.02 * np.stack(np.meshgrid(np.arange(5), np.arange(5)), axis=-1).reshape(-1, 2)
    snapshots = []
    for f in range(frames):
        position, rotation, present = start + f * DRIFT, np.full(25, 0.01 * f), np.ones(25, bool)
        for grain in lost.get(f, []):
            position[grain], rotation[grain], present[grain] = 99.0, 99.0, False
        snapshots.append(Snapshot(30.0 * f, position, rotation, present, np.empty((0, 2, 2)), 1e-5))
    return snapshots


def test_a_grain_seen_before_and_after_is_put_between():
    whole = moving_lattice({})
    frame, bridged = bridge_lost(moving_lattice({1: [7], 2: [7]}), 2)
    np.testing.assert_allclose(frame.position, whole[2].position, atol=EXACT)
    np.testing.assert_allclose(frame.rotation, whole[2].rotation, atol=EXACT)
    assert np.flatnonzero(bridged).tolist() == [7]
    assert frame.present.all()


def test_a_grain_not_seen_again_moves_with_its_neighbours():
    whole = moving_lattice({})
    frame, bridged = bridge_lost(moving_lattice({2: [12, 13], 3: [12]}), 3)
    np.testing.assert_allclose(frame.position, whole[3].position, atol=EXACT)
    assert np.flatnonzero(bridged).tolist() == [12]


def test_a_grain_not_seen_yet_comes_with_its_neighbours():
    whole = moving_lattice({})
    frame, _ = bridge_lost(moving_lattice({0: [0]}), 0)
    np.testing.assert_allclose(frame.position, whole[0].position, atol=EXACT)


def test_a_grain_that_is_never_seen_stays_lost():
    frame, bridged = bridge_lost(moving_lattice({f: [3] for f in range(4)}), 1)
    assert not frame.present[3]
    assert not bridged.any()


def test_nothing_changes_where_nothing_is_lost():
    window = moving_lattice({1: [4]})
    frame, bridged = bridge_lost(window, 2)
    np.testing.assert_array_equal(frame.position, window[2].position)
    assert not bridged.any()
    np.testing.assert_array_equal(window[1].position[4], 99.0)


def test_the_way_between_is_shared_by_the_time_on_either_side():
    first, lost, last = moving_lattice({1: [7]}, frames=3)
    late = Snapshot(48.0, lost.position, lost.rotation, lost.present, lost.endpoints, lost.sigma)
    frame, _ = bridge_lost([first, late, last], 1)
    start = first.position[7]
    np.testing.assert_allclose(frame.position[7], start + 48.0 / 60.0 * (last.position[7] - start), atol=EXACT)
    np.testing.assert_allclose(frame.rotation[7], 48.0 / 60.0 * 0.02, atol=EXACT)


def test_a_frame_that_is_not_believed_is_put_between_its_neighbours():
    place, ends = np.array([[0.0, 0.0], [0.02, 0.0], [0.04, 0.0], [0.5, 0.5]]), np.arange(8.0).reshape(2, 2, 2)

    def snapshot(time, shift, sigma=1e-5, present=(True,) * 4):
        return Snapshot(time, place + shift, np.full(4, 10.0 * shift), np.array(present), ends + shift, sigma)

    half = [True, True, False, True]
    shown = [snapshot(0.0, 0.0, present=half), snapshot(10.0, 9.9), snapshot(40.0, 0.04, 2e-5), snapshot(50.0, 7.7)]
    found = bridge_frames(shown, {1, 3, 9})
    assert found[1].position == pytest.approx(place + 0.01)
    assert found[1].rotation == pytest.approx(np.full(4, 0.1))
    assert found[1].endpoints == pytest.approx(ends + 0.01)
    assert (found[1].time, found[1].sigma) == (10.0, 2e-5)
    assert found[1].present.tolist() == half
    assert found[3].position == pytest.approx(place + 0.04)  # behind the last believed one it stands still
    assert found[0] is shown[0]
    with pytest.raises(ValueError, match="no frame is believed"):
        bridge_frames(shown[:1], {0})
