"""Accuracy of detection on many photographs, and the memory of a long sequence.

pytest tests/benchmarks/test_detection_benchmark.py --benchmark-only -s
pytest tests/benchmarks/test_detection_benchmark.py -m slow -s
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from rodsight.experiment.pictures.image import LUMA
from rodsight.tracking.detection.detect import Detection, DetectionSettings, detect_grains
from scipy.spatial import KDTree

from tests.app.tracking.detection.polydisperse import draw_discs, lay_discs
from tests.app.tracking.laid_rods import HEIGHT, WIDTH, lay_rods
from tests.app.tracking.real_like import Laboratory, brown_photograph
from tests.app.tracking.speckled import grid_of_rods

Benchmark = Any

# A detection is true within 3 px of a grain and within this fraction of its radius.
MAX_DISTANCE, MAX_RADIUS_FRACTION = 3.0, 0.3
# Of speckled and of brown packings; measured: .988 and more, .11 px and less.
LEAST_FOUND, GREATEST_ERROR = 0.98, 0.15  # recall and precision; rms error of a centre [px]

# 20 Mpx photographs in a sequence, and the memory limit of tracking [GiB].
SEQUENCE, MEMORY = 60, 2.0

LABORATORIES = {
    "plain": Laboratory(),
    "soft": Laboratory(blur=1.5),
    "lathe marks": Laboratory(lathe=15.0, grain=5.0),
    "light 1:4": Laboratory(light=0.6),
    "shaded rims, highlights": Laboratory(shadow=0.5, highlight=30.0),
    "JPEG 80": Laboratory(lathe=10.0, shadow=0.2, highlight=40.0, blur=1.4, jpeg=80),
}


@dataclass(frozen=True, slots=True)
class Score:
    """How well grains are found."""

    recall: float
    precision: float
    centre_error: float  # [px] rms of a component
    text: str

    def report(self, name: str) -> None:
        """Print the score, and check it."""
        report(f"{name}: {self.text}")
        assert min(self.recall, self.precision) > LEAST_FOUND
        assert self.centre_error < GREATEST_ERROR


def score(found: Detection, x: np.ndarray, y: np.ndarray, radius: np.ndarray, size: tuple[int, int]) -> Score:
    """Recall over the grains entirely in view, precision, errors of centre and radius over the stated ones."""
    height, width = size
    near, index = KDTree(np.stack([x, y], axis=1)).query(np.stack([found.x, found.y], axis=1))
    index = np.asarray(index, dtype=np.intp)
    true = near < np.minimum(MAX_DISTANCE, MAX_RADIUS_FRACTION * radius[index])
    inside = (x > radius) & (x < width - radius) & (y > radius) & (y < height - radius)
    hit = np.zeros(len(x), dtype=np.bool_)
    hit[index[true]] = True
    rows = true & inside[index]
    error = np.concatenate([(found.x - x[index])[rows], (found.y - y[index])[rows]])
    scaled = error / np.tile(found.sigma[rows], 2)
    excess = (found.radius - radius[index])[rows]
    text = (
        f"recall {hit[inside].mean():.4f} of {inside.sum()}, precision {true.mean():.4f}, centre "
        f"{np.sqrt((error**2).mean()):.3f} px ({np.sqrt((scaled**2).mean()):.2f} σ), "
        f"radius {np.median(excess):+.2f} ± {excess.std():.2f} px"
    )
    return Score(float(hit[inside].mean()), float(true.mean()), float(np.sqrt((error**2).mean())), text)


def report(text: str) -> None:
    print(f"\n    {text}")


@pytest.mark.benchmark(group="detection")
@pytest.mark.parametrize("classes", [(28.0, 32.0, 44.0), (14.0, 16.0, 22.0)])
@pytest.mark.parametrize("cut", [False, True], ids=["bars", "cut"])
def test_speckled_packings(benchmark: Benchmark, classes: tuple[float, ...], cut: bool) -> None:
    def run() -> None:
        for seed in (10, 11):
            rods = lay_rods(seed, classes, cut=cut)
            found = detect_grains(rods.reference(), DetectionSettings(radii=classes))
            score(found, rods.x, rods.y, rods.radius, (HEIGHT, WIDTH)).report(f"speckle {classes[0]:.0f} px")

    benchmark.pedantic(run, rounds=1)


@pytest.mark.benchmark(group="detection")
@pytest.mark.parametrize("name", list(LABORATORIES))
def test_brown_packings_of_unknown_radius(benchmark: Benchmark, name: str) -> None:
    def run() -> None:
        for seed in (10, 11):
            rods = lay_rods(seed, (14.0, 20.0, 32.0), cut=True)
            image = brown_photograph(
                LABORATORIES[name], WIDTH, HEIGHT, rods.x, rods.y, rods.radius, 0.0 * rods.x,
                pattern_seed=seed, noise_seed=seed,
            ).astype(np.float32) @ LUMA  # fmt: skip
            found = detect_grains(image.astype(np.float32), DetectionSettings())
            score(found, rods.x, rods.y, rods.radius, (HEIGHT, WIDTH)).report(f"brown, {name}")

    benchmark.pedantic(run, rounds=1)


@pytest.mark.slow
@pytest.mark.parametrize("painted", [False, True], ids=["plain", "brown"])
def test_thousands_of_discs_of_sizes_one_to_ten(painted: bool) -> None:
    width, height = 2300, 2000
    x, y, radius = lay_discs(width, height, 5.0, 50.0, 11000, np.random.default_rng(7))
    if painted:
        colour = brown_photograph(Laboratory(), width, height, x, y, radius, 0.0 * x, pattern_seed=1, noise_seed=1)
        image = np.ascontiguousarray(colour.astype(np.float32) @ LUMA, dtype=np.float32)
    else:
        image = draw_discs(width, height, x, y, radius, blur=0.6, noise=4.0, noise_seed=1)
    since = time.process_time()
    found = detect_grains(image)
    report(
        f"{'brown' if painted else 'plain'}, {len(x)} discs of 5 to 50 px: "
        f"{score(found, x, y, radius, (height, width)).text}, {time.process_time() - since:.0f} s"
    )
    assert found.count > 0.9 * len(x)


@pytest.mark.slow
def test_a_long_sequence_of_twenty_megapixels_fits_into_two_gigabytes(tmp_path: Path) -> None:
    """The command runs in a process of its own, so that its peak memory is measured; frames repeat two files."""
    rods = grid_of_rods(17, 17, radius=58.0, pitch=264.0, margin=140.0, noise=2.0)
    assert rods.width * rods.height > 2e7
    photographs = tmp_path / "photos"
    photographs.mkdir()
    for k, shift in enumerate((0.0, 0.7)):
        image = rods.moved(shift, 0.3 * shift, 0.002 * k, noise_seed=k)
        cv2.imwrite(str(photographs / f"img{k}.jpg"), np.clip(np.rint(image), 0, 255).astype(np.uint8))
    for k in range(2, SEQUENCE):
        os.link(photographs / f"img{k % 2}.jpg", photographs / f"img{k}.jpg")
    lines = [f"{k},{x:.3f},{y:.3f},58" for k, (x, y) in enumerate(zip(rods.x, rods.y, strict=True))]
    (tmp_path / "grains.csv").write_text("\n".join(["id,x,y,radius", *lines]) + "\n")
    (tmp_path / "experiment.toml").write_text(
        'name = "long"\n[photographs]\nfiles = "photos/*.jpg"\npixel_size = 1e-4\ninterval = 1.0\n'
        'grains = "grains.csv"\n[material]\ndensity = 2700.0\nlength = 0.06\nfriction = 0.3\n'
    )
    code = (
        "import resource, sys; from rodsight.cli.main import main\n"
        f"try: main(['track', {str(tmp_path)!r}, '--out', {str(tmp_path / 'out')!r}, '--quiet'])\n"
        "except SystemExit as end: assert end.code == 0, end.code\n"
        "print('peak', resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )
    since = time.monotonic()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    found = re.search(r"peak (\d+)", done.stdout)
    assert found is not None
    peak = int(found.group(1)) / 2**20
    report(
        f"{SEQUENCE} photographs of {rods.width * rods.height / 1e6:.1f} Mpx, {rods.count} rods: peak {peak:.2f} GiB, "
        f"{time.monotonic() - since:.0f} s"
    )
    assert peak < MEMORY
