from __future__ import annotations

import numpy as np
import pytest
from rodsight.drawing.force_range import ForceRange
from rodsight.drawing.ramps import (
    _FORCE_PATH,
    _FORCE_PATH_ON_WHITE,
    FORCE_RAMP,
    RAMP_LEVELS,
    even_path,
    lab_from_lch,
    linear_srgb,
)
from rodsight.experiment.jpeg_photographs import LARGEST, encode_jpeg
from rodsight.experiment.units import Scale
from rodsight.recording.look.canvas import NOMINAL_RADIUS, Canvas
from rodsight.recording.look.colours import (
    _DIFFERENCE_PATH,
    _GAP_PATH,
    _PROBABILITY_PATH,
    _UNCERTAINTY_PATH,
    packed,
)
from rodsight.recording.look.force_style import ForceStyle
from rodsight.recording.packing_layers.forces.network import SweepChoice, chosen_sweeps, visible_sweeps
from rodsight.solver.bodies.wall_shapes import IN
from rodsight.tracks import WallTracks

from tests.app.recording.fake_results import RADIUS, make_results

GAMUT = 0.01  # of linear sRGB: invisible change by clipping
EVEN = 1e-6  # relative: rounding


@pytest.mark.parametrize(
    "path", [_FORCE_PATH, _FORCE_PATH_ON_WHITE, _GAP_PATH, _UNCERTAINTY_PATH, _PROBABILITY_PATH, _DIFFERENCE_PATH]
)
def test_a_ramp_is_perceptually_uniform_and_within_srgb(path):
    lab = even_path(lab_from_lch(path), RAMP_LEVELS)
    steps = np.linalg.norm(np.diff(lab, axis=0), axis=1)
    # The straight distance of a step around a corner of the path is shorter; all others are equal.
    assert np.sum(steps < (1.0 - EVEN) * steps.max()) <= len(path) - 2
    linear = linear_srgb(lab)
    assert linear.min() > -GAMUT
    assert linear.max() < 1.0 + GAMUT


def test_greater_forces_are_always_lighter():
    light = even_path(lab_from_lch(_FORCE_PATH), RAMP_LEVELS)[:, 0]
    assert np.all(np.diff(light) > 0.0)
    assert np.all(np.diff(even_path(lab_from_lch(_FORCE_PATH_ON_WHITE), RAMP_LEVELS)[:, 0]) < 0.0)  # darker on white


def test_oklab_white_and_black_are_srgb_white_and_black():
    linear = linear_srgb(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    assert np.allclose(linear, [[1.0] * 3, [0.0] * 3], atol=1e-4)  # the constants have ten digits and nearly cancel


def test_packed_colours_keep_their_channels():
    assert packed(np.array([[1, 2, 3, 4], [255, 0, 0, 255]], np.uint8)).tolist() == [0x01020304, 0xFF0000FF]


def test_width_and_brightness_grow_with_force_in_exact_steps():
    style = ForceStyle(ForceRange(10.0, 60.0), NOMINAL_RADIUS, 0.25)
    fn = np.linspace(0.0, 80.0, 400)
    radii = style.radii(fn)
    assert np.all(np.diff(radii) >= 0.0)
    assert np.array_equal(radii, np.round(radii * 4.0) / 4.0)
    assert len(np.unique(radii)) > 30
    assert radii[-1] == radii[fn >= 60.0][0]
    assert style.clipped(fn) == np.count_nonzero(fn > 60.0)


def test_only_weak_contacts_are_grey():
    style = ForceStyle(ForceRange(10.0, 60.0), NOMINAL_RADIUS, 0.25)
    colours = style.colours(np.array([np.nan, 0.0, 1.0, 4.9, 5.1, 60.0, 1e6]))
    red, green, blue = (colours >> shift & 0xFF for shift in (24, 16, 8))
    chroma = np.maximum(np.maximum(red, green), blue) - np.minimum(np.minimum(red, green), blue)
    assert np.all(chroma[:4] < 12)
    assert np.all(chroma[4:] > 40)
    assert colours[5] == colours[6] == packed(FORCE_RAMP[-1:])[0]


def test_a_run_without_any_force_has_a_valid_range():
    assert ForceRange.of([]).top > ForceRange.of([]).mean > 0.0


def test_the_quantum_is_a_quarter_pixel_for_the_nominal_grain():
    canvas = Canvas.around(make_results(1).tracks, None)
    assert canvas.grain_radius == pytest.approx(NOMINAL_RADIUS)
    assert canvas.quantum == 0.25


@pytest.mark.parametrize(("wide", "whole"), [(1.0, True), (9.0, False)])
def test_a_ring_around_the_grains_is_within_the_canvas_unless_it_is_far_larger(wide, whole):
    tracks = make_results(1).tracks
    place = tracks.position[tracks.present]
    radius = wide * float(np.ptp(place, axis=0).max())
    ends = place.mean(axis=0) + radius * np.array([[-1.0, 0.0], [1.0, 0.0]])
    ring = WallTracks(
        ("drum",), np.tile(ends, (tracks.frame_count, 1, 1, 1)), np.array([np.nan]), side=np.full(1, IN, np.int8)
    )
    bare = Canvas.around(tracks, None)
    canvas = Canvas.around(tracks, None, None, ring)
    corners = bare.points(place.mean(axis=0) + radius * np.array([[-1.0, 1.0], [1.0, -1.0]]))
    inside = canvas.left < corners[0, 0] < corners[1, 0] < canvas.right
    assert (inside and canvas.top < corners[0, 1] < corners[1, 1] < canvas.bottom) == whole
    assert (canvas == bare) != whole


def test_points_coincide_with_the_photograph():
    tracks, height = make_results(1).tracks, 3000
    canvas = Canvas.around(tracks, Scale(RADIUS / 40.0, height), (height, 2001))
    assert canvas.shrink == 2
    assert height * 2001 > LARGEST
    picture = np.zeros((height, 2001), np.float32)
    picture[1000:1008, 500:508] = 254.6
    middle = Scale(RADIUS / 40.0, height).to_world(np.array([503.5, 1003.5]))
    import cv2

    shown = np.asarray(cv2.imdecode(encode_jpeg(picture).jpeg, cv2.IMREAD_GRAYSCALE))
    row, column = np.argwhere(shown > 128).mean(axis=0) + 0.5  # centres of pixels in viewer coordinates
    assert np.allclose(canvas.points(middle), [column, row], atol=0.05)  # [px], change of an edge by JPEG


def test_chosen_sweeps_keep_the_first_ones_and_the_limit():
    history = make_results(1, sweeps=1000).frames[0].history
    chosen = chosen_sweeps(history, SweepChoice.LOG, 40)
    assert len(chosen) <= 40
    assert chosen[:8].tolist() == list(range(8))
    assert chosen[-1] == 999
    assert len(chosen_sweeps(history, SweepChoice.ALL, 40)) == 1000


@pytest.mark.parametrize("choice", list(SweepChoice))
def test_the_first_row_is_the_first_sweep_and_the_last_the_reported_field(choice):
    forces = make_results(1, sweeps=200, recorded=np.array([5, 50, 199])).frames[0]
    rows, fn, ft = visible_sweeps(forces, 200, choice, 40)
    assert rows[0] == 0
    assert np.array_equal(fn[-1], forces.fn)
    assert np.array_equal(ft[-1], forces.ft)
    if choice is not SweepChoice.NONE:
        assert rows.tolist() == [0, 5, 50, 199, 200]
        assert not fn[0].any()  # the forces of the first sweep were not kept
