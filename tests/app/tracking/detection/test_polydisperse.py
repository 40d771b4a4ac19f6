"""Detection of hundreds of discs with radii from five to fifty pixels and no setting of their sizes."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.experiment.pictures.image import LUMA
from rodsight.tracking.detection.detect import detect_grains
from scipy.spatial import KDTree

from tests.app.tracking.detection.polydisperse import draw_discs, lay_discs
from tests.app.tracking.real_like import Laboratory, brown_photograph

WIDTH, HEIGHT = 460, 400
SMALLEST, LARGEST = 5.0, 50.0  # [px]
CENTRE_ALLOWED = 0.15  # [px] rms; the smallest show ten pixels of outline
MIN_RECALL = 0.97  # some of the smallest show next to no outline


@pytest.mark.screen  # many seconds of detection
@pytest.mark.parametrize("painted", [False, True], ids=["plain", "brown"])
def test_small_discs_among_large_ones_are_found_and_nothing_else(painted: bool) -> None:
    x, y, radius = lay_discs(WIDTH, HEIGHT, SMALLEST, LARGEST, 3000, np.random.default_rng(5))
    if painted:
        colour = brown_photograph(
            Laboratory(), WIDTH, HEIGHT, x, y, radius, np.zeros(len(x)), pattern_seed=1, noise_seed=1
        )
        image = np.ascontiguousarray(colour.astype(np.float32) @ LUMA, dtype=np.float32)
    else:
        image = draw_discs(WIDTH, HEIGHT, x, y, radius, blur=0.6, noise=3.0, noise_seed=1)
    found = detect_grains(image)
    near, index = KDTree(np.stack([x, y], axis=1)).query(np.stack([found.x, found.y], axis=1))
    index = np.asarray(index, dtype=np.intp)
    whole = (x > radius) & (x < WIDTH - radius) & (y > radius) & (y < HEIGHT - radius)
    rows = whole[index]
    assert (radius < 8.0).sum() > 40
    assert near[rows].max() < 0.3 * SMALLEST
    assert len(np.unique(index[rows])) >= MIN_RECALL * whole.sum()
    error = np.stack([found.x - x[index], found.y - y[index]])[:, rows]
    assert np.sqrt((error**2).mean()) < CENTRE_ALLOWED
