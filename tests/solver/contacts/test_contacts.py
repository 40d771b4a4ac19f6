import numpy as np
import pytest
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import detect_contacts

from tests.packings import box, rods

ROUNDING = 1e-15  # [m]


def test_pairs_below_the_threshold_are_found_and_measured():
    grains = rods(0.007, 0.008, 0.011)
    position = np.array([[0.02, 0.03], [0.0351, 0.03], [0.2, 0.2]])
    contacts = detect_contacts(grains, position, np.ones(3, bool), box(1.0, 1.0), 2e-4)
    assert contacts.i.tolist() == [0]
    assert contacts.j.tolist() == [1]
    assert contacts.gap == pytest.approx([1e-4], abs=ROUNDING)
    assert contacts.normal[0] == pytest.approx([1.0, 0.0])
    assert contacts.tangent[0] == pytest.approx([0.0, 1.0])
    assert contacts.point[0] == pytest.approx([0.02 + 0.007 + 5e-5, 0.03])


def test_normal_on_a_wall_points_out_of_the_packing():
    position = np.array([[0.05, 0.008], [0.092, 0.05], [0.05, 0.092], [0.008, 0.05]])
    contacts = detect_contacts(rods(*[0.008] * 4), position, np.ones(4, bool), box(0.1, 0.1), 1e-6)
    assert contacts.j.tolist() == [4, 5, 6, 7]
    assert contacts.normal == pytest.approx(np.array([[0, -1], [1, 0], [0, 1], [-1, 0]], float))
    assert contacts.gap == pytest.approx(np.zeros(4), abs=ROUNDING)


def test_wall_has_contacts_only_beside_its_segment():
    wall = Walls(np.array([[[0.0, 0.0], [0.1, 0.0]]]), np.zeros((1, 2, 2)), np.array([np.nan]))
    position = np.array([[0.05, 0.008], [0.2, 0.008]])
    contacts = detect_contacts(rods(0.008, 0.008), position, np.ones(2, bool), wall, 1e-6)
    assert contacts.i.tolist() == [0]


def test_absent_grains_have_no_contacts():
    position = np.array([[0.05, 0.008], [np.nan, np.nan], [0.066, 0.008]])
    present = np.array([True, False, True])
    contacts = detect_contacts(rods(*[0.008] * 3), position, present, box(0.2, 0.2), 1e-6)
    assert [(int(i), int(j)) for i, j in zip(contacts.i, contacts.j, strict=True)] == [(0, 2), (0, 3), (2, 3)]


def test_contacts_are_ordered_by_key():
    rng = np.random.default_rng(0)
    position = rng.uniform(0.0, 0.2, (60, 2))
    contacts = detect_contacts(rods(*[0.01] * 60), position, np.ones(60, bool), box(0.2, 0.2), 1e-3)
    assert contacts.count > 60
    assert np.all(np.diff(contacts.key) > 0)


def test_coincident_grains_are_refused():
    with pytest.raises(ValueError, match="same centre"):
        detect_contacts(rods(0.01, 0.01), np.zeros((2, 2)), np.ones(2, bool), box(1.0, 1.0), 1e-3)


def test_wall_threshold_is_separate():
    position = np.array([[0.0101, 0.05], [0.0302, 0.05]])
    grains, walls, here = rods(0.01, 0.01), box(0.2, 0.1), np.ones(2, bool)
    pair, wall = (0, 1), (0, 5)

    def found(threshold, wall_threshold=None):
        contacts = detect_contacts(grains, position, here, walls, threshold, wall_threshold=wall_threshold)
        return list(zip(contacts.i.tolist(), contacts.j.tolist(), strict=True))

    assert found(1.5e-4) == [pair, wall]
    assert found(1.5e-4, 5e-5) == [pair]
    assert found(5e-5, 1.5e-4) == [wall]
