import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.connectivity import coordination_number
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.contacts.radius_tuning import ABOVE_STEP, tune_radii

from tests.packings import LENGTH, rods, squeezed_heap

R = 0.008  # [m]
SIDE = 5  # grains along one edge of the square lattice
EXACT = 1e-12
ROUNDING = 1e-12  # [m]


def lattice(gap, wall_gap):
    """A square lattice with a gap [m] between neighbours, in a box a gap away."""
    pitch = 2 * R + gap
    x, y = np.meshgrid(np.arange(SIDE) * pitch, np.arange(SIDE) * pitch)
    position = np.column_stack([x.ravel(), y.ravel()])
    low, high = -R - wall_gap, (SIDE - 1) * pitch + R + wall_gap
    corner = np.array([[low, low], [high, low], [high, high], [low, high]])
    endpoints = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
    return position, Walls(endpoints, np.zeros((4, 2, 2)), np.full(4, np.nan))


def tune(frames, wanted, change, radius=R):
    position = np.array([each[0] for each in frames])
    grains = rods(*[radius] * position.shape[1])
    return tune_radii(grains, position, np.ones(position.shape[:2], bool), [each[1] for each in frames], wanted, change)


def test_curve_of_a_square_lattice_is_its_step_function():
    # Neighbours touch at δR = 20 µm, walls at 70 µm, diagonals where 2 δR = √2 pitch − 2 R.
    frame = lattice(40e-6, 70e-6)
    diagonal = 0.5 * (np.sqrt(2) * (2 * R + 40e-6) - 2 * R)
    change = np.array([-1e-4, 0.0, 19.9e-6, 20.1e-6, 69.9e-6, 70.1e-6, diagonal - 1e-7, diagonal + 1e-7])
    neighbours, walls = 4 * (SIDE - 1) / SIDE, 4 / SIDE
    diagonals = 4 * (SIDE - 1) ** 2 / SIDE**2
    expected = [0, 0, 0, neighbours, neighbours, neighbours + walls, neighbours + walls, neighbours + walls + diagonals]
    found = tune([frame], 3.0, change)
    assert found.coordination_number == pytest.approx(np.array(expected), abs=EXACT)
    assert found.frame_coordination_number.shape == (len(change), 1)


@pytest.mark.parametrize(("wanted", "step"), [(0.5, 20e-6), (3.2, 20e-6), (3.3, 70e-6), (4.0, 70e-6)])
def test_step_that_reaches_the_required_number_is_found(wanted, step):
    found = tune([lattice(40e-6, 70e-6)], wanted, np.linspace(0.0, 1e-4, 4))
    assert found.met
    # Rounding separates the steps of the lattice: the solution is above the one that reaches the number.
    assert step - ROUNDING <= found.found <= step + 2 * ABOVE_STEP
    assert found.reached >= wanted


def test_common_error_of_the_radii_is_corrected():
    error = 30e-6
    exact = tune([lattice(40e-6, 70e-6)], 4.0, np.linspace(-2e-4, 2e-4, 21))
    short = tune([lattice(40e-6, 70e-6)], 4.0, np.linspace(-2e-4, 2e-4, 21), radius=R - error)
    assert short.found - exact.found == pytest.approx(error, abs=ROUNDING)


def test_frames_have_equal_weight():
    near, far = lattice(20e-6, 1e-3), lattice(60e-6, 1e-3)
    neighbours = 4 * (SIDE - 1) / SIDE
    found = tune([near, far], 0.5 * neighbours, np.array([0.0, 20e-6, 40e-6]))
    assert found.coordination_number == pytest.approx([0.0, 0.5 * neighbours, neighbours])
    assert found.frame_coordination_number[1] == pytest.approx([neighbours, 0.0])
    assert found.found == pytest.approx(10e-6, abs=2 * ABOVE_STEP)
    assert tune([near, far], 0.6 * neighbours, found.change).found == pytest.approx(30e-6, abs=2 * ABOVE_STEP)


def test_number_out_of_range_gives_nan():
    frame = lattice(40e-6, 70e-6)
    for wanted in (0.0, 4.1):
        found = tune([frame], wanted, np.linspace(0.0, 1e-4, 5))
        assert not found.met
        assert np.isnan(found.found)
        assert np.isnan(found.reached)


@pytest.mark.parametrize("wanted", [2.0, 2.5, 3.0, 3.3, 3.6])
def test_contacts_detected_with_the_changed_radii_have_the_number_found(wanted):
    rng = np.random.default_rng(11)
    heaps = [squeezed_heap(rng) for _ in range(3)]
    grains, walls = heaps[0][0], [each[2] for each in heaps]
    position, present = np.array([each[1].position for each in heaps]), np.ones((3, grains.count), bool)
    present[1, ::7] = False
    found = tune_radii(grains, position, present, walls, wanted, np.linspace(-3e-4, 6e-4, 19))
    assert found.met

    def number(change):
        changed = Grains.of_rods(grains.radius + change, density=2700.0, length=LENGTH)
        each = []
        for k in range(3):
            contacts = detect_contacts(changed, position[k], present[k], walls[k], 0.0)
            bearing = np.ones(contacts.count, bool)
            each.append(coordination_number(contacts, bearing, present[k], without_rattlers=True))
        return np.mean(each)

    assert number(found.found) == pytest.approx(found.reached, abs=EXACT)
    assert number(found.found) >= wanted > number(found.found - 2 * ABOVE_STEP)
    for change, curve in zip(found.change[::6], found.coordination_number[::6], strict=True):
        assert curve == pytest.approx(number(change), abs=EXACT)


def test_invalid_input_is_refused():
    frame = lattice(40e-6, 70e-6)
    with pytest.raises(ValueError, match="ascend"):
        tune([frame], 4.0, np.array([1e-5, 0.0]))
    with pytest.raises(ValueError, match="smallest radius"):
        tune([frame], 4.0, np.array([-R, 0.0]))
    with pytest.raises(ValueError, match="number of frames"):
        tune_radii(rods(R), np.zeros((0, 1, 2)), np.ones((0, 1), bool), [], 4.0, np.array([0.0, 1e-5]))
