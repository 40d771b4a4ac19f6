import numpy as np
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.holes import find_holes
from rodsight.solver.bodies.walls import Walls

R = 0.01
HOLE = 44  # a grain in the middle of the lattice
EXACT = 1e-9  # [m]


def lattice(radius: np.ndarray | None = None) -> tuple[Grains, np.ndarray, Walls]:
    """A hexagonal lattice in a box."""
    column, row = np.meshgrid(np.arange(9), np.arange(9))
    position = R * np.stack([1 + 2 * column + row % 2, 1 + np.sqrt(3) * row], axis=-1).reshape(-1, 2)
    width, height = 19 * R, R * (2 + 8 * np.sqrt(3))
    corner = np.array([[0, 0], [width, 0], [width, height], [0, height]])
    endpoints = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
    grains = Grains.of_rods(np.full(81, R) if radius is None else radius, density=2700.0, length=0.06)
    return grains, position, Walls(endpoints, np.zeros((4, 2, 2)), np.full(4, np.nan))


def test_complete_packing_has_no_holes():
    grains, position, walls = lattice()
    assert len(find_holes(grains, position, np.ones(81, bool), walls)) == 0


def test_missing_grain_leaves_a_hole_at_its_position():
    grains, position, walls = lattice()
    present = np.arange(81) != HOLE
    position = np.where(present[:, None], position, np.nan)
    found = find_holes(grains, position, present, walls)
    assert len(found) == 1
    np.testing.assert_allclose(found[0], lattice()[1][HOLE], atol=EXACT)


def test_a_larger_grain_elsewhere_hides_no_hole():
    radius = np.full(81, R)
    radius[0] = 1.2 * R
    grains, position, walls = lattice(radius)
    assert len(find_holes(grains, position, np.arange(81) != HOLE, walls)) == 1


def test_pores_between_large_grains_are_no_holes():
    radius = np.full(81, R)
    radius[0] = 0.4 * R  # a rod that fits into the pores
    grains, position, walls = lattice(radius)
    assert len(find_holes(grains, position, np.ones(81, bool), walls)) == 0


def test_too_few_grains_have_no_holes():
    grains, position, walls = lattice()
    assert len(find_holes(grains, position, np.arange(81) < 3, walls)) == 0


def test_wide_hole_has_no_overlapping_centres():
    """Two neighbours are missing: the centres of their holes are at least a radius apart."""
    grains, position, walls = lattice()
    present = ~np.isin(np.arange(81), [HOLE, HOLE + 1])
    found = find_holes(grains, np.where(present[:, None], position, np.nan), present, walls)
    assert len(found) == 2
    assert np.hypot(*(found[0] - found[1])) >= 0.97 * R


def test_hole_smaller_than_the_smallest_rod_is_ignored():
    """The hole fits a rod of 0.8 R."""
    radius = np.full(81, R)
    grains, position, walls = lattice(radius)
    position = position.copy()
    around = np.argsort(np.hypot(*(position - position[HOLE]).T))[1:7]
    present = np.arange(81) != HOLE
    inward = position[around] - position[HOLE]
    position[around] -= 0.2 * R * inward / np.hypot(*inward.T)[:, None]
    assert len(find_holes(grains, np.where(present[:, None], position, np.nan), present, walls)) == 0


def test_missing_large_rod_among_small_ones_leaves_a_hole():
    """Among small and large rods, a missing large one leaves a hole, too."""
    radius = np.where(np.arange(81) == 0, 0.7 * R, R)
    grains, position, walls = lattice(radius)
    present = np.arange(81) != HOLE
    assert len(find_holes(grains, np.where(present[:, None], position, np.nan), present, walls)) == 1
