"""Synthetic experiments: the written files agree with the truth, and wrong arguments are refused."""

from __future__ import annotations

import csv
import tomllib
from pathlib import Path
from typing import Any

import cv2
import numba
import numpy as np
import pytest
from rodsight.experiment.units import Scale
from rodsight.process.errors import InputError
from rodsight.synthetic.dense_packing import RADIUS_CLASSES, choose_radii
from rodsight.synthetic.rearrangement import choose_window
from rodsight.synthetic.synthesis import Synthesis, SynthesisSettings, synthesize

# A packing takes some ten thousand steps to prepare: minutes without compilation.
pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")

TINY: dict[str, Any] = {"preset": "paper", "grains": 20, "frames": 3, "pixel_size": 5e-4}
BALANCE = 5e-3  # worst grain over mean force: the simulation's own, and tables rounded to nanometres
ROUNDING = 1e-9  # [m], of the tables
TABLE_FORCE = 0.2  # [N], error of a spring's force from rounding and the last motion


def read_columns(path: Path) -> dict[str, list[str]]:
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in rows[0]}


def read_tracks(path: Path, grains: int) -> tuple[np.ndarray, np.ndarray]:
    columns = read_columns(path)
    assert [int(k) for k in columns["id"][:grains]] == list(range(grains))
    pose = np.array([columns[name] for name in ("x", "y", "theta")], dtype=float).reshape(3, -1, grains)
    return np.moveaxis(pose[:2], 0, 2), pose[2]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def photographed(tmp_path_factory: pytest.TempPathFactory) -> Synthesis:
    return synthesize(tmp_path_factory.mktemp("photographed") / "tiny", SynthesisSettings(seed=4, **TINY))


@pytest.fixture(scope="module")
def tracked(tmp_path_factory: pytest.TempPathFactory) -> Synthesis:
    return synthesize(
        tmp_path_factory.mktemp("tracked") / "tiny",
        SynthesisSettings(seed=4, photographs=False, noise=2e-5, **TINY | {"grains": 60}),
    )


def test_the_same_seed_gives_the_same_bytes(photographed: Synthesis, tmp_path: Path) -> None:
    again = synthesize(tmp_path / "tiny", SynthesisSettings(seed=4, **TINY))
    assert contents(again.folder) == contents(photographed.folder)
    other = contents(synthesize(tmp_path / "other" / "tiny", SynthesisSettings(seed=5, **TINY)).folder)
    assert all(other[name] != data for name, data in contents(photographed.folder).items())


def test_an_experiment_with_photographs_is_described(photographed: Synthesis) -> None:
    assert sorted(contents(photographed.folder)) == [
        "experiment.toml", "grains.csv", "photos/0000.png", "photos/0001.png", "photos/0002.png",
        "truth_contacts.csv", "truth_tracks.csv", "wall_forces.csv", "walls.csv",
    ]  # fmt: skip
    described = tomllib.loads((photographed.folder / "experiment.toml").read_text())
    assert described["name"] == "tiny"
    assert (described["truth"], described["truth_tracks"]) == ("truth_contacts.csv", "truth_tracks.csv")
    assert described["photographs"] == {
        "files": "photos/*.png",
        "pixel_size": 5e-4,
        "interval": pytest.approx(0.25 / 4.8e-3),  # the paper's 0.25° at 4.8e-3 °/s
        "radii": list(RADIUS_CLASSES),
    }
    assert described["walls"] == {"file": "walls.csv", "forces": "wall_forces.csv", "top": {"pressure": 50e3}}
    assert described["material"] == {"density": 2700.0, "length": 0.06, "friction": 0.25, "wall_friction": 0.25}
    assert "tracks" not in described


def test_an_experiment_with_tracks_is_described(tracked: Synthesis) -> None:
    described = tomllib.loads((tracked.folder / "experiment.toml").read_text())
    assert described["tracks"] == {
        "positions": "tracks.csv", "grains": "grains.csv", "times": "times.csv", "precision": 2e-5,
    }  # fmt: skip
    assert "photographs" not in described
    times = np.array(read_columns(tracked.folder / "times.csv")["time"], dtype=float)
    np.testing.assert_allclose(np.diff(times), 0.25 / 4.8e-3, rtol=1e-6)
    radius = np.array(read_columns(tracked.folder / "grains.csv")["radius"], dtype=float)
    assert np.isin(np.round(radius, 9), RADIUS_CLASSES).all()


@pytest.mark.parametrize("kind", ["photographed", "tracked"])
def test_the_written_truth_is_in_balance(kind: str, request: pytest.FixtureRequest) -> None:
    """Forces are assembled from the tables alone."""
    synthesis: Synthesis = request.getfixturevalue(kind)
    n = len(synthesis.truth.radius)
    position, _ = read_tracks(synthesis.folder / "truth_tracks.csv", n)
    columns = read_columns(synthesis.folder / "truth_contacts.csv")
    walls = read_columns(synthesis.folder / "walls.csv")
    segment = {
        (frame, name): np.array([float(walls[key][row]) for key in ("x1", "y1", "x2", "y2")])
        for row, (frame, name) in enumerate(zip(walls["frame"], walls["wall"], strict=True))
    }
    resultant = np.zeros((3, n, 2))
    total = np.zeros(3)
    plate = np.zeros(3)
    for frame, i, j, fn, ft in zip(*(columns[name] for name in ("frame", "i", "j", "fn", "ft")), strict=True):
        k, a = int(frame), int(i)
        if j in synthesis.truth.wall_names:
            x1, y1, x2, y2 = segment[frame, j]
            normal = np.array([y2 - y1, x1 - x2])  # to the right of the wall: out of the packing
            gap = (np.array([x1, y1]) - position[k, a]) @ normal / np.linalg.norm(normal) - synthesis.truth.radius[a]
            assert -gap * synthesis.truth.settings.normal_stiffness == pytest.approx(float(fn), abs=TABLE_FORCE)
        else:
            normal = position[k, int(j)] - position[k, a]
        normal = normal / np.linalg.norm(normal)
        force = float(fn) * normal + float(ft) * np.array([-normal[1], normal[0]])
        resultant[k, a] -= force
        total[k] += float(fn)
        if j == "top":
            plate[k] += force[1]
        elif j not in synthesis.truth.wall_names:
            resultant[k, int(j)] += force
    mean = total / [columns["frame"].count(str(k)) for k in range(3)]
    assert (np.linalg.norm(resultant, axis=2) / mean[:, None]).max() < BALANCE
    x1, _, x2, _ = segment["0", "top"]
    np.testing.assert_allclose(plate, 50e3 * 0.06 * (x1 - x2), rtol=BALANCE)


def test_tracks_have_the_requested_noise(tracked: Synthesis) -> None:
    position, rotation = read_tracks(tracked.folder / "tracks.csv", 60)
    true_position, true_rotation = read_tracks(tracked.folder / "truth_tracks.csv", 60)
    np.testing.assert_allclose(true_position, tracked.truth.position, atol=ROUNDING)
    sampling = 4.0 / np.sqrt(2.0 * 180)  # four standard errors of a standard deviation of 180 values
    assert (position - true_position).std() == pytest.approx(2e-5, rel=sampling)
    rotation_error = (rotation - true_rotation) * tracked.truth.radius
    assert rotation_error.std() == pytest.approx(2e-5, rel=sampling)


def test_tracks_without_noise_are_the_truth_at_the_finest_precision(tmp_path: Path) -> None:
    folder = synthesize(tmp_path / "clean", SynthesisSettings(photographs=False, **TINY)).folder
    assert (folder / "tracks.csv").read_bytes() == (folder / "truth_tracks.csv").read_bytes()
    assert tomllib.loads((folder / "experiment.toml").read_text())["tracks"]["precision"] == 1e-6


def test_rods_in_photographs_are_at_their_true_positions(photographed: Synthesis) -> None:
    truth = photographed.truth
    assert photographed.photograph_shape is not None
    height, width = photographed.photograph_shape
    scale = Scale(5e-4, height)
    row, column = np.mgrid[:height, :width]
    for k in range(truth.frame_count):
        image = cv2.imread(str(photographed.folder / "photos" / f"{k:04d}.png"), cv2.IMREAD_UNCHANGED)
        assert image is not None
        assert (image.shape, image.dtype) == ((height, width), np.uint8)
        x, y = scale.to_pixels(truth.position[k]).T
        distance = np.hypot(column[..., None] - x, row[..., None] - y) - truth.radius / 5e-4
        in_bars = np.zeros(image.shape, dtype=bool)
        points = scale.to_world(np.stack([column, row], axis=-1).astype(float))
        for start, end in truth.endpoints[k]:
            along = (end - start) / np.linalg.norm(end - start)
            in_bars |= (points - start) @ np.array([along[1], -along[0]]) > -1e-3
        on_rods = distance.min(axis=2) < -3
        between = (distance.min(axis=2) > 3) & ~in_bars
        assert between.any()
        assert image[on_rods].mean() > 5 * image[between].mean()
    ends = scale.to_pixels(truth.endpoints)
    assert ends.min() > 5
    assert np.all(ends.max(axis=(0, 1, 2)) < np.array([width, height]) - 5)


@pytest.mark.thorough
def test_rods_and_bars_in_photographs_move_as_the_truth(tmp_path: Path) -> None:
    made = synthesize(
        tmp_path / "turned", SynthesisSettings(**TINY | {"frames": 2, "step_degrees": 6.0, "pixel_size": 2.5e-4})
    )
    assert made.photograph_shape is not None
    scale = Scale(2.5e-4, made.photograph_shape[0])
    photographs = [
        cv2.imread(str(made.folder / "photos" / f"{k:04d}.png"), cv2.IMREAD_GRAYSCALE).astype(np.float32)
        for k in range(2)
    ]
    centre = scale.to_pixels(made.truth.position)
    rotation = made.truth.rotation[1]
    row = int(np.argmax(abs(rotation)))
    assert abs(rotation[row]) > 0.05  # more than a pixel at the rim

    def correlation(angle: float) -> float:
        """Correlate the rod on the second photograph with the first, rotated counter-clockwise by angle."""
        reach = 0.7 * made.truth.radius[row] / 2.5e-4
        x, y = np.meshgrid(np.arange(-reach, reach), np.arange(-reach, reach))  # y down
        inside = np.hypot(x, y) < reach
        back_x, back_y = np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y
        first, second = (
            cv2.remap(
                photographs[k],
                (centre[k, row, 0] + u).astype(np.float32),
                (centre[k, row, 1] + v).astype(np.float32),
                cv2.INTER_LINEAR,
            )[inside]
            for k, u, v in ((0, back_x, back_y), (1, x, y))
        )
        return float(np.corrcoef(first, second)[0, 1])

    assert correlation(rotation[row]) > 0.95
    assert correlation(-rotation[row]) < 0.9
    for start, end in made.truth.endpoints[1]:
        outward = np.array([end[1] - start[1], start[0] - end[0]]) / np.linalg.norm(end - start)
        along = start + np.linspace(0.05, 0.95, 200)[:, None] * (end - start)
        columns, rows = scale.to_pixels(along + 2e-3 * outward).round().astype(int).T
        assert np.quantile(photographs[1][rows, columns], 0.1) > 35.0  # metal and marks: the backing has 12


def test_the_true_grains_of_the_first_photograph_are_in_pixels(photographed: Synthesis) -> None:
    columns = read_columns(photographed.folder / "grains.csv")
    pixels = np.array([columns["x"], columns["y"]], dtype=float).T
    assert photographed.photograph_shape is not None
    world = Scale(5e-4, photographed.photograph_shape[0]).to_world(pixels)
    np.testing.assert_allclose(world, photographed.truth.position[0], atol=1e-4 * 5e-4)  # 1e-4 px, as written
    np.testing.assert_allclose(np.array(columns["radius"], dtype=float) * 5e-4, photographed.truth.radius, rtol=1e-4)


def test_every_depth_and_format_can_be_read(tmp_path: Path) -> None:
    tiny = TINY | {"frames": 1}
    deep = synthesize(tmp_path / "deep", SynthesisSettings(depth=16, **tiny)).folder
    image = cv2.imread(str(deep / "photos" / "0000.png"), cv2.IMREAD_UNCHANGED)
    assert image is not None
    assert image.dtype == np.uint16
    assert len(np.unique(image)) > 256
    small = synthesize(tmp_path / "small", SynthesisSettings(jpeg_quality=90, **tiny)).folder
    assert tomllib.loads((small / "experiment.toml").read_text())["photographs"]["files"] == "photos/*.jpg"
    assert cv2.imread(str(small / "photos" / "0000.jpg"), cv2.IMREAD_UNCHANGED) is not None


def test_an_invalid_experiment_name_is_replaced(tmp_path: Path) -> None:
    folder = synthesize(tmp_path / '"x":y', SynthesisSettings(photographs=False, **TINY | {"frames": 1})).folder
    assert tomllib.loads((folder / "experiment.toml").read_text())["name"] == "synthetic -x--y"


def test_a_reversal_changes_direction_half_way(tmp_path: Path) -> None:
    shear = synthesize(
        tmp_path / "cycle", SynthesisSettings(photographs=False, reversal=True, **TINY | {"frames": 5})
    ).truth.shear
    np.testing.assert_allclose(np.rad2deg(shear), [0.0, 0.25, 0.5, 0.25, 0.0], atol=1e-9)


@pytest.mark.slow
def test_the_small_preset_puts_a_rearrangement_among_its_photographs(tmp_path: Path) -> None:
    small = synthesize(
        tmp_path / "small", SynthesisSettings(preset="small", photographs=False, grains=30, frames=8, step_degrees=0.5)
    )
    assert small.truth.frame_count == 8
    np.testing.assert_allclose(np.diff(np.rad2deg(small.truth.shear)), 0.5, atol=1e-9)
    assert np.isnan(small.old_unbalance[0])
    assert small.old_unbalance[small.rearrangement] == np.nanmax(small.old_unbalance)
    np.testing.assert_array_equal(small.truth.rotation[0], 0.0)


def test_the_window_holds_the_greatest_event_with_margins_around_it() -> None:
    calm = np.full(40, 0.01)
    calm[0] = np.nan
    calm[[3, 20, 39]] = 0.5, 0.3, 0.6
    assert choose_window(calm, 8) == (16, 20)
    calm[37] = 0.4  # three photographs at the end: two (a quarter of the window), itself counted, suffice
    assert choose_window(calm, 8) == (32, 37)
    assert choose_window(np.array([0.1, 0.3, 0.2]), 1) == (1, 1)
    with pytest.raises(ValueError, match="leave no choice"):
        choose_window(calm[:5], 8)


@pytest.fixture(scope="module")
def apparatus(tmp_path_factory: pytest.TempPathFactory) -> Synthesis:
    folder = tmp_path_factory.mktemp("apparatus") / "lab"
    return synthesize(
        folder, SynthesisSettings(preset="1g2e", grains=60, frames=3, photographs=False, radius_error=-0.02, seed=1)
    )


def test_the_apparatus_is_described(apparatus: Synthesis) -> None:
    described = tomllib.loads((apparatus.folder / "experiment.toml").read_text())
    assert described["walls"] == {"corners": "corners.csv", "load": "load.csv"}
    assert described["material"] == {"density": 2900.0, "length": 0.06, "friction": 0.3, "wall_friction": 0.5}
    assert described["tracks"]["precision"] == 1e-5
    corners = read_columns(apparatus.folder / "corners.csv")
    assert set(corners["radius"]) == {"0.020600000"}
    np.testing.assert_allclose(np.diff(np.rad2deg(apparatus.truth.shear)), 0.0267, atol=1e-9)
    times = np.array(read_columns(apparatus.folder / "times.csv")["time"], dtype=float)
    np.testing.assert_allclose(np.diff(times), 5.0)
    stated = np.array(read_columns(apparatus.folder / "grains.csv")["radius"], dtype=float)
    np.testing.assert_allclose(stated, 0.98 * apparatus.truth.radius, atol=ROUNDING)


def test_the_load_of_the_apparatus_is_that_of_bar_and_discs(apparatus: Synthesis) -> None:
    """The force is measured on the bar and its two discs together; it is the load per length of 719 N twice on .5 m."""
    load = np.array(read_columns(apparatus.folder / "load.csv")["force"], dtype=float)
    truth, n = apparatus.truth, len(apparatus.truth.radius)
    length = np.linalg.norm(np.diff(truth.endpoints[0, truth.wall_names.index("top")], axis=0))
    np.testing.assert_allclose(load, 1438.0 / 0.5 * length, rtol=1e-2)
    plate = [n + truth.wall_names.index(name) for name in ("top", "top-right", "top-left")]
    frame = np.repeat(np.arange(truth.frame_count), np.diff(truth.offset))
    on_bar = np.bincount(frame[truth.j == plate[0]], truth.fn[truth.j == plate[0]], truth.frame_count)
    assert (on_bar < 0.95 * load).all()
    assert np.isin(plate[1:], truth.j).all()


def test_rods_of_the_apparatus_are_in_balance_while_it_moves(apparatus: Synthesis) -> None:
    truth = apparatus.truth
    assert truth.settings.moving
    assert truth.unbalance.max() < 0.01
    assert np.linalg.norm(np.diff(truth.position, axis=0), axis=2).mean() > 1e-5


@pytest.mark.thorough
def test_corner_discs_are_photographed(tmp_path: Path) -> None:
    made = synthesize(
        tmp_path / "lab", SynthesisSettings(preset="1g2e", grains=30, frames=1, pixel_size=5e-4, png=True)
    )
    image = cv2.imread(str(made.folder / "photos" / "0000.png"), cv2.IMREAD_GRAYSCALE)
    corners = read_columns(made.folder / "corners.csv")
    for x, y in zip(corners["x"], corners["y"], strict=True):
        column, row = (int(each) for each in Scale(5e-4, image.shape[0]).to_pixels(np.array([float(x), float(y)])))
        assert image[row - 10 : row + 11, column - 10 : column + 11].mean() > 60  # brighter than the backing


def test_radii_come_in_the_papers_classes() -> None:
    radius = choose_radii(1172, np.random.default_rng(0))
    assert sorted(set(radius)) == list(RADIUS_CLASSES)
    assert np.pi * np.sum(radius**2) == pytest.approx(0.5 * 0.6 * 0.845, rel=0.01)  # fills the paper's frame


def test_progress_is_reported(tmp_path: Path) -> None:
    steps: list[tuple[str, int, int]] = []
    synthesize(tmp_path / "tiny", SynthesisSettings(**TINY), progress=lambda *step: steps.append(step))
    stages = [("simulate", k, 3) for k in range(4)] + [("photograph", k, 3) for k in range(4)]
    assert steps == stages


def test_a_folder_that_is_not_empty_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="not an empty folder"):
        synthesize(tmp_path, SynthesisSettings(**TINY))
    assert contents(tmp_path) == {"notes.txt": b"mine"}
    with pytest.raises(InputError, match="not an empty folder"):
        synthesize(tmp_path / "notes.txt", SynthesisSettings(**TINY))


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"preset": "huge"}, "preset = 'huge'"),
        ({"seed": -1}, "seed = -1"),
        ({"depth": 12}, "depth = 12"),
        ({"noise": -1e-5, "photographs": False}, "noise = -1e-05"),
        ({"noise": 1e-5}, "noise = 1e-05"),
        ({"noise": float("nan"), "photographs": False}, "noise = nan"),
        ({"grains": 3}, "grains = 3"),
        ({"frames": 0}, "frames = 0"),
        ({"step_degrees": -0.25}, "step_degrees = -0.25"),
        ({"pixel_size": float("inf")}, "pixel_size = inf"),
        ({"frames": 200}, "shears to 49.75°"),
        ({"radius_error": 0.2}, "radius_error = 0.2"),
        ({"jpeg_quality": 0}, "jpeg_quality = 0"),
        ({"jpeg_quality": 90, "depth": 16}, "jpeg_quality = 90"),
    ],
    ids=str,
)
def test_a_wrong_argument_is_named_and_nothing_is_written(wrong: dict[str, Any], named: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        synthesize(tmp_path / "out", SynthesisSettings(**{"preset": "paper"} | wrong))
    assert named in str(caught.value)
    assert list(tmp_path.iterdir()) == []
