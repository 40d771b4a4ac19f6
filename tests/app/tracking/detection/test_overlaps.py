"""Circles that overlap others, against a plain comparison of all pairs."""

from __future__ import annotations

import numpy as np
from rodsight.tracking.detection.rings import not_overlapping


def plain(circles: np.ndarray, found: np.ndarray, allowed: float) -> np.ndarray:
    away = np.hypot(circles[:, None, 0] - found[None, :, 0], circles[:, None, 1] - found[None, :, 1])
    size, other = circles[:, None, 2], found[None, :, 2]
    return (away >= size + other - allowed * np.minimum(size, other)).all(axis=1)


def random_circles(generator: np.random.Generator, count: int, ends: tuple[float, float]) -> np.ndarray:
    return np.column_stack([generator.uniform(0.0, 900.0, (count, 2)), generator.uniform(*ends, count)])


def test_overlaps_are_those_of_all_pairs_while_found_circles_come_and_go() -> None:
    generator = np.random.default_rng(4)
    circles, found = random_circles(generator, 1500, (4.0, 90.0)), random_circles(generator, 60, (5.0, 60.0))
    overlapped = np.full_like(circles, np.nan)
    for _ in range(6):
        apart = not_overlapping(circles, found, overlapped, allowed=0.3)
        assert np.array_equal(apart, plain(circles, found, 0.3))
        assert 0.05 < apart.mean() < 0.95
        # Some are removed, others added, and the order changes.
        kept = found[generator.random(len(found)) < 0.6]
        found = generator.permutation(np.vstack([kept, random_circles(generator, 20, (5.0, 60.0))]))


def test_nothing_overlaps_where_nothing_is_found() -> None:
    circles = random_circles(np.random.default_rng(1), 5, (4.0, 9.0))
    assert not_overlapping(circles, np.empty((0, 4)), np.full_like(circles, np.nan), allowed=0.3).all()
