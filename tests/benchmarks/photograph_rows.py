"""Photographs: how fast grains are found and followed, on one core."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rodsight.tracking.detection.detect import detect_grains
from rodsight.tracking.tracker import Tracker

from tests.app.tracking.detection.polydisperse import draw_discs, lay_discs
from tests.app.tracking.speckled import Rods, grid_of_rods
from tests.benchmarks.timing import Row, Took, fastest, in_processor_time, least, several

PATCH_RADIUS = 20.0  # [px]
RADIUS = PATCH_RADIUS / 0.85  # [px]


def tracking_rows() -> Iterator[Row]:
    rods = grid_of_rods(20, 20, radius=RADIUS, pitch=49.0, margin=90.0)
    tracker = Tracker(rods.reference(), (rods.x, rods.y, rods.radius), workers=1)
    took = follow(tracker, rods.moved(0.8, -0.6, 0.02))
    yield _grains("tracking where the motion is predicted", rods, took, "≥ 20 000 grains/s")
    turn = np.deg2rad(60.0) * np.where(np.arange(rods.count) % 2, 1.0, -1.0)
    took = follow(tracker, rods.moved(40.0, 0.0, turn))
    yield _grains("rescue after a jump of 40 px with 60°", rods, took, "≥ 4 000 grains/s")
    large = grid_of_rods(34, 34, radius=58.0, pitch=127.0, margin=140.0, noise=2.0)
    tracker = Tracker(large.reference(), (large.x, large.y, large.radius), workers=1)
    took = follow(tracker, large.moved(1.8, -0.6, 0.01), 3)
    what = f"{large.count} rods in {large.width * large.height / 1e6:.0f} megapixels"
    yield in_processor_time(what, took, "≤ .35 s")


def detection_rows() -> Iterator[Row]:
    width, height = 2300, 2000
    x, y, radius = lay_discs(width, height, 5.0, 50.0, 11000, np.random.default_rng(7))
    image = draw_discs(width, height, x, y, radius, blur=0.6, noise=4.0, noise_seed=1)
    took = fastest(lambda: detect_grains(image), 1)
    yield Row(f"detection of {len(x)} discs of 5 to 50 px, sizes not told", str(took), "≤ 3 s")
    rods = grid_of_rods(34, 34, radius=RADIUS, pitch=49.0, margin=60.0)
    image = rods.reference()
    yield in_processor_time(f"detection of {rods.count} rods of 24 px", several(lambda: detect_grains(image), 3))


def follow(tracker: Tracker, image: np.ndarray, turns: int = 5) -> list[Took]:
    return several(lambda: tracker.follow(image, [tracker.first()]), turns)


def _grains(what: str, rods: Rods, took: list[Took], aim: str) -> Row:
    rates = tuple(rods.count / each.processor for each in took)
    return Row(what, f"**{rods.count / least(took).processor:.0f} grains/s** of one core", aim, rates, "grains/s")
