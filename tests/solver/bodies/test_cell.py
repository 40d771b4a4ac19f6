"""A periodic cell: which images are near, and how positions and vectors go on without jumps."""

import numpy as np
import pytest

from solver.bodies.cell import Cell, follow_cell, reduce_vectors, unwrap

SHEARED = np.array([[0.2, 0.0], [0.13, 0.15]])


def test_a_place_and_its_images_are_equally_far_from_another() -> None:
    rng, cell = np.random.default_rng(1), Cell.at_rest(SHEARED)
    apart = rng.uniform(-0.07, 0.07, (50, 2))
    near = apart[np.linalg.norm(apart, axis=1) < 0.5 * cell.heights.min()]
    image = near + rng.integers(-3, 4, near.shape) @ SHEARED
    assert image + cell.shift(image) == pytest.approx(near, abs=1e-12)


@pytest.mark.parametrize("turns", [0, 1, -4])
def test_a_cell_sheared_by_whole_vectors_is_the_same_cell(turns: int) -> None:
    further = SHEARED + turns * np.array([[0.0, 0.0], SHEARED[0]])
    steps, short = reduce_vectors(further)
    assert steps @ further == pytest.approx(short)
    assert abs(np.linalg.det(steps)) == pytest.approx(1.0)
    assert Cell.at_rest(further).heights.min() == pytest.approx(Cell.at_rest(SHEARED).heights.min())


def test_the_drift_of_an_image_is_that_of_the_vectors_between() -> None:
    cell = Cell(SHEARED, np.array([[0.0, 0.0], [3.0, -1.0]]))
    shift = np.array([[0, 0], [0, 1], [2, -1]]) @ SHEARED
    assert cell.drift(shift) == pytest.approx(np.array([[0.0, 0.0], [3.0, -1.0], [-3.0, 1.0]]))


def test_surroundings_hold_every_image_that_is_near() -> None:
    rng, cell, reach = np.random.default_rng(2), Cell.at_rest(SHEARED), 0.03
    place = rng.uniform(-1.0, 1.0, (30, 2))
    around, owner = cell.with_surroundings(place, reach)
    assert owner[:30].tolist() == list(range(30))
    assert around - place[owner] + cell.shift(around - place[owner]) == pytest.approx(0.0, abs=1e-12)
    several = (rng.integers(-9, 10, (4000, 2)) @ SHEARED)[None] + place[:, None]
    for first in around[:30]:
        near = np.linalg.norm(several - first, axis=2) < reach
        expected = {(k, *np.round(several[k, m], 9)) for k, m in np.argwhere(near)}
        found = np.linalg.norm(around - first, axis=1) < reach
        assert expected == {(k, *np.round(p, 9)) for k, p in zip(owner[found], around[found], strict=True)}


def test_positions_go_on_where_they_were_wrapped() -> None:
    frames = 12
    vectors = np.stack([SHEARED + np.array([[0.0, 0.0], [0.01 * k, 0.0]]) for k in range(frames)])
    share = np.random.default_rng(3).uniform(0, 1, (20, 2)) + 0.05 * np.arange(frames)[:, None, None]
    true = np.einsum("fnk,fkl->fnl", share, vectors)
    wrapped = np.stack([Cell.at_rest(v).wrapped(p) for v, p in zip(vectors, true, strict=True)])
    wrapped[4:7, 3] = np.nan
    found = unwrap(wrapped, vectors)
    assert np.isnan(found[4:7, 3]).all()
    known = np.isfinite(found)
    assert found[known] == pytest.approx(true[known], abs=1e-12)
    assert unwrap(true, vectors) == pytest.approx(true, abs=1e-12)


def test_a_cell_kept_upright_goes_on_without_jumps() -> None:
    smooth = np.stack([SHEARED + np.array([[0.0, 0.0], [0.03 * k, 0.0]]) for k in range(15)])
    upright = smooth.copy()
    upright[:, 1, 0] -= 0.2 * np.round((upright[:, 1, 0] - 0.1) / 0.2)
    assert np.abs(np.diff(upright[:, 1, 0])).max() > 0.1
    followed = follow_cell(upright)
    assert np.diff(followed, axis=0) == pytest.approx(np.diff(smooth, axis=0), abs=1e-12)
