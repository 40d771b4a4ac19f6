"""Detection of a round wall's edge from a circle near it, with the packing on either side."""

import cv2
import numpy as np
import pytest
from rodsight.tracking.walls.round_edge import snap_to_rim

TRUE = 252.4, 246.7, 180.3
EXACT = 0.4  # [px]


def photographed(*, inside: bool) -> np.ndarray:
    """A bright wall with paint on it, dark where the rods are, rods near the edge."""
    x, y, r = TRUE
    rows, columns = np.mgrid[:500, :500]
    from_rim = np.hypot(columns - x, rows - y) - r
    wall = np.clip(0.5 + (from_rim if inside else -from_rim), 0.0, 1.0)
    image = (20.0 + 150.0 * wall).astype(np.float32)
    rng = np.random.default_rng(5)
    for a in rng.uniform(0.0, 2.0 * np.pi, 60):
        far = r + (18.0 if inside else -18.0)
        cv2.circle(image, (int(x + far * np.cos(a)), int(y + far * np.sin(a))), 4, 70.0, -1)
    for a in np.arange(0.0, 2.0 * np.pi, 0.3):
        far = r - (26.0 if inside else -26.0)
        cv2.circle(image, (int(x + far * np.cos(a)), int(y + far * np.sin(a))), 22, 190.0, -1)
    return cv2.GaussianBlur(image, None, 1.0)


@pytest.mark.parametrize("inside", [True, False])
def test_a_circle_drawn_by_hand_moves_onto_the_edge(inside):
    drawn = TRUE[0] + 4.0, TRUE[1] - 3.0, TRUE[2] + 3.0
    found, fraction = snap_to_rim(photographed(inside=inside), drawn, 12.0, inside=inside)
    assert found == pytest.approx(TRUE, abs=EXACT)
    assert fraction > 0.5


def test_a_circle_that_leaves_the_picture_is_found_by_what_is_in_it():
    part = photographed(inside=True)[:, :330]
    found, _ = snap_to_rim(part, (TRUE[0] + 2.0, TRUE[1], TRUE[2] - 3.0), 12.0, inside=True)
    assert found == pytest.approx(TRUE, abs=2.0 * EXACT)


def test_where_there_is_no_edge_a_circle_stays():
    rng = np.random.default_rng(1)
    empty = rng.normal(60.0, 8.0, (500, 500)).astype(np.float32)
    found, fraction = snap_to_rim(empty, TRUE, 12.0, inside=True)
    assert found == TRUE
    assert fraction < 0.34
    assert snap_to_rim(empty, (3000.0, 0.0, 40.0), 12.0, inside=True) == ((3000.0, 0.0, 40.0), 0.0)
