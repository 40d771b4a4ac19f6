"""The tracking stage through the command line: editable tables, tracked walls, lens correction, and the report."""

from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest
from rodsight.cli.main import main
from rodsight.experiment.lens import OpenCVLens
from rodsight.experiment.reading.tables import read_table
from rodsight.tracks import Tracks, TrackStatus

from tests.app.experiment.tables import edit
from tests.app.tracking.photographed import Tracked, keep_first_walls, track, wall_errors
from tests.program import refuse

OUTLINE_ALLOWED = 0.1 * 2.5e-4  # [m] rms, a tenth of a pixel: what outlines are exact to
WALL_ALLOWED = 5e-6  # [m] along the normal
LENS = OpenCVLens(fx=900.0, fy=900.0, cx=260.0, cy=300.0, k1=-0.12, k2=0.03, p1=4e-4, p2=-3e-4)
LENS_TABLE = "lens = { fx = 900, cx = 260, cy = 300, k1 = -0.12, k2 = 0.03, p1 = 4e-4, p2 = -3e-4 }\n"

pytestmark = pytest.mark.thorough


def test_walls_of_the_first_photograph_suffice(followed: Tracked) -> None:
    assert np.abs(wall_errors(followed.walls.endpoints, followed.true_walls)).max() < WALL_ALLOWED
    table = read_table(followed.out / "tracked_walls.csv", ("frame", "wall", "x1", "y1", "x2", "y2", "sigma1"))
    assert len(table) == followed.true_walls.shape[0] * 4


def test_rows_of_later_frames_are_kept_when_walls_are_followed(partly_given: Tracked) -> None:
    walls, top = partly_given.walls, partly_given.walls.name.index("top")
    assert walls.endpoints[2, top] == pytest.approx(partly_given.true_walls[2, top])


def test_a_wall_without_marks_is_named(photographed: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    top = keep_first_walls(photographed)[0, 2]
    for file in (photographed / "photos").iterdir():
        image = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        beyond = int(image.shape[0] - top[:, 1].min() / 2.5e-4) + 2
        image[:beyond] = np.quantile(image, 0.02)  # neither paint nor an edge
        cv2.imwrite(str(file), image, [cv2.IMWRITE_JPEG_QUALITY, 95])
    with pytest.raises(SystemExit) as stop:
        main(["track", str(photographed), "--out", str(tmp_path / "out"), "--quiet"])
    message = capsys.readouterr().err
    assert stop.value.code == 2
    assert "walls.csv" in message
    assert "'top'" in message
    assert "patches of texture" in message


def test_detected_grains_can_be_edited_and_used(plain: Tracked, photographed: Path, tmp_path: Path) -> None:
    first = plain.tracks
    with (plain.out / "detections.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [int(row["id"]) for row in rows] == list(first.id)
    kept = [dict(row, id=str(100 + int(row["id"]))) for row in rows if row["id"] != "3"]
    with (photographed / "mine.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0].keys())
        writer.writeheader()
        writer.writerows(kept)
    edit(photographed / "experiment.toml", "interval =", 'grains = "mine.csv"\ninterval =')
    again, _ = track(photographed, tmp_path / "two")
    assert again.grain_count == first.grain_count - 1
    same = np.flatnonzero(first.id != 3)
    assert list(again.id) == list(first.id[same] + 100)
    # The outlines are measured afresh: the centre may move by a part of its own standard deviation.
    assert np.abs(again.position[0] - first.position[0, same]).max() < 5e-5
    assert np.nanmax(np.abs(np.diff(again.position, axis=0) - np.diff(first.position[:, same], axis=0))) < 1e-5


def test_corrections_are_honoured(plain: Tracked, photographed: Path, tmp_path: Path) -> None:
    first = plain.tracks
    (photographed / "corrections.csv").write_text("frame,id,x,y,theta\n2,4,lost,,\n1,7,200.5,210.25,0.25\n")
    edit(photographed / "experiment.toml", "interval =", 'corrections = "corrections.csv"\ninterval =')
    tracks, _ = track(photographed, tmp_path / "two")
    assert tracks.status[2, 4] == TrackStatus.LOST
    assert tracks.status[1, 7] == TrackStatus.GIVEN
    assert tracks.rotation[1, 7] == pytest.approx(0.25)
    height = cv2.imread(str(next((photographed / "photos").iterdir())), 0).shape[0]
    assert tracks.position[1, 7] == pytest.approx([200.5 * 2.5e-4, (height - 1 - 210.25) * 2.5e-4])
    # In the next frame both are found again at their true places.
    assert np.abs(tracks.position[3] - first.position[3]).max() < 1e-6


@pytest.mark.parametrize(
    ("table", "named"),
    [
        ("frame,id,x,y,theta\n0,4,1,2,0\n", ["row 2", "frame = '0'", "photographs.grains"]),
        ("frame,id,x,y,theta\n9,4,1,2,0\n", ["row 2", "frame = '9'"]),
        ("frame,id,x,y,theta\n1,4,1,left,0\n", ["row 2", "y = 'left'"]),
        ("frame,id,x,y,theta\n1,4,nan,2,0\n", ["row 2", "x = 'nan'"]),
        ("frame,id,x,y,theta\n1,4,1,2,0\n1,4,1,2,0\n", ["row 3", "twice"]),
        ("frame,id,x,y\n1,4,1,2\n", ["column theta"]),
    ],
)
def test_a_wrong_correction_is_named(
    photographed: Path, tmp_path: Path, capsys: pytest.CaptureFixture, table: str, named: list[str]
) -> None:
    (photographed / "corrections.csv").write_text(table)
    edit(photographed / "experiment.toml", "interval =", 'corrections = "corrections.csv"\ninterval =')
    message = refuse(capsys, tmp_path / "out", "track", str(photographed))
    for part in ["corrections.csv", *named]:
        assert part in message


@pytest.mark.thorough  # many seconds of photographs
def test_lens_distortion_is_removed_from_the_tracks(plain: Tracked, photographed: Path, tmp_path: Path) -> None:
    straight = plain.tracks.frames(0, 2)
    for file in sorted((photographed / "photos").iterdir()):
        image = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        row, column = np.mgrid[: image.shape[0], : image.shape[1]].astype(np.float64)
        # Every pixel of the distorted photograph shows the straight one at the undistorted place.
        source = LENS.undistort(np.stack([column, row], axis=-1)).astype(np.float32)
        bent = cv2.remap(image, source[..., 0], source[..., 1], cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REPLICATE)
        file.unlink()
        cv2.imwrite(str(file.with_suffix(".png")), bent)
    edit(photographed / "experiment.toml", "photos/*.jpg", "photos/*.png")
    ignored, _ = track(photographed, tmp_path / "ignored", "--frames", "0:2")
    edit(photographed / "experiment.toml", "interval =", LENS_TABLE + "interval =")
    corrected, _ = track(photographed, tmp_path / "seen", "--frames", "0:2")

    def error(tracks: Tracks) -> float:
        near = np.argmin(np.linalg.norm(tracks.position[0][None] - straight.position[0][:, None], axis=2), axis=1)
        assert tracks.grain_count == straight.grain_count
        return float(np.sqrt(np.nanmean((tracks.position[:, near] - straight.position) ** 2)))

    # Outlines are ellipses by a fraction of a per cent, which displaces a centre by tenths of a pixel at most.
    assert error(corrected) < OUTLINE_ALLOWED
    assert error(ignored) > 4 * OUTLINE_ALLOWED


def test_the_report_is_one_page_with_its_pictures_in_it(plain: Tracked) -> None:
    page = (plain.out / "tracking_report.html").read_text()
    assert page.count("<circle") >= plain.tracks.grain_count
    assert page.count("data:image/png;base64,") > 10
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "https://" not in page
    for heading in (
        "Detected grains and walls",
        "Correlation over time",
        "Residual maps",
        "The worst grains",
        "No pose is lost",
    ):
        assert heading in page


def test_a_report_of_tables_is_refused(tracked: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert "--report" in refuse(capsys, tmp_path / "out", "track", str(tracked), "--report")


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ("tracking.radius_range=[9,4]", ["tracking", "radius_range", "[9.0, 4.0]"]),
        ("tracking.search_window=0", ["tracking.search_window", "0"]),
        ("walls.thickness=-1", ["walls.thickness", "-1"]),
        ("photographs.radii=[1e-5]", ["photographs.radii", "1e-05"]),
    ],
)
def test_a_wrong_setting_of_tracking_is_named(
    photographed: Path, tmp_path: Path, capsys: pytest.CaptureFixture, setting: str, named: list[str]
) -> None:
    message = refuse(capsys, tmp_path / "out", "track", str(photographed), "--set", setting)
    for part in ["experiment.toml", *named]:
        assert part in message


def test_walls_are_not_followed_without_photographs(
    tracked: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    message = refuse(capsys, tmp_path / "out", "track", str(tracked), "--set", "walls.track=true")
    assert "walls.track = true" in message
