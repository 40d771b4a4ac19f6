"""Rods that detection missed are found by their looks and fitted; holes of the packing are not."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment, read_grain_guess
from rodsight.tracking.detection.detect import Detection, DetectionSettings, detect_grains
from rodsight.tracking.missed_rods import MOST, describe_missed_rods, detect_rods, find_missed_rods
from scipy.ndimage import gaussian_filter
from scipy.spatial import KDTree

from tests.app.tracking.speckled import grid_of_rods

RADIUS, SMALLER, SIDE = 20.0, 19.5, 10
MISSED, HOLES = [23, 57, 61], [34, 76]
COARSE_RADIUS, COARSE_SIDE, COARSE_HOLES = 30.0, 7, [16, 30]
AT_LEAST = 12  # rods with coarse paint that only the search at full resolution finds


def _draw(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """A photograph of a square packing with holes at HOLES, and the centres of all places."""
    rng = np.random.default_rng(2)
    centre = 40.0 + 2.0 * RADIUS * np.array([(k % SIDE, k // SIDE) for k in range(SIDE**2)])
    size = int(centre.max()) + 41
    ground, rod = {"painted": (60.0, None), "plain": (20.0, 180.0), "dark": (20.0, 20.0)}[kind]
    speckles = np.where(gaussian_filter(rng.normal(size=(size, size)), 2.0) > 0.0, 220.0, 30.0)
    image = np.full((size, size), ground)
    for k in sorted(set(range(SIDE**2)) - set(HOLES)):
        place, radius = np.rint(16.0 * centre[k]).astype(int), round(16.0 * (SMALLER if k == MISSED[0] else RADIUS))
        disc = cv2.circle(np.zeros((size, size), np.uint8), tuple(place), radius, 1, -1, shift=4)
        image = np.where(disc > 0, speckles if rod is None else rod, image)
    return (gaussian_filter(image, 0.7) + rng.normal(0.0, 2.0, image.shape)).astype(np.float32), centre


def _given(centre: np.ndarray, left_out: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    kept = np.delete(centre, left_out, axis=0)
    return kept[:, 0], kept[:, 1], np.full(len(kept), RADIUS)


@pytest.mark.parametrize("kind", ["painted", "plain"])
def test_missed_rods_are_found_and_holes_are_not(kind: str) -> None:
    image, centre = _draw(kind)
    assert len(find_missed_rods(image, *_given(centre, HOLES))) == 0
    found = find_missed_rods(image, *_given(centre, HOLES + MISSED))
    order = np.lexsort((found[:, 0], found[:, 1]))
    np.testing.assert_allclose(found[order, :2], centre[MISSED], atol=0.25 * RADIUS)
    np.testing.assert_allclose(found[:, 2], RADIUS, rtol=0.2)


def test_nothing_is_reported_where_the_ground_looks_like_the_discs() -> None:
    image, centre = _draw("dark")
    assert len(find_missed_rods(image, *_given(centre, HOLES + MISSED))) == 0


def test_few_rods_and_rods_beyond_the_photograph_are_no_error() -> None:
    image, centre = _draw("plain")
    assert len(find_missed_rods(image, *_given(centre[:4], []))) == 0
    x, y, radius = _given(centre, MISSED)
    assert len(find_missed_rods(image[:200, :200], x, y, radius)) == 1  # the one of MISSED that is in view
    assert len(find_missed_rods(image, x + 1e3, y, radius)) == 0  # all lie beyond it


def test_at_most_fifty_places_are_listed() -> None:
    image, centre = _draw("plain")
    left_out = [k for k in range(SIDE**2) if (k % SIDE) % 9 and (k // SIDE) % 9]  # all but the rim
    assert len(find_missed_rods(image, *_given(centre, left_out))) <= MOST


def test_the_sentence_names_the_widest_place(tmp_path) -> None:
    image, centre = _draw("plain")
    cv2.imwrite(str(tmp_path / "0.png"), np.clip(image, 0, 255).astype(np.uint8))
    (tmp_path / "experiment.toml").write_text(
        'name = "few"\n[photographs]\nfiles = "*.png"\npixel_size = 1e-4\ninterval = 1.0\ngrains = "grains.csv"\n'
    )

    def sentences(left_out: list[int]) -> list[str]:
        x, y, radius = _given(centre, left_out)
        rows = np.column_stack([np.arange(len(x)), x, y, radius])
        np.savetxt(tmp_path / "grains.csv", rows, "%d,%.3f,%.3f,%.3f", header="id,x,y,radius", comments="")
        experiment = load_experiment(tmp_path)
        rods = read_grain_guess(experiment)
        assert rods is not None
        return describe_missed_rods(experiment, rods)

    assert sentences(HOLES) == []
    (one,) = sentences([*HOLES, MISSED[0]])
    assert one.startswith("1 place looks like a rod between the others and was not found, the widest at column 1")
    (several,) = sentences([*HOLES, *MISSED])
    assert several.startswith("3 places look like rods between the others and were not found")


def _draw_coarse() -> tuple[np.ndarray, np.ndarray]:
    """A photograph of rods with coarse speckles in a triangular packing with holes, and the centres of the rods."""
    rng, r = np.random.default_rng(2), COARSE_RADIUS
    k = np.arange(COARSE_SIDE**2)
    column, row = k % COARSE_SIDE, k // COARSE_SIDE
    centre = 50.0 + r + 2.02 * r * np.column_stack([column + 0.5 * (row % 2), 0.88 * row])
    size = int(centre.max() + r) + 60
    image = np.full((size, size), 60.0)
    for x, y in np.delete(centre, COARSE_HOLES, axis=0):
        top, left = int(y - r - 4), int(x - r - 4)
        rows, columns = np.mgrid[top : top + 69, left : left + 69]
        speckles = np.where(gaussian_filter(rng.normal(size=rows.shape), 0.11 * r) > 0.0, 225.0, 35.0)
        inside = np.clip(r - np.hypot(columns - x, rows - y) + 0.5, 0.0, 1.0)
        image[rows, columns] = image[rows, columns] * (1.0 - inside) + speckles * inside
    image = gaussian_filter(image, 0.8) + rng.normal(0.0, 2.5, image.shape)
    return image.astype(np.float32), np.delete(centre, COARSE_HOLES, axis=0)


@pytest.mark.slow
def test_rods_with_coarse_paint_are_found_at_full_resolution_and_holes_are_not() -> None:
    image, centre = _draw_coarse()
    settings = DetectionSettings(radii=(COARSE_RADIUS,))
    before, after = detect_grains(image, settings), detect_rods(image, settings)
    assert after.count >= before.count + AT_LEAST
    away, nearest = KDTree(centre).query(np.column_stack([after.x, after.y]))
    assert np.median(away) < 0.3
    assert (away < 4.0 * after.sigma + 1.0).all()  # paint at a rim hides half of it
    assert len(np.unique(nearest)) == after.count
    assert (np.lexsort((after.x, after.y)) == np.arange(after.count)).all()
    assert (after.radius == COARSE_RADIUS).all()


def _detect_without(monkeypatch: pytest.MonkeyPatch, left_out: list[int], centre: np.ndarray) -> None:
    """Let detection miss the rods at some centres."""

    def detect(image: np.ndarray, settings: DetectionSettings) -> Detection:
        found = detect_grains(image, settings)
        away = KDTree(centre[left_out]).query(np.column_stack([found.x, found.y]))[0]
        return found.select(away > RADIUS)

    monkeypatch.setattr("rodsight.tracking.missed_rods.detect_grains", detect)


@pytest.mark.slow
@pytest.mark.parametrize("radii", [(RADIUS,), ()])
def test_missed_rods_are_measured_like_the_others(monkeypatch: pytest.MonkeyPatch, radii: tuple[float, ...]) -> None:
    image, centre = _draw("plain")
    settings = DetectionSettings(radii)
    all_rods = detect_grains(image, settings)
    _detect_without(monkeypatch, MISSED, centre)
    found = detect_rods(image, settings)
    assert found.count == all_rods.count == SIDE**2 - len(HOLES)
    # Rows of rods at the same height are in the order of hundredths of a pixel.
    away, nearest = KDTree(np.column_stack([all_rods.x, all_rods.y])).query(np.column_stack([found.x, found.y]))
    assert (np.sort(nearest) == np.arange(all_rods.count)).all()
    assert away.max() < 0.1
    np.testing.assert_allclose(found.radius, all_rods.radius[nearest], atol=0.1)


def test_a_disc_that_does_not_look_like_the_rods_is_not_added(monkeypatch: pytest.MonkeyPatch) -> None:
    image, centre = _draw("plain")
    x, y = np.rint(centre[HOLES[0]]).astype(int)
    cv2.circle(image, (int(x), int(y)), int(RADIUS), 110.0, -1)  # a bolt beside the rods
    _detect_without(monkeypatch, [HOLES[0], MISSED[0]], centre)
    found = detect_rods(image, DetectionSettings((RADIUS,)))
    assert found.count == SIDE**2 - len(HOLES)
    assert np.hypot(found.x - x, found.y - y).min() > RADIUS


def test_rods_without_distinct_sizes_are_left_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    image, centre = _draw("plain")
    rng = np.random.default_rng(3)
    one = np.ones(len(centre) - len(MISSED))
    x, y, radius = _given(centre, MISSED)
    given = Detection(x, y, radius * rng.uniform(0.7, 1.0, len(x)), 0.1 * one, one)
    monkeypatch.setattr("rodsight.tracking.missed_rods.detect_grains", lambda image, settings: given)
    assert len(find_missed_rods(image, given.x, given.y, given.radius)) > 0
    assert detect_rods(image) is given
    assert detect_rods(image, DetectionSettings((RADIUS,))).count > len(x)  # stated sizes are known


def test_rods_whose_paint_hides_their_rims_take_the_place_of_the_circles_in_it() -> None:
    rods = grid_of_rods(16, 16, radius=15.0, pitch=31.25, margin=37.5)
    x, y, radius = rods.x.copy(), rods.y.copy(), rods.radius.copy()
    radius[100] = 11.0  # of a size of its own, and no paint
    image = replace(rods, radius=radius).reference()
    first, found = detect_grains(image), detect_rods(image)
    assert (np.abs(first.radius - 15.0) > 2.0).sum() > 3
    assert found.count == rods.count
    away, nearest = KDTree(np.column_stack([x, y])).query(np.column_stack([found.x, found.y]))
    assert away.max() < 1.0
    assert found.radius == pytest.approx(radius[nearest], abs=1.0)


def test_dots_of_black_paint_are_no_rods() -> None:
    rods = grid_of_rods(8, 8, radius=36.0, pitch=75.0, margin=90.0, black=20.0)
    image = rods.reference()
    first, found = detect_grains(image), detect_rods(image)
    assert (first.radius < 20.0).sum() > 20
    assert found.count == rods.count
    away, _ = KDTree(np.column_stack([rods.x, rods.y])).query(np.column_stack([found.x, found.y]))
    assert away.max() < 1.0
    assert len(detect_rods(np.full_like(image, 20.0)).x) == 0
    within = detect_rods(image, DetectionSettings(radius_range=(5.0, 60.0)))  # as `init` looks for them
    assert within.count == rods.count
