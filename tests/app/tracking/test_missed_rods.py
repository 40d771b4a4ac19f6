"""Rods that detection missed are found by their looks; holes of the packing are not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment, read_grain_guess
from rodsight.tracking.missed_rods import MOST, describe_missed_rods, find_missed_rods
from scipy.ndimage import gaussian_filter

RADIUS, SIDE = 20.0, 10
MISSED, HOLES = [23, 57, 61], [34, 76]


def _draw(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """A photograph of a square packing with holes at HOLES, and the centres of all places."""
    rng = np.random.default_rng(2)
    centre = 40.0 + 2.0 * RADIUS * np.array([(k % SIDE, k // SIDE) for k in range(SIDE**2)])
    size = int(centre.max()) + 41
    ground, rod = {"painted": (60.0, None), "plain": (20.0, 180.0), "dark": (20.0, 20.0)}[kind]
    speckles = np.where(gaussian_filter(rng.normal(size=(size, size)), 2.0) > 0.0, 220.0, 30.0)
    image = np.full((size, size), ground)
    for k in sorted(set(range(SIDE**2)) - set(HOLES)):
        disc = cv2.circle(np.zeros((size, size), np.uint8), tuple(np.rint(centre[k]).astype(int)), int(RADIUS), 1, -1)
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
