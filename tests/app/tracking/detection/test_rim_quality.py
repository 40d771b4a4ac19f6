"""Rods of whose rims little is seen are named, unless paint hides the rims of many."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.tracking.detection import rim_quality
from rodsight.tracking.detection.detect import Detection
from rodsight.tracking.detection.rim_quality import FAINT, NAMED, describe_faint_rims

N = 200
CLEAR = Detection(np.arange(N) * 40.0, np.zeros(N), np.full(N, 18.0), np.full(N, 0.05), np.full(N, 0.5))


def with_faint(count: int) -> Detection:
    quality = CLEAR.quality.copy()
    quality[5 : 5 + count] = 0.9 * FAINT
    return replace(CLEAR, quality=quality)


@pytest.mark.parametrize(
    ("count", "beginning"),
    [
        (0, ""),
        (1, "Of rod 5 less than a fifth of the rim is seen: it may be"),
        (2, "Of rods 5, 6 less than a fifth of the rim is seen: they may be"),
        (NAMED + 1, "Of rods 5, 6, 7, 8, 9, 10, 11, 12, … less"),
        (N // 5, ""),
    ],
)
def test_rods_with_faint_rims_are_named(count: int, beginning: str) -> None:
    stated = describe_faint_rims(with_faint(count))
    assert stated.startswith(beginning)
    assert bool(stated) == bool(beginning)


def test_a_given_place_stays_where_hardly_any_rim_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    x, y = CLEAR.x[:4], CLEAR.y[:4]
    quality = np.array([0.5, 0.9 * FAINT, 0.0, 1.1 * FAINT])
    moved = Detection(x + 3.0, y + 4.0, CLEAR.radius[:4], np.array([0.1, 0.1, np.nan, 0.1]), quality)
    monkeypatch.setattr(rim_quality, "refine_grains", lambda *_: moved)
    found = rim_quality.refine_given(np.zeros((9, 9), np.float32), x, y, CLEAR.radius[:4])
    np.testing.assert_array_equal(found.x - x, [3.0, 0.0, 3.0, 3.0])
    np.testing.assert_array_equal(found.y - y, [4.0, 0.0, 4.0, 4.0])
    np.testing.assert_allclose(found.sigma, [0.1, np.hypot(0.1, 5.0), np.nan, 0.1])
