from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rerun as rr
from rodsight.drawing.force_range import ForceRange
from rodsight.recording.curve_layers.convergence import SMALLEST, power_of_ten
from rodsight.recording.curve_layers.force_density import BINS as DENSITY_BINS
from rodsight.recording.curve_layers.force_density import EDGES, density_points, merge_bins
from rodsight.recording.curve_layers.statistic_curves import CURVES
from rodsight.recording.curve_layers.stress_and_fabric import BINS, ROSE_REACH, direction_densities, rose_outline
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities
from rodsight.recording.look.canvas import Canvas
from rodsight.recording.look.clock import Clock
from rodsight.recording.look.force_style import ForceStyle
from rodsight.recording.look.printable_text import printable
from rodsight.recording.look.scene import Scene
from rodsight.recording.packing_layers.contact_changes import gap_colours
from rodsight.recording.packing_layers.forces.true_forces import TruthWriter
from rodsight.recording.packing_layers.grains_and_walls import _spin_marks, last_seen
from rodsight.recording.packing_layers.rods_in_3d import rotations_from_axis
from rodsight.recording.tabs.views import curve_view
from rodsight.results.results import TruthContacts
from rodsight.results.truth import score
from rodsight.solver.contacts.contacts import Contacts
from rodsight.solver.statistics.balance import grain_unbalance

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest, rows

ROUNDING = 1e-12
FLOAT32 = 1e-6


def test_a_grain_compressed_from_both_sides_is_in_equilibrium():
    contacts = Contacts(
        np.array([0, 1], np.int32), np.array([1, 2], np.int32), np.zeros(2), np.array([[1.0, 0.0], [1.0, 0.0]]),
        np.zeros((2, 2)), 3, 0,
    )  # fmt: skip
    present = np.ones(3, bool)
    unbalance = grain_unbalance(contacts, np.array([7.0, 7.0]), np.array([1.0, 1.0]), np.zeros((3, 2)), present)
    assert unbalance[1] == pytest.approx(0.0, abs=ROUNDING)
    assert np.allclose(unbalance[[0, 2]], np.hypot(7.0, 1.0) / 7.0, rtol=ROUNDING)


def test_a_lost_grain_is_shown_at_its_last_or_next_position():
    position = np.arange(12.0).reshape(3, 2, 2)
    position[1:, 0] = np.nan
    position[:2, 1] = np.nan
    shown = last_seen(position, 1)
    assert shown.tolist() == [[0.0, 1.0], [10.0, 11.0]]


def test_the_ends_of_the_gap_ramp_differ_and_nan_is_drawn_as_touching():
    colours = gap_colours(np.array([-1.0, 0.0, 1.0, np.nan]), 1e-5)
    assert len(set(colours[:3].tolist())) == 3
    assert colours[3] == colours[1]


def test_residuals_become_powers_of_ten_with_a_floor():
    assert power_of_ten(np.array([1e-3, 0.0])).tolist() == [-3.0, np.log10(SMALLEST)]
    assert np.isnan(power_of_ten(np.array([np.inf, np.nan]))).all()


def test_densities_are_drawn_at_their_values():
    width = EDGES[1] - EDGES[0]
    points = density_points(np.array([0.6, 1.2]), np.array([30.0, 10.0]), np.full(2, width), 40)
    assert len(points) == 2
    drop = points[1, 1] - points[0, 1]  # y down: 30 to 10 of 40 is log10 3 on an axis of 4.5 decades over 380
    assert drop == pytest.approx(np.log10(3.0) / 4.5 * 380.0, rel=1e-5)  # float32


def test_sparse_bins_of_the_tail_are_merged_without_losing_a_force():
    counts = np.zeros(DENSITY_BINS)
    counts[:4], counts[4:16] = 50.0, 1.0
    centre, count, width = merge_bins(counts, 4)
    assert count[:4].tolist() == [50.0] * 4  # below the mean no bins are merged
    assert count[4:].tolist() == [4.0, 4.0, 4.0]
    assert width[4:] == pytest.approx(4 * (EDGES[1] - EDGES[0]))
    assert centre[4] == pytest.approx(EDGES[4] + 2 * (EDGES[1] - EDGES[0]))


def test_a_rose_of_isotropic_directions_is_the_unit_circle():
    angle = (np.arange(4 * BINS) + 0.5) * 2.0 * np.pi / (4 * BINS)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    densities = direction_densities(normal, np.ones(len(angle)))
    assert np.allclose(densities, 1.0, atol=ROUNDING)
    assert np.allclose(np.linalg.norm(rose_outline(densities), axis=1), 100.0, rtol=FLOAT32)


def test_a_rose_points_in_the_direction_of_its_contacts_and_the_opposite_direction():
    densities = direction_densities(np.array([[0.0, 1.0]]), np.array([2.0]))
    assert np.flatnonzero(densities).tolist() == [BINS // 4, 3 * BINS // 4]
    outline = rose_outline(densities)
    assert outline[:, 1].min() == pytest.approx(-100.0 * ROSE_REACH)  # up, as y is down; clipped at the edge


def test_capsules_are_aligned_with_their_branches():
    branch = np.random.default_rng(0).normal(size=(50, 2))
    x, y, z, w = rotations_from_axis(branch).astype(np.float64).T
    rotated = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)  # of (0, 0, 1)
    direction = branch / np.linalg.norm(branch, axis=1)[:, None]
    assert np.allclose(rotated, np.column_stack([direction, np.zeros(50)]), atol=FLOAT32)


def test_the_truth_tab_and_the_summary_file_have_the_same_values(recording, results, truth):
    for frame, agreement in enumerate(score(results, truth)):
        for path, value in (
            (entities.TRUTH_R_FN, agreement.r_fn), (entities.TRUTH_R_FT, agreement.r_ft),
            (entities.TRUTH_ERROR, agreement.relative_l2),
        ):  # fmt: skip
            shown = latest(recording.path, path, entities.FRAME, frame)["Scalars:scalars"]
            assert shown == pytest.approx([value], rel=ROUNDING)


def test_characters_that_the_font_lacks_are_replaced():
    assert printable("φ = 18.3°, σ₁ ≥ 2 µm, Größe\n") == "φ = 18.3°, σ₁ ≥ 2 µm, Größe\n"
    assert printable("⟨f⟩ 砂 \U0001f600\x07") == "<f> ? ??"


def test_a_counter_clockwise_rotation_by_90_degrees_moves_the_mark_from_the_top_to_the_left():
    marks = _spin_marks(np.zeros((2, 2)), np.ones(2), np.array([0.0, np.pi / 2]))
    assert np.allclose(marks[0, :, 0], 0.0, atol=FLOAT32)
    assert np.all(marks[0, :, 1] < -0.5)  # y down
    assert np.allclose(marks[1, :, 1], 0.0, atol=FLOAT32)
    assert np.all(marks[1, :, 0] < -0.5)


def test_the_stress_cross_lies_along_the_principal_direction(recording, results):
    for statistics, frame in zip(results.statistics, range(4), strict=True):
        strips = np.array(latest(recording.path, entities.STRESS_CROSS, entities.FRAME, frame)["LineStrips2D:strips"])
        greatest, least = strips[:, 1] - strips[:, 0]
        angle = np.arctan2(-greatest[1], greatest[0])  # y down
        assert np.sin(angle - statistics.principal_direction) == pytest.approx(0.0, abs=FLOAT32)
        ratio = np.linalg.norm(least) / np.linalg.norm(greatest)
        assert np.arcsin((1 - ratio) / (1 + ratio)) == pytest.approx(statistics.friction_angle, rel=1e-4)  # float32


def test_the_truth_of_a_lost_grain_counts_as_missed(recording, results, truth):
    frame = 2  # grain 20 is lost from this frame on; it gets a true contact
    lost = TruthContacts(*(np.append(column, value) for column, value in (
        (truth.frame, frame), (truth.i, 20), (truth.j, 21), (truth.fn, 500.0), (truth.ft, 0.0))))  # fmt: skip
    writer = TruthWriter(scene_of(results), lost)
    stream = rr.RecordingStream(entities.APPLICATION_ID)
    memory = stream.binary_stream()
    agreement = writer.log(Clock(stream, frame, 0, 0), results.frames[frame])
    assert memory.read()
    whole = TruthWriter(scene_of(results), truth).log(Clock(stream, frame, 0, 0), results.frames[frame])
    assert agreement.r_fn < whole.r_fn
    assert agreement.relative_l2 > whole.relative_l2


def scene_of(results) -> Scene:
    canvas = Canvas.around(results.tracks, None)
    return Scene(
        results.name, results.tracks, results.walls, results.grains, results.friction, results.configuration, canvas,
        ForceStyle.on(canvas, ForceRange.of(results.frames)),
    )  # fmt: skip


def test_a_rose_leaves_out_contacts_with_walls(tmp_path):
    results = make_results(1, sweeps=2)
    path = write_recording(results, tmp_path / "run.rrd").path
    forces = results.frames[0]
    between = (forces.fn > 0) & ~forces.contacts.with_wall
    expected = rose_outline(direction_densities(forces.contacts.normal[between], np.ones(int(between.sum()))))
    shown = latest(path, entities.ROSE, entities.FRAME, 0)["LineStrips2D:strips"]
    assert forces.contacts.with_wall.any()
    assert np.allclose(np.array(shown[0]), expected, atol=1e-3)


def test_bands_are_two_standard_deviations_wide_and_recorded_forces_are_shown_beside_inferred_ones(tmp_path):
    results = make_results(2, sweeps=2)
    statistics = [replace(each, friction_angle_sd=np.radians(1.5)) for each in results.statistics]
    force = np.zeros((2, 4, 2))
    force[:, 0] = (3.0, -40.0)  # on the bottom, whose outward normal points down
    walls = replace(results.walls, force=force)
    path = write_recording(replace(results, statistics=statistics, walls=walls), tmp_path / "run.rrd").path
    angle = np.degrees(results.statistics[1].friction_angle)
    band = latest(path, entities.FRICTION_ANGLE + entities.BAND, entities.FRAME, 1)["Scalars:scalars"]
    assert band == pytest.approx([angle - 3.0, angle + 3.0])
    assert latest(path, entities.WALL_NORMAL_RECORDED, entities.FRAME, 1)["Scalars:scalars"][0] == pytest.approx(40.0)


def test_every_wall_has_a_curve_of_its_own_colour_and_marker(tmp_path):
    path = write_recording(make_results(2, sweeps=2), tmp_path / "run.rrd").path
    style = {name: value for row in rows(path, entities.WALL_NORMAL_FORCE) for name, value in row.items()}
    colours, markers = style["SeriesLines:colors"], style["SeriesPoints:markers"]
    assert len(set(colours)) == len(set(markers)) == len(style["SeriesLines:names"]) == 4
    assert style["SeriesPoints:colors"] == colours


def test_every_curve_of_the_statistics_has_its_band_and_every_plot_that_shows_it_shows_both(tmp_path):
    results = make_results(2, sweeps=2)
    deviations = {f"{curve.field}_sd": 0.25 for curve in CURVES}
    statistics = [replace(each, **deviations) for each in results.statistics]
    path = write_recording(replace(results, statistics=statistics), tmp_path / "run.rrd").path
    for curve in CURVES:
        value = latest(path, curve.path, entities.FRAME, 1)["Scalars:scalars"][0]
        band = latest(path, curve.path + entities.BAND, entities.FRAME, 1)["Scalars:scalars"]
        assert band == pytest.approx([value - 0.5 * curve.unit, value + 0.5 * curve.unit], nan_ok=True), curve
    view = curve_view("both", [entities.TAIL_EXPONENT, entities.TRUST])
    assert view.contents == [entities.TAIL_EXPONENT + entities.BAND, entities.TAIL_EXPONENT, entities.TRUST]


def test_long_names_of_walls_do_not_overlap_in_their_key(tmp_path):
    results = make_results()
    walls = replace(results.walls, name=tuple(f"the upper half {name}" for name in results.walls.name))
    write_recording(replace(results, walls=walls), tmp_path / "run.rrd")
    key = rows(tmp_path / "run.rrd", entities.WALL_KEY)[-1]
    places, names = np.array(key["Points2D:positions"]), key["Points2D:labels"]
    for row in np.unique(places[:, 1]):
        here = np.flatnonzero(places[:, 1] == row)
        assert (np.diff(np.sort(places[here, 0])) > 8.0 * max(len(names[k]) for k in here)).all()
    assert len(np.unique(places[:, 1])) > 1
