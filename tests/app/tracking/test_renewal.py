"""Renewal of references: only grains that lose their paint get a new one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from rodsight.experiment.photographs import Photographs
from rodsight.experiment.units import Scale
from rodsight.process.frame_range import ALL_FRAMES
from rodsight.results.checkpoint import Checkpoint
from rodsight.results.hdf5.store import Provenance, load_tracks, save_tracks
from rodsight.tracking.detection.detect import Detection
from rodsight.tracking.follow import Execution, ReferenceGrains, Series, follow_photographs
from rodsight.tracking.report.page import TrackingReportData, tracking_report
from rodsight.tracks import Tracks, TrackStatus

from tests.app.tracking.speckled import PIXEL_SIZE, Rods, grid_of_rods

FRAMES, DAMAGE = 14, 5
BARE = 170.0  # [grey], of a face without paint
DAMAGED = np.array([3, 11, 20])
STEP = (1.6, -0.9, 0.03)  # px, px, rad from photograph to photograph
RENEWED_ALLOWED = 0.05  # [px] rms: bare where the paint was white, pixels of the lost half still take part
WHOLE_ALLOWED = 0.015  # [px] rms


@pytest.fixture(scope="module")
def rods() -> Rods:
    return grid_of_rods(6, 4, radius=23.5, pitch=49.0, margin=80.0, seed=4)


def photograph(rods: Rods, frame: int, bare: np.ndarray, moves: tuple[float, float, float] = STEP) -> np.ndarray:
    """The rods after `frame` steps; the right half of the rods `bare` has lost its paint."""
    dx, dy, angle = (frame * step for step in moves)
    image = rods.moved(dx, dy, angle, noise_seed=300 + frame)
    noise = np.random.default_rng(frame).normal(0.0, rods.settings.noise, image.shape)
    row, column = np.mgrid[: image.shape[0], : image.shape[1]]
    for k in bare:
        ax, ay = column - rods.x[k] - dx, row - rods.y[k] - dy
        right = np.cos(angle) * ax + np.sin(angle) * ay
        fraction = np.clip(right + 0.5, 0.0, 1.0) * np.clip(rods.radius[k] - np.hypot(ax, ay) + 0.5, 0.0, 1.0)
        image = (1.0 - fraction) * image + fraction * (BARE + noise)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def follow(rods: Rods, photographs: Photographs, folder: Path, workers: int = 1) -> Tracks:
    n = rods.count
    detection = Detection(rods.x, rods.y, rods.radius, np.full(n, 0.05), np.ones(n))
    series = Series(photographs, np.arange(float(len(photographs))), Scale(PIXEL_SIZE, rods.height))
    grains = ReferenceGrains(np.arange(n), detection, rods.radius * PIXEL_SIZE)
    return follow_photographs(series, grains, Execution(workers, Checkpoint(folder, "one")))


def position_error(tracks: Tracks, rods: Rods) -> np.ndarray:
    """Components of the position errors (f, n, 2) [px]."""
    moved = Scale(PIXEL_SIZE, rods.height).to_pixels(tracks.position) - np.stack([rods.x, rods.y], axis=1)
    return moved - np.arange(tracks.frame_count)[:, None, None] * np.array(STEP[:2])


@pytest.fixture(scope="module")
def photographs(rods: Rods, tmp_path_factory: pytest.TempPathFactory) -> Photographs:
    folder = tmp_path_factory.mktemp("damaged")
    for frame in range(FRAMES):
        image = photograph(rods, frame, DAMAGED if frame >= DAMAGE else DAMAGED[:0])
        cv2.imwrite(str(folder / f"{frame:02d}.png"), image)
    return Photographs.matching(folder, "*.png")


@pytest.fixture(scope="module")
def tracks(rods: Rods, photographs: Photographs, tmp_path_factory: pytest.TempPathFactory) -> Tracks:
    return follow(rods, photographs, tmp_path_factory.mktemp("checkpoint"))


def test_damaged_grains_get_a_new_reference_and_no_others(rods: Rods, tracks: Tracks) -> None:
    assert tracks.reference_frame is not None
    whole = np.setdiff1d(np.arange(rods.count), DAMAGED)
    assert not tracks.reference_frame[:, whole].any()
    assert not tracks.reference_frame[: DAMAGE + 3].any()
    assert (tracks.reference_frame[-1, DAMAGED] >= DAMAGE + 2).all()
    assert tracks.renewal_count == len(DAMAGED)
    assert (tracks.status[DAMAGE : DAMAGE + 3, DAMAGED] == TrackStatus.ROBUST).all()
    assert (tracks.status[-1] == TrackStatus.OK).all()


def test_a_new_reference_keeps_the_error_small_and_its_sigma_covers_it(rods: Rods, tracks: Tracks) -> None:
    error = position_error(tracks, rods)
    whole = np.setdiff1d(np.arange(rods.count), DAMAGED)
    assert np.sqrt(np.mean(error[1:, whole] ** 2)) < WHOLE_ALLOWED
    assert np.sqrt(np.mean(error[-3:, DAMAGED] ** 2)) < RENEWED_ALLOWED
    angle = -tracks.rotation[-1, DAMAGED]
    assert np.abs(angle - (FRAMES - 1) * STEP[2]).max() < 0.005
    # The variance of the pose in the new reference is added to that of all later ones.
    renewed = tracks.reference_frame
    assert renewed is not None
    for k in DAMAGED:
        since = int(renewed[-1, k])
        assert (tracks.sigma[since + 1 :, k] > tracks.sigma[since, k]).all()
    assert np.abs(error[-1, DAMAGED] * PIXEL_SIZE / tracks.sigma[-1, DAMAGED, None]).max() < 4.0


@pytest.mark.parametrize("kept", [3, 9, 11])
def test_a_resumed_run_with_other_workers_is_bit_identical(
    rods: Rods, photographs: Photographs, tracks: Tracks, tmp_path: Path, kept: int
) -> None:
    follow(rods, photographs, tmp_path / "c")
    for file in sorted((tmp_path / "c").glob("*.piece"))[kept:]:
        file.unlink()
    again = follow(rods, photographs, tmp_path / "c", workers=2)
    for name in ("position", "rotation", "sigma", "zncc", "second_zncc", "status", "reference_frame"):
        assert getattr(again, name).tobytes() == getattr(tracks, name).tobytes(), name


def test_second_best_and_references_are_stored(tracks: Tracks, tmp_path: Path) -> None:
    save_tracks(tmp_path / "tracks.h5", "damaged", tracks, None, Provenance("", "", (0, None), {}))
    again, _ = load_tracks(tmp_path / "tracks.h5")
    for name in ("second_zncc", "reference_frame"):
        assert getattr(again, name).tobytes() == getattr(tracks, name).tobytes()
        assert getattr(again.frames(2, 9), name).shape == (7, tracks.grain_count)
    unknown = replace(tracks, second_zncc=None, reference_frame=None)
    save_tracks(tmp_path / "tracks.h5", "damaged", unknown, None, Provenance("", "", (0, None), {}))
    again, _ = load_tracks(tmp_path / "tracks.h5")
    assert again.second_zncc is None
    assert again.reference_frame is None
    assert again.renewal_count == 0


@pytest.mark.thorough
def test_the_report_names_grains_with_a_new_reference(rods: Rods, photographs: Photographs, tracks: Tracks) -> None:
    second = np.full(tracks.zncc.shape, np.nan)
    second[DAMAGE, DAMAGED] = 0.4321
    page = tracking_report(
        TrackingReportData(
            "damaged", replace(tracks, second_zncc=second), None, ALL_FRAMES, Scale(PIXEL_SIZE, rods.height),
            np.stack([rods.x, rods.y], axis=1), rods.radius, np.ones(rods.count), photographs.__getitem__,
        )
    )  # fmt: skip
    assert "3 grains were damaged and got a new reference" in page
    assert "3 (from photograph 7)" in page
    assert "second best ZNCC 0.4321" in page


@pytest.mark.thorough
def test_a_stain_that_stays_in_place_is_no_damage(rods: Rods, tmp_path: Path) -> None:
    for frame in range(FRAMES):
        image = photograph(rods, frame, DAMAGED[:0])
        if frame >= DAMAGE:
            for k in (8, 15):
                x, y = int(rods.x[k] + 10.0 + DAMAGE * STEP[0]), int(rods.y[k])
                cv2.line(image, (x, y - 40), (x - 4, y + 40), 20, 9)
        cv2.imwrite(str(tmp_path / f"{frame:02d}.png"), image)
    tracks = follow(rods, Photographs.matching(tmp_path, "*.png"), tmp_path / "c")
    assert (tracks.status[DAMAGE:, [8, 15]] == TrackStatus.ROBUST).sum() > 6
    assert tracks.renewal_count == 0
    assert np.sqrt(np.nanmean(position_error(tracks, rods)[1:] ** 2)) < WHOLE_ALLOWED
