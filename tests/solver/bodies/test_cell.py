"""Periodic cell: nearest images, and positions and vectors without jumps."""

import numpy as np
import pytest
from rodsight.solver.bodies.cell import Cell, reduce_vectors, unwrap, unwrap_cell

SHEARED = np.array([[0.2, 0.0], [0.13, 0.15]])


def test_shift_leads_to_the_nearest_image() -> None:
    rng, cell = np.random.default_rng(1), Cell.at_rest(SHEARED)
    apart = rng.uniform(-0.07, 0.07, (50, 2))
    near = apart[np.linalg.norm(apart, axis=1) < 0.5 * cell.heights.min()]
    image = near + rng.integers(-3, 4, near.shape) @ SHEARED
    assert image + cell.shift(image) == pytest.approx(near, abs=1e-12)


@pytest.mark.parametrize("count", [0, 1, -4])
def test_cell_sheared_by_lattice_vectors_has_the_same_reduced_basis(count: int) -> None:
    further = SHEARED + count * np.array([[0.0, 0.0], SHEARED[0]])
    transform, reduced = reduce_vectors(further)
    assert transform @ further == pytest.approx(reduced)
    assert abs(np.linalg.det(transform)) == pytest.approx(1.0)
    assert Cell.at_rest(further).heights.min() == pytest.approx(Cell.at_rest(SHEARED).heights.min())


def test_velocity_of_an_image_is_that_of_its_lattice_vectors() -> None:
    cell = Cell(SHEARED, np.array([[0.0, 0.0], [3.0, -1.0]]))
    shift = np.array([[0, 0], [0, 1], [2, -1]]) @ SHEARED
    assert cell.drift(shift) == pytest.approx(np.array([[0.0, 0.0], [3.0, -1.0], [-3.0, 1.0]]))


def test_images_within_reach_are_complete() -> None:
    rng, cell, reach = np.random.default_rng(2), Cell.at_rest(SHEARED), 0.03
    position = rng.uniform(-1.0, 1.0, (30, 2))
    points, owner = cell.with_images(position, reach)
    assert owner[:30].tolist() == list(range(30))
    assert points - position[owner] + cell.shift(points - position[owner]) == pytest.approx(0.0, abs=1e-12)
    images = (rng.integers(-9, 10, (4000, 2)) @ SHEARED)[None] + position[:, None]
    for first in points[:30]:
        near = np.linalg.norm(images - first, axis=2) < reach
        expected = {(k, *np.round(images[k, m], 9)) for k, m in np.argwhere(near)}
        found = np.linalg.norm(points - first, axis=1) < reach
        assert expected == {(k, *np.round(p, 9)) for k, p in zip(owner[found], points[found], strict=True)}


def test_unwrapped_positions_have_no_jumps() -> None:
    frames = 12
    vectors = np.stack([SHEARED + np.array([[0.0, 0.0], [0.01 * k, 0.0]]) for k in range(frames)])
    fraction = np.random.default_rng(3).uniform(0, 1, (20, 2)) + 0.05 * np.arange(frames)[:, None, None]
    true = np.einsum("fnk,fkl->fnl", fraction, vectors)
    wrapped = np.stack([Cell.at_rest(v).wrapped(p) for v, p in zip(vectors, true, strict=True)])
    wrapped[4:7, 3] = np.nan
    found = unwrap(wrapped, vectors)
    assert np.isnan(found[4:7, 3]).all()
    known = np.isfinite(found)
    assert found[known] == pytest.approx(true[known], abs=1e-12)
    assert unwrap(true, vectors) == pytest.approx(true, abs=1e-12)


def test_unwrapped_cell_vectors_have_no_jumps() -> None:
    smooth = np.stack([SHEARED + np.array([[0.0, 0.0], [0.03 * k, 0.0]]) for k in range(15)])
    upright = smooth.copy()
    upright[:, 1, 0] -= 0.2 * np.round((upright[:, 1, 0] - 0.1) / 0.2)
    assert np.abs(np.diff(upright[:, 1, 0])).max() > 0.1
    followed = unwrap_cell(upright)
    assert np.diff(followed, axis=0) == pytest.approx(np.diff(smooth, axis=0), abs=1e-12)
