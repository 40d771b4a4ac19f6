"""The choice between the texture of a bar and its edge."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.tracking.walls.edge_tracker import EdgePoses
from rodsight.tracking.walls.texture_or_edge import BarMotion, texture_or_edge
from rodsight.tracking.walls.wall_tracker import WallPoses

PIXEL = 1e-4  # [m]
FRAMES = 6
BARS = np.array([[[0.0, 0.0], [0.2, 0.0]], [[0.2, 0.1], [0.0, 0.1]]])  # bottom and top


def choose(texture: np.ndarray, edge: np.ndarray, given: np.ndarray | None = None, lined: bool = False) -> BarMotion:
    """Choose for bars (f, w, 2, 2) [m] of which each is known to a hundredth and a tenth of a pixel."""
    w = texture.shape[1]
    textures = [
        WallPoses(ends, np.full((w, 2), 0.01 * PIXEL), np.full(w, 0.99), np.full(w, 20, np.int64)) for ends in texture
    ]
    edges = [EdgePoses(ends, np.full((w, 2), 0.1 * PIXEL), np.full(w, 0.8)) for ends in edge]
    none = np.zeros((len(texture), w), np.bool_)
    return texture_or_edge(textures, edges, none if given is None else given, np.full(w, lined), PIXEL)


def moving(step: float, along: float = 0.0) -> np.ndarray:
    """Bars of which the top comes down and moves along itself by so many pixels a photograph."""
    ends = np.repeat(BARS[None], FRAMES, axis=0)
    ends[:, 1] += (PIXEL * np.arange(FRAMES)[:, None] * np.array([along, -step]))[:, None]
    return ends


def test_texture_is_preferred_where_both_agree() -> None:
    texture = moving(1.0, 4.0)
    found = choose(texture, moving(1.0))
    np.testing.assert_array_equal(found.endpoints, texture)
    assert np.isnan(found.edge).all()
    assert (found.patches == 20).all()


def test_bars_without_texture_are_followed_by_their_edges() -> None:
    texture = moving(1.0)
    texture[1:, 1] = np.nan
    found = choose(texture, moving(1.0))
    np.testing.assert_allclose(found.endpoints, moving(1.0), atol=1e-12)
    assert found.edge[:, 1] == pytest.approx(0.8)
    assert np.isnan(found.edge[:, 0]).all()
    assert np.isnan(found.zncc[:, 1]).all()
    assert found.sigma[:, 1] == pytest.approx(0.1 * PIXEL)


def test_a_texture_that_is_lost_once_is_kept() -> None:
    texture = moving(1.0)
    texture[3, 1] = np.nan
    assert np.isnan(choose(texture, moving(1.0)).endpoints[3, 1]).all()


def test_a_texture_at_rest_beside_a_moving_edge_is_the_background() -> None:
    found = choose(moving(0.0), moving(1.0))
    np.testing.assert_allclose(found.endpoints, moving(1.0), atol=1e-12)


@pytest.mark.parametrize("step", [0.0, 0.1])
def test_an_edge_that_rests_or_hardly_moves_is_no_reason_to_leave_the_texture(step: float) -> None:
    texture = moving(1.0 - step)
    edge = moving(step)
    chosen = choose(texture if step == 0.0 else moving(0.0), edge)
    assert np.isnan(chosen.edge).all()


def test_given_bars_stay_where_the_table_puts_them() -> None:
    ends, edge = moving(1.0), moving(1.0)
    ends[2, 1, :, 0] += 3.0 * PIXEL
    edge[2] = ends[2]
    given = np.zeros((FRAMES, 2), np.bool_)
    given[2] = True
    texture = ends.copy()
    texture[[1, 3, 4, 5], 1] = np.nan
    found = choose(texture, edge, given)
    np.testing.assert_allclose(found.endpoints[2], ends[2])
    assert np.isnan(found.edge[2]).all()


def test_texture_of_lines_does_not_show_the_motion_along_a_bar() -> None:
    found = choose(moving(1.0, 4.0), moving(1.0), lined=True)
    np.testing.assert_allclose(found.endpoints, moving(1.0), atol=1e-12)
    assert (found.patches == 20).all()
