"""Scenarios: their truths are in equilibrium, and each folder departs from the truth in one way."""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numba
import numpy as np
import pytest
from rodsight.process.errors import InputError
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.wall_shapes import circle_parameters
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import measure_contacts
from rodsight.solver.dem.box_cell import BOX_NAMES
from rodsight.solver.dem.dem_truth import DemTruth
from rodsight.solver.statistics.balance import resultant_norms
from rodsight.synthetic.dense_packing import RADIUS_CLASSES, WIDE_RADII, choose_two_radii, choose_wide_radii
from rodsight.synthetic.scenarios import departures
from rodsight.synthetic.scenarios.bed_paths import simulate_bed
from rodsight.synthetic.scenarios.loading_paths import simulate_loading
from rodsight.synthetic.scenarios.observed_data import ObservedData, observe_truth
from rodsight.synthetic.scenarios.preset_names import ScenarioName
from rodsight.synthetic.scenarios.scenario_folder import load_or_simulate, make_scenario
from rodsight.synthetic.scenarios.scenario_table import SCENARIOS

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")

FEW = 40  # rods: a truth within half a second
BALANCE = 5e-3  # mean unbalance over the mean force
LOAD = 1e-2  # relative


def truth_of(name: ScenarioName, frames: int = 2) -> DemTruth:
    return simulate_loading(replace(SCENARIOS[name].loading, frames=frames), FEW, seed=3)


def force_on(truth: DemTruth, name: str) -> np.ndarray:
    """Normal force on a wall in every frame (f,) [N]."""
    wall = len(truth.radius) + truth.wall_names.index(name)
    frame = np.repeat(np.arange(truth.frame_count), np.diff(truth.offset))
    return np.bincount(frame[truth.j == wall], truth.fn[truth.j == wall], truth.frame_count)


@pytest.fixture(scope="module")
def sheared() -> DemTruth:
    return truth_of("shear", frames=3)


@pytest.fixture
def observed(sheared: DemTruth) -> ObservedData:
    return observe_truth(sheared, ("top",), 1e-5, np.random.default_rng(0))


def test_every_name_has_a_scenario() -> None:
    assert set(get_args(ScenarioName)) == set(SCENARIOS)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["biaxial", "isotropic", "gravity"])
def test_the_truth_of_a_scenario_is_in_equilibrium(name: ScenarioName) -> None:
    truth = truth_of(name, frames=3)
    grains = Grains.of_rods(truth.radius, density=truth.settings.density, length=truth.settings.length)
    for k in range(truth.frame_count):
        rows = slice(truth.offset[k], truth.offset[k + 1])
        contacts = measure_contacts(
            grains, truth.position[k], Walls.at_rest(truth.endpoints[k]), truth.i[rows], truth.j[rows]
        )
        found = resultant_norms(contacts, truth.fn[rows], truth.ft[rows], grains.weight(truth.settings.gravity))
        assert found.mean() / truth.fn[rows].mean() < BALANCE
    length = np.linalg.norm(truth.endpoints[:, :, 1] - truth.endpoints[:, :, 0], axis=2)
    np.testing.assert_allclose(length, np.broadcast_to(length[0], length.shape), rtol=1e-9)  # bars are rigid
    if name == "biaxial":
        right = truth.wall_names.index("right")
        face = np.array([Walls.at_rest(endpoints).face[right] for endpoints in truth.endpoints])
        assert (face < 0.95 * length[:, right]).all()  # the bar overhangs
        stated = truth.settings.pressure * truth.settings.length * face
        np.testing.assert_allclose(force_on(truth, "right"), stated, rtol=LOAD)
        assert force_on(truth, "top")[-1] > 1.2 * force_on(truth, "top")[0]
    elif name == "isotropic":
        np.testing.assert_allclose(force_on(truth, "top")[1] / force_on(truth, "top")[[0, 2]], 3.0, rtol=LOAD)
        np.testing.assert_allclose(force_on(truth, "right")[1] / force_on(truth, "right")[[0, 2]], 3.0, rtol=LOAD)
    else:
        assert truth.wall_names == ("bottom", "right", "left")
        weight = grains.mass.sum() * 9.81
        friction = 0.25 * (force_on(truth, "right") + force_on(truth, "left"))
        np.testing.assert_allclose(force_on(truth, "bottom"), weight, atol=friction.max())


def test_a_packing_around_a_moving_core_is_in_equilibrium_under_the_rings_pressure() -> None:
    truth = truth_of("circle", frames=3)
    grains = Grains.of_rods(truth.radius, density=truth.settings.density, length=truth.settings.length)
    assert truth.side is not None
    for k in range(truth.frame_count):
        walls, rows = Walls.at_rest(truth.endpoints[k], side=truth.side), slice(truth.offset[k], truth.offset[k + 1])
        contacts = measure_contacts(grains, truth.position[k], walls, truth.i[rows], truth.j[rows])
        assert contacts.gap.max() < 0.0
        found = resultant_norms(contacts, truth.fn[rows], truth.ft[rows], grains.weight(truth.settings.gravity))
        inner = np.bincount(contacts.j[contacts.j >= grains.count] - grains.count, minlength=2)
        assert (inner > 0).all()
        assert found.mean() / truth.fn[rows].mean() < BALANCE
        stated = truth.settings.pressure * truth.settings.length * walls.face[0]
        assert force_on(truth, "ring")[k] == pytest.approx(stated, rel=LOAD)
    centre, _, angle = circle_parameters(truth.endpoints[:, 1])
    assert centre[2, 0] - centre[0, 0] == pytest.approx(0.02 * 0.5 * np.ptp(truth.endpoints[0, 0, :, 0]), rel=LOAD)
    assert angle == pytest.approx([0.0, 0.02, 0.04])


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "walls"),
    [("shear_box", (*BOX_NAMES[:-1],)), ("footing", ("bottom", "right", "left", "footing")),
     ("intruder", ("bottom", "right", "left", "intruder")), ("drum", ("ring",)),
     ("membrane", ("bottom", "top", "left"))],
)  # fmt: skip
def test_the_truths_of_other_apparatus_are_in_equilibrium(name: ScenarioName, walls: tuple[str, ...]) -> None:
    truth = simulate_bed(replace(SCENARIOS[name].loading, frames=2), FEW, seed=3)
    assert truth.wall_names == walls
    assert truth.unbalance.max() < BALANCE
    weight = np.pi * truth.radius**2 * truth.settings.density * truth.settings.length * 9.81
    if name == "shear_box":
        assert force_on(truth, "top") == pytest.approx(force_on(truth, "top")[0], rel=LOAD)
        assert (np.diff(truth.endpoints[:, walls.index("upper-left"), 0, 0]) > 0).all()
    elif name == "drum":
        angle = circle_parameters(truth.endpoints[:, 0])[2]
        assert np.rad2deg(np.diff(angle)) == pytest.approx([0.75])
        assert np.allclose(truth.position[1] - truth.position[0], 0.0, atol=0.01)
    else:
        assert (force_on(truth, walls[-1]) > 0.0).all()
    if name == "membrane":  # less the friction on plate and bottom
        height = np.diff(truth.endpoints[:, :2, 0, 1], axis=1)[:, 0]
        load = truth.settings.pressure * truth.settings.length * height
        assert force_on(truth, "left") == pytest.approx(load, rel=0.3)
    if name == "footing":
        assert force_on(truth, "bottom") == pytest.approx(weight.sum() + force_on(truth, "footing"), rel=0.3)


@pytest.mark.thorough
def test_rods_at_a_membrane_are_stated_as_boundary_beside_the_walls(tmp_path: Path, monkeypatch) -> None:
    truth = simulate_bed(replace(SCENARIOS["membrane"].loading, frames=2), FEW, seed=3)
    monkeypatch.setattr("rodsight.synthetic.scenarios.scenario_folder.load_or_simulate", lambda *_: truth)
    folder = make_scenario(tmp_path / "membrane", "membrane", 3, grains=FEW).folder
    written = tomllib.loads((folder / "experiment.toml").read_text())
    assert written["boundary"] == {"grains": "boundary.csv"}
    assert written["walls"] == {"file": "walls.csv", "load": "load.csv"}
    stated = [int(row["id"]) for row in columns(folder / "boundary.csv")]
    assert truth.position[0, :, 0].argmax() in stated
    assert len(stated) < FEW / 2
    right = truth.position[0, stated, 0].mean()
    assert right > np.median(truth.position[0, :, 0])


def test_elliptic_rods_are_stated_as_round() -> None:
    truth = truth_of("elliptic")
    assert truth.settings.ovality == 0.05
    stated = observe_truth(truth, ("top",), 0.0, np.random.default_rng(0))
    np.testing.assert_array_equal(np.unique(stated.radius), RADIUS_CLASSES)  # the mean ones
    grains = Grains.of_rods(truth.radius, density=truth.settings.density, length=truth.settings.length)
    rows = slice(truth.offset[0], truth.offset[1])
    gap = measure_contacts(
        grains, truth.position[0], Walls.at_rest(truth.endpoints[0]), truth.i[rows], truth.j[rows]
    ).gap
    # Of a pair the gap of mean radii varies as the sum of two waves, each of standard deviation e R / √2.
    assert gap[truth.j[rows] < FEW].std() == pytest.approx(0.05 * truth.radius.mean(), rel=0.3)


@pytest.mark.thorough
def test_loads_are_stated_exactly_and_circles_in_a_separate_table(tmp_path: Path, monkeypatch) -> None:
    def make(name: ScenarioName) -> Path:
        monkeypatch.setattr(
            "rodsight.synthetic.scenarios.scenario_folder.load_or_simulate", lambda *_: truth_of(name, frames=3)
        )
        return make_scenario(tmp_path / name, name, 3, grains=FEW).folder

    folder = make("loads")
    assert tomllib.loads((folder / "experiment.toml").read_text())["walls"] == {"file": "walls.csv", "load": "load.csv"}
    rows = columns(folder / "load.csv")
    assert [(row["frame"], row["wall"]) for row in rows] == [(str(k), w) for k in range(3) for w in ("top", "right")]
    top = np.array([float(row["force"]) for row in rows if row["wall"] == "top"])
    assert top[2] / top[0] == pytest.approx(1.4, rel=0.05)
    drum = make("circle")
    walls = tomllib.loads((drum / "experiment.toml").read_text())["walls"]
    assert walls == {"arcs": "arcs.csv", "forces": "wall_forces.csv", "ring": {"pressure": 50e3}}
    assert [(row["wall"], row["side"]) for row in columns(drum / "arcs.csv")[:2]] == [("ring", "in"), ("core", "out")]
    assert SCENARIOS["loads"].scale_known


def test_discs_on_a_base_are_sheared_at_constant_area() -> None:
    truth = truth_of("nearly_jammed")
    bottom, right, top, _ = truth.endpoints[:, :, 0].transpose(1, 0, 2)
    width, height = right[:, 0] - bottom[:, 0], top[:, 1] - bottom[:, 1]
    assert height[1] / height[0] == pytest.approx(1.0 - 0.003)
    assert width[1] * height[1] == pytest.approx(width[0] * height[0])
    overlap = truth.fn.mean() / truth.settings.normal_stiffness / (2.0 * truth.radius.mean())
    assert 1e-3 < overlap < 1e-2


def test_radii_are_drawn_from_the_named_distribution() -> None:
    rng = np.random.default_rng(0)
    wide = choose_wide_radii(2000, rng)
    assert wide.min() >= WIDE_RADII[0]
    assert wide.max() <= WIDE_RADII[1]
    area = wide**2
    small = wide < np.mean(WIDE_RADII)
    assert area[small].sum() / area.sum() == pytest.approx(0.5, abs=0.05)
    two = choose_two_radii(11, rng)
    assert sorted(np.unique(two, return_counts=True)[1]) == [5, 6]


def test_corners_lie_on_both_bars_and_slide(observed: ObservedData) -> None:
    endpoints = departures.state_corners(observed, np.random.default_rng(0)).endpoints
    np.testing.assert_allclose(endpoints[:, :, 1], np.roll(endpoints[:, :, 0], -1, axis=1), atol=1e-12)
    start, along = observed.endpoints[:, :, 0], observed.endpoints[:, :, 1] - observed.endpoints[:, :, 0]
    outward = np.stack([along[..., 1], -along[..., 0]], axis=-1)
    for end in range(2):
        off = np.einsum("fwk,fwk->fw", endpoints[:, :, end] - start, outward)
        np.testing.assert_allclose(off, 0.0, atol=1e-12)
    length = np.linalg.norm(endpoints[:, 1, 1] - endpoints[:, 1, 0], axis=1)
    assert np.ptp(length) > 1e-7  # the packing dilates or shrinks


def test_short_walls_end_below_the_plate(observed: ObservedData) -> None:
    found = departures.misstate_wall_ends(observed, np.random.default_rng(0)).endpoints
    length, before = (np.linalg.norm(e[:, :, 1] - e[:, :, 0], axis=2) for e in (found, observed.endpoints))
    np.testing.assert_allclose(length / before, np.tile([1.0, 1.0 - 0.08 / 0.6, 1.0, 1.0 - 0.08 / 0.6], (3, 1)))
    np.testing.assert_array_equal(found[:, 1, 0], observed.endpoints[:, 1, 0])
    np.testing.assert_array_equal(found[:, 3, 1], observed.endpoints[:, 3, 1])


def test_ids_of_unseen_rods_are_missing(observed: ObservedData) -> None:
    found = departures.omit_rods(observed, np.random.default_rng(0))
    assert len(found.id) == FEW - 1
    assert np.all(np.diff(found.id) >= 1)
    np.testing.assert_array_equal(found.position, observed.position[:, found.id])


def test_the_camera_shifts_all_rods_of_a_photograph_equally(observed: ObservedData) -> None:
    found = departures.move_camera(observed, np.random.default_rng(0))
    shift = found.position - observed.position
    np.testing.assert_allclose(shift, np.broadcast_to(shift[:, :1], shift.shape), atol=1e-15)
    assert len(np.unique(shift[:, 0].round(12))) == 6
    assert 1e-5 < np.abs(shift).max() <= 6e-5
    np.testing.assert_array_equal(found.endpoints, observed.endpoints)


def test_centre_errors_rotate_with_their_rods(observed: ObservedData) -> None:
    turning = replace(observed, rotation=np.array([0.0, 0.5 * np.pi, np.pi])[:, None] * np.ones(FEW))
    found = departures.displace_centres(turning, np.random.default_rng(0))
    error = found.position - observed.position
    np.testing.assert_allclose(error[1], np.stack([-error[0, :, 1], error[0, :, 0]], axis=1), atol=1e-15)
    np.testing.assert_allclose(error[2], -error[0], atol=1e-15)
    assert error[0].std() == pytest.approx(5e-5, rel=4.0 / np.sqrt(4 * FEW))
    assert found.precision == 5e-5


@pytest.mark.parametrize(
    ("departure", "deviation", "mean"),
    [(departures.scatter_radii(0.01), 0.01, 0.0), (departures.shrink_radii, 0.0, -0.03)],
    ids=["scattered", "too small"],
)
def test_radius_errors_have_the_stated_size(
    departure: departures.Departure, deviation: float, mean: float, observed: ObservedData
):
    error = (departure(observed, np.random.default_rng(0)).radius - observed.radius) / observed.radius.mean()
    assert error.std() == pytest.approx(deviation, rel=4.0 / np.sqrt(2 * FEW), abs=1e-12)
    assert error.mean() == pytest.approx(mean, abs=4.0 * deviation / np.sqrt(FEW) + 1e-12)


def columns(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def making(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sheared: DemTruth) -> Callable[..., Path]:
    """Make a scenario from an existing truth."""
    monkeypatch.setattr("rodsight.synthetic.scenarios.scenario_folder.load_or_simulate", lambda *_: sheared)

    def make(name: ScenarioName, **given) -> Path:
        return make_scenario(tmp_path / name, name, 5, grains=FEW, **given).folder

    return make


def test_a_folder_holds_the_whole_truth_beside_the_observed_data(
    making: Callable[..., Path], sheared: DemTruth
) -> None:
    folder = making("unseen")
    ids = {row["id"] for row in columns(folder / "grains.csv")}
    assert len(ids) == FEW - 1
    assert {row["id"] for row in columns(folder / "tracks.csv")} == ids
    assert len({row["id"] for row in columns(folder / "truth_tracks.csv")}) == FEW
    assert len(columns(folder / "truth_contacts.csv")) == len(sheared.fn)
    described = tomllib.loads((folder / "experiment.toml").read_text())
    assert described["walls"]["top"] == {"pressure": 50e3}
    assert described["truth_tracks"] == "truth_tracks.csv"


def test_the_scale_of_forces_is_unknown_without_a_loaded_plate(making: Callable[..., Path]) -> None:
    folder = making("nearly_jammed")
    described = tomllib.loads((folder / "experiment.toml").read_text())
    assert described["walls"] == {"file": "walls.csv"}
    assert not (folder / "wall_forces.csv").exists()
    assert set(columns(folder / "tracks.csv")[0]) == {"frame", "id", "x", "y"}  # rotations are unknown
    assert described["tracks"]["precision"] == pytest.approx(SCENARIOS["nearly_jammed"].noise)


def test_friction_and_weight_are_stated_as_the_scenario_specifies(making: Callable[..., Path]) -> None:
    material = tomllib.loads((making("mu_high") / "experiment.toml").read_text())["material"]
    assert (material["friction"], material["wall_friction"]) == (0.4, 0.4)
    assert "gravity" not in material
    assert SCENARIOS["gravity"].scale_known
    assert not SCENARIOS["isotropic"].scale_known


def test_two_scenarios_of_one_truth_have_the_same_noise(making: Callable[..., Path]) -> None:
    shear, camera = (making(name) for name in ("shear", "mu_low"))
    assert (shear / "tracks.csv").read_bytes() == (camera / "tracks.csv").read_bytes()


def test_a_truth_is_simulated_once_and_cached(tmp_path: Path) -> None:
    loading = replace(SCENARIOS["shear"].loading, frames=1)
    first = load_or_simulate(loading, FEW, 0, tmp_path)
    (file,) = tmp_path.iterdir()
    stages: list[str] = []
    again = load_or_simulate(loading, FEW, 0, tmp_path, lambda stage, *_: stages.append(stage))
    assert stages == []
    np.testing.assert_array_equal(again.position, first.position)
    load_or_simulate(replace(loading, loose=True), FEW, 0, tmp_path)
    assert len(list(tmp_path.iterdir())) == 2
    assert file.exists()


@pytest.mark.parametrize(
    ("wrong", "named"),
    [({"grains": 5}, "grains = 5"), ({"noise": -1.0}, "noise = -1"), ({"noise": float("nan")}, "noise = nan")],
    ids=str,
)
def test_a_wrong_argument_is_named(wrong: dict[str, float], named: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=named):
        make_scenario(tmp_path / "out", "shear", 0, **wrong)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_a_cropped_packing_keeps_the_error_that_was_made_before(observed: ObservedData) -> None:
    cropped = departures.crop_to_interior(observed, np.random.default_rng(1))
    both = departures.in_turn(departures.misstate_friction(0.5), departures.crop_to_interior)(
        observed, np.random.default_rng(1)
    )
    assert both.outer
    assert both.known.friction == 0.5
    np.testing.assert_array_equal(both.id, cropped.id)


def test_loads_are_left_out(observed: ObservedData) -> None:
    assert observed.known.pressure
    unknown = departures.omit_loads(observed, np.random.default_rng(1))
    assert not unknown.known.pressure
    assert unknown.known == replace(observed.known, pressure={})
