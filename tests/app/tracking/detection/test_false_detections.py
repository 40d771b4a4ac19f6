"""Messages about circles that are no grains, and about colour channels."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.tracking.detection.channels import compare_views, count_discs, is_coloured
from rodsight.tracking.detection.detect import Detection, DetectionSettings
from rodsight.tracking.detection.false_detections import describe_channels, describe_false_detections, separate_circles

from tests.app.tracking.detection.polydisperse import draw_discs

SHAPE = (600, 800)


def packing_with_bolts(bolts: int, *, alike: bool = True) -> Detection:
    """A packing of 80 discs of two sizes in the middle, and bolts along the upper border."""
    column, row = np.meshgrid(np.arange(10), np.arange(8))
    x, y = 300.0 + 21.0 * column.ravel(), 250.0 + 21.0 * row.ravel()
    radius = np.array([8.0, 10.0])[(column + row).ravel() % 2]
    sizes = np.full(bolts, 6.0) if alike else np.linspace(4.0, 9.0, bolts)
    x, y = np.append(x, 40.0 + 70.0 * np.arange(bolts)), np.append(y, np.full(bolts, 30.0))
    radius = np.append(radius, sizes)
    return Detection(x, y, radius, np.full(len(x), 0.1), np.ones(len(x)))


def test_bolts_apart_from_the_packing_are_named_with_the_region_that_excludes_them() -> None:
    detection = packing_with_bolts(9)
    assert separate_circles(detection).sum() == 9
    (message,) = describe_false_detections(detection, None, SHAPE)
    assert "9 of 89 circles" in message
    assert "photographs.region = [272, 222, 518, 426]" in message


def test_few_or_uneven_circles_apart_are_no_bolts() -> None:
    assert describe_false_detections(packing_with_bolts(3), None, SHAPE) == []
    assert describe_false_detections(packing_with_bolts(9, alike=False), None, SHAPE) == []
    assert describe_false_detections(packing_with_bolts(0), None, SHAPE) == []


def test_circles_outside_the_walls_are_counted() -> None:
    detection = packing_with_bolts(9)
    (message,) = describe_false_detections(detection, detection.y > 100.0, SHAPE)
    assert "9 of 89 circles lie outside the walls" in message
    assert describe_false_detections(detection, np.ones(89, bool), SHAPE) == []


def test_the_channel_with_more_discs_is_named() -> None:
    (message,) = describe_channels({"grey": 10, "red": 27, "green": 9, "blue": 3}, "grey")
    assert message.startswith("27 discs are detected in the red channel and 10 in grey")
    assert describe_channels({"grey": 26, "red": 27, "green": 9, "blue": 3}, "grey") == []
    assert describe_channels({}, "grey") == []
    assert describe_channels({"grey": 88, "red": 63, "green": 9, "blue": 3}, "red", found=200) == []


def test_discs_are_counted_in_every_channel_of_a_coloured_photograph() -> None:
    column, row = np.meshgrid(np.arange(5), np.arange(4))
    x, y = 30.0 + 32.0 * column.ravel(), 30.0 + 32.0 * row.ravel()
    red = draw_discs(190, 160, x, y, np.full(20, 13.0), blur=0.6, noise=2.0, noise_seed=1)
    blank = np.random.default_rng(2).normal(60.0, 2.0, red.shape).astype(np.float32)
    channels = {"grey": 0.3 * red + 0.7 * blank, "red": red, "green": blank, "blue": blank}
    assert is_coloured(channels)
    assert not is_coloured(dict.fromkeys(channels, red))
    count = count_discs({"red": red, "blue": blank}, DetectionSettings(radius_range=(9.0, 20.0)))
    assert count["red"] == 20
    assert count["blue"] < 5


@pytest.mark.slow
def test_views_are_ordered_by_the_outlines_that_they_show() -> None:
    column, row = np.meshgrid(np.arange(5), np.arange(4))
    x, y = 30.0 + 32.0 * column.ravel(), 30.0 + 32.0 * row.ravel()
    red = draw_discs(190, 160, x, y, np.full(20, 13.0), blur=0.6, noise=2.0, noise_seed=1)
    blank = np.random.default_rng(2).normal(60.0, 2.0, red.shape).astype(np.float32)
    settings = DetectionSettings(radius_range=(9.0, 20.0))
    best = compare_views({"grey": blank, "red": red, "green": blank, "blue": blank}, settings)[0]
    assert (best.channel, best.dark, best.count) == ("red", False, 20)
    assert best.radius_range is not None
    assert best.radius_range[0] < 13.0 < best.radius_range[1]
    inverted = np.float32(255.0) - red
    dark = compare_views({"grey": blank, "red": inverted, "green": blank, "blue": blank}, settings)[0]
    assert (dark.channel, dark.dark) == ("red", True)
    # Without a better view light discs in grey are the first.
    first = compare_views(dict.fromkeys(("grey", "red", "green", "blue"), red), settings)[0]
    assert (first.channel, first.dark) == ("grey", False)


def test_large_discs_count_by_their_area_against_many_small_ones() -> None:
    few = Detection(*np.zeros((2, 4)), np.full(4, 20.0), np.full(4, 0.1), np.ones(4))
    many = Detection(*np.zeros((2, 40)), np.full(40, 5.0), np.full(40, 0.1), np.ones(40))
    assert few.seen_area == 1600.0
    assert few.seen_area > many.seen_area
