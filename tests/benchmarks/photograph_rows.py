"""Speed of detection and tracking on one core."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rodsight.tracking.detection.detect import detect_grains
from rodsight.tracking.tracker import Tracker

from tests.app.tracking.detection.polydisperse import draw_discs, lay_discs
from tests.app.tracking.speckled import Rods, grid_of_rods
from tests.benchmarks.timing import Duration, Row, fastest_of, in_processor_time, time_fastest, time_rounds

PATCH_RADIUS = 20.0  # [px]
RADIUS = PATCH_RADIUS / 0.85  # [px]


def tracking_rows() -> Iterator[Row]:
    rods = grid_of_rods(20, 20, radius=RADIUS, pitch=49.0, margin=90.0)
    tracker = Tracker(rods.reference(), (rods.x, rods.y, rods.radius), workers=1)
    durations = follow(tracker, rods.moved(0.8, -0.6, 0.02))
    yield _grains("tracking where the motion is predicted", rods, durations, "≥ 40 000 grains/s")
    rotation = np.deg2rad(60.0) * np.where(np.arange(rods.count) % 2, 1.0, -1.0)
    durations = follow(tracker, rods.moved(40.0, 0.0, rotation))
    yield _grains("rescue after a jump of 40 px with 60°", rods, durations, "≥ 4 000 grains/s")
    large = grid_of_rods(34, 34, radius=58.0, pitch=127.0, margin=140.0, noise=2.0)
    tracker = Tracker(large.reference(), (large.x, large.y, large.radius), workers=1)
    durations = follow(tracker, large.moved(1.8, -0.6, 0.01), 3)
    label = f"{large.count} rods in {large.width * large.height / 1e6:.0f} megapixels"
    yield in_processor_time(label, durations, "≤ .35 s")


def detection_rows() -> Iterator[Row]:
    width, height = 2300, 2000
    x, y, radius = lay_discs(width, height, 5.0, 50.0, 11000, np.random.default_rng(7))
    image = draw_discs(width, height, x, y, radius, blur=0.6, noise=4.0, noise_seed=1)
    durations = time_fastest(lambda: detect_grains(image), 1)
    yield Row(f"detection of {len(x)} discs of 5 to 50 px, unknown sizes", str(durations), "≤ 1.5 s")
    rods = grid_of_rods(34, 34, radius=RADIUS, pitch=49.0, margin=60.0)
    image = rods.reference()
    yield in_processor_time(f"detection of {rods.count} rods of 24 px", time_rounds(lambda: detect_grains(image), 3))


def follow(tracker: Tracker, image: np.ndarray, rounds: int = 5) -> list[Duration]:
    return time_rounds(lambda: tracker.follow(image, [tracker.first()]), rounds)


def _grains(label: str, rods: Rods, durations: list[Duration], aim: str) -> Row:
    rates = tuple(rods.count / each.processor for each in durations)
    return Row(
        label, f"**{rods.count / fastest_of(durations).processor:.0f} grains/s** of one core", aim, rates, "grains/s"
    )
