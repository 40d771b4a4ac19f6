"""Area of a packing between walls, around rods and without openings."""

import numpy as np
import pytest
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.statistics.packing_area import packing_area

NO_WALLS = Walls.at_rest(np.empty((0, 2, 2)))


def test_area_of_a_sheared_box_is_that_of_its_parallelogram():
    c = np.array([[0.0, 0.0], [0.5, 0.0], [0.6, 0.6], [0.1, 0.6]])
    walls = Walls(np.stack([c, np.roll(c, -1, axis=0)], axis=1), np.zeros((4, 2, 2)), np.full(4, np.nan))
    assert packing_area(walls, c) == pytest.approx(0.3)
    shuffled = Walls(walls.endpoints[[2, 0, 3, 1]], walls.velocity, walls.load)
    assert packing_area(shuffled, c) == pytest.approx(0.3)


@pytest.mark.parametrize("turned", [-2e-4, 0.0, 2e-4])
def test_halves_of_a_side_are_one_side_of_the_area(turned):
    """Lines that are nearly parallel meet far away, so that their polygon has any area."""
    c = np.array([[0.0, 0.0], [0.5, 0.0], [0.5, 0.25], [0.51, 0.25], [0.51 + 0.35 * turned, 0.6], [0.0, 0.6]])
    ends = np.stack([c, np.roll(c, -1, axis=0)], axis=1)[[0, 1, 3, 4, 5]]  # the upper half is displaced
    walls = Walls(ends, np.zeros((5, 2, 2)), np.full(5, np.nan))
    inside = np.array([[0.2, 0.3], [0.3, 0.1], [0.3, 0.5]])
    assert packing_area(walls, inside) == pytest.approx(0.51 * 0.6, rel=1e-3)


def ring(radius: float, count: int) -> np.ndarray:
    angle = 2.0 * np.pi * np.arange(count) / count
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def regular(radius: float, count: int) -> float:
    """Area of a regular polygon."""
    return 0.5 * count * radius**2 * np.sin(2.0 * np.pi / count)


def test_openings_between_boundary_rods_do_not_count():
    tunnel, rim = ring(0.3, 20), ring(1.0, 60)
    grid = np.stack(np.meshgrid(*2 * [np.arange(-1.0, 1.0, 0.08)]), axis=-1).reshape(-1, 2)
    distance = np.linalg.norm(grid, axis=1)
    free = grid[(distance > 0.36) & (distance < 0.93)]
    position = np.concatenate([tunnel, rim, free])
    boundary = np.arange(len(position)) < len(tunnel) + len(rim)
    full = regular(1.0, 60)
    assert packing_area(NO_WALLS, position) == pytest.approx(full)
    assert packing_area(NO_WALLS, position, None, boundary) == pytest.approx(full - regular(0.3, 20))
    # Between boundary rods and free ones all is packing, and an opening with a rod in it is none.
    filled = np.concatenate([position, [[0.0, 0.0]]])
    inside = packing_area(NO_WALLS, filled, None, np.append(boundary, False))
    assert inside == pytest.approx(full)
    assert packing_area(NO_WALLS, filled, np.arange(len(filled)) < len(position), np.append(boundary, False)) == (
        pytest.approx(full - regular(0.3, 20))
    )


def test_pores_between_boundary_rods_count():
    lattice = np.array([[k + 0.5 * (row % 2), row * np.sqrt(0.75)] for row in range(6) for k in range(6)])
    everywhere = np.ones(len(lattice), bool)
    assert packing_area(NO_WALLS, lattice, None, everywhere) == pytest.approx(packing_area(NO_WALLS, lattice))


def test_faces_of_a_body_in_the_packing_bound_no_area():
    """The lines of a wedge's flanks would cut the box: rods are beyond both."""
    box = np.array([[0.0, 0.0], [0.3, 0.0], [0.3, 0.2], [0.0, 0.2]])
    sides = np.stack([box, np.roll(box, -1, axis=0)], axis=1)
    flanks = np.array([[[0.15, 0.08], [0.1, 0.2]], [[0.2, 0.2], [0.15, 0.08]]])
    walls = Walls.at_rest(np.concatenate([sides, flanks]))
    grid = np.stack(np.meshgrid(np.arange(0.01, 0.3, 0.02), np.arange(0.01, 0.2, 0.02)), axis=-1).reshape(-1, 2)
    assert packing_area(walls, grid) == pytest.approx(0.06)
    assert packing_area(Walls.at_rest(sides), grid[:0]) == pytest.approx(0.06)
    one = np.concatenate([grid, [[0.301, 0.1]]])  # a single rod beyond a side does not open the box
    assert packing_area(walls, one) == pytest.approx(0.06)
