"""Finding grains on a photograph: all of them, nothing else, and where they are."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.synthetic.speckle import SpeckleSettings
from rodsight.tracking.detection.detect import Detection, DetectionSettings, detect_grains, refine_grains
from scipy.spatial import KDTree

from tests.app.tracking.speckled import PIXEL_SIZE, Rods

CLASSES = (28.0, 32.0, 44.0)  # [px]
CENTRE_ALLOWED = 0.1  # [px] rms
FOUND = 3.0  # [px] from the true centre
WIDTH, HEIGHT = 620, 560


def packing(seed: int, classes: tuple[float, ...] = CLASSES, *, cut: bool = False) -> Rods:
    """Rods laid one on the other, each in the lowest place where it touches two: many contacts, few gaps.

    With bars on the left, on the right and below; `cut`: without bars, and some beyond the border.
    """
    generator = np.random.default_rng(seed)
    left, right, floor = (0.0, float(WIDTH), HEIGHT + 20.0) if cut else (60.3, WIDTH - 61.2, HEIGHT - 60.6)
    circles: list[tuple[float, float, float]] = []
    while True:
        r = float(generator.choice(classes))
        places = _resting_places(circles, r, left, right, floor)
        x, y = max(places, key=lambda place: place[1])
        if y < 90.0:
            break
        circles.append((x, y, r))
    x, y, radius = np.array(circles).T
    # World points, y up; the packing lies on the left of each bar.
    corners = np.array([[left, 20.0], [left, floor], [right, floor], [right, 20.0]])
    world = np.stack([corners[:, 0], HEIGHT - 1 - corners[:, 1]], axis=1) * PIXEL_SIZE
    bars = np.stack([world[:-1], world[1:]], axis=1)
    settings = SpeckleSettings(pixel_size=PIXEL_SIZE)
    return Rods(WIDTH, HEIGHT, x, y, radius, settings, np.empty((0, 2, 2)) if cut else bars)


def _resting_places(
    circles: list[tuple[float, float, float]], r: float, left: float, right: float, floor: float
) -> list[tuple[float, float]]:
    places = [(x, floor - r) for x in np.arange(left + r, right - r, 2.0)]
    for k, (ax, ay, ar) in enumerate(circles):
        for wall in (left + r, right - r):
            d = (ar + r) ** 2 - (wall - ax) ** 2
            if d > 0:
                places.append((wall, ay - np.sqrt(d)))
        for bx, by, br in circles[:k]:
            d = np.hypot(bx - ax, by - ay)
            if d < ar + br + 2 * r:
                along = ((ar + r) ** 2 - (br + r) ** 2 + d * d) / (2 * d)
                across = np.sqrt(max((ar + r) ** 2 - along**2, 0.0))
                ux, uy = (bx - ax) / d, (by - ay) / d
                places += [(ax + along * ux + s * across * uy, ay + along * uy - s * across * ux) for s in (-1, 1)]
    kept = []
    for x, y in places:
        within = left + r - 1e-6 <= x <= right - r + 1e-6 and y <= floor - r + 1e-6
        if within and all(np.hypot(x - cx, y - cy) > r + cr - 1e-6 for cx, cy, cr in circles):
            kept.append((float(x), float(y)))
    return kept


def match(found: Detection, rods: Rods) -> tuple[np.ndarray, np.ndarray]:
    """Index of the detection nearest to each rod, and whether it is that rod."""
    distance, index = KDTree(np.stack([found.x, found.y], axis=1)).query(np.stack([rods.x, rods.y], axis=1))
    return index, distance < FOUND


@pytest.fixture(scope="module", params=[0, 1])
def packed(request: pytest.FixtureRequest) -> tuple[Rods, Detection]:
    rods = packing(request.param)
    return rods, detect_grains(rods.reference(), DetectionSettings(radii=CLASSES))


def test_every_rod_is_found_and_nothing_else(packed: tuple[Rods, Detection]) -> None:
    rods, found = packed
    assert rods.count > 40
    index, near = match(found, rods)
    assert near.all()
    assert found.count == rods.count
    assert np.array_equal(found.radius[index], rods.radius)


def test_centres_are_exact_to_a_tenth_of_a_pixel(packed: tuple[Rods, Detection]) -> None:
    rods, found = packed
    index, _ = match(found, rods)
    error = np.stack([found.x[index] - rods.x, found.y[index] - rods.y], axis=1)
    assert np.sqrt((error**2).mean()) < CENTRE_ALLOWED
    scaled = error / found.sigma[index, None]
    # Few rods and shading that is not noise: within a factor, not to a per cent.
    assert 0.4 < np.sqrt((scaled**2).mean()) < 2.0


def test_unknown_radii_are_measured() -> None:
    rods = packing(2)
    found = detect_grains(rods.reference(), DetectionSettings(radius_range=(20.0, 55.0)))
    index, near = match(found, rods)
    assert near.mean() > 0.95
    assert near.sum() / found.count > 0.95
    assert np.median(np.abs(found.radius[index[near]] - rods.radius[near])) < 0.5


def test_rods_cut_by_the_border_are_found_when_half_in_view() -> None:
    rods = packing(3, cut=True)
    found = detect_grains(rods.reference(), DetectionSettings(radii=CLASSES))
    index, near = match(found, rods)
    in_view = (rods.y + 0.2 * rods.radius < HEIGHT) & (rods.x > 0) & (rods.x < WIDTH)
    assert (rods.y + rods.radius > HEIGHT)[in_view].any()
    assert near[in_view].all()
    # What is found beyond is a rod too.
    assert found.count == len(np.unique(index[near]))


def test_given_positions_are_refined() -> None:
    rods = packing(4)
    generator = np.random.default_rng(0)
    x, y = rods.x + generator.uniform(-1.5, 1.5, rods.count), rods.y + generator.uniform(-1.5, 1.5, rods.count)
    found = refine_grains(rods.reference(), x, y, rods.radius)
    error = np.stack([found.x - rods.x, found.y - rods.y], axis=1)
    assert np.sqrt((error**2).mean()) < CENTRE_ALLOWED
    assert np.array_equal(found.radius, rods.radius)


def test_nothing_is_found_on_an_empty_photograph() -> None:
    noise = np.random.default_rng(0).normal(30.0, 2.0, (300, 300)).astype(np.float32)
    assert detect_grains(noise, DetectionSettings(radii=CLASSES)).count == 0


def test_position_where_no_grain_is_has_no_quality() -> None:
    blank = np.full((300, 300), 30.0, np.float32)
    found = refine_grains(blank, np.array([150.0]), np.array([150.0]), np.array([30.0]))
    assert found.quality[0] == 0.0
    assert np.isnan(found.sigma[0])
    assert (found.x[0], found.y[0]) == (150.0, 150.0)


def test_radii_that_are_no_radii_are_refused() -> None:
    with pytest.raises(ValueError, match="radii"):
        DetectionSettings(radii=(0.5,))
