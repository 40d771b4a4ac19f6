"""Rendered photographs: exact motion, the stated conventions, and a realistic camera."""

import numpy as np
import pytest
from rodsight.synthetic.camera import TILE, pixel_response
from rodsight.synthetic.speckle import RodScene, SpeckleSettings, expose, render_photograph, render_scene
from rodsight.synthetic.speckle_kernels import FINE, SMOOTHING
from scipy.ndimage import gaussian_filter, map_coordinates, spline_filter

PIXEL = 2.0**-12  # [m], a power of two: a whole number of pixels is then exact in floating point
NO_BARS = np.zeros((0, 2, 2))
STILL = {"light": 0.0, "rim_shading": 0.0, "gap_texture": 0.0}  # nothing is fixed in the picture

ROUNDING = 1e-3  # [grey], of float32 scenes and of sin and cos, far below one grey level
SUBPIXEL = 2e-3  # [px]: aliasing of 3 px dots under a blur of .6 px, in a densely summed picture
SUBPIXEL_ANGLE = 2e-4  # [rad]: the same at the rim of a patch of 17 px, averaged over its pixels
UNDER_LIGHT = 8e-3  # [px]: light and rims that stay while a rod moves disturb it (measured: 3e-3 rms, 5e-3 at most)


def scene_of(position, rotation=(0.0,), *, radius=(20.0,), bars=NO_BARS, size=(64, 64), seed=3, **settings):
    """A scene (height, width); lengths in pixels, y up."""
    return render_scene(
        SpeckleSettings(pixel_size=PIXEL, **settings),
        RodScene(
            width=size[1],
            height=size[0],
            radius=np.asarray(radius) * PIXEL,
            position=np.asarray(position, dtype=float).reshape(-1, 2) * PIXEL,
            rotation=np.asarray(rotation, dtype=float),
            bars=np.asarray(bars) * PIXEL,
            pattern_seed=seed,
        ),
    )


def photograph(depth=8, noise_seed=0, pattern_seed=3, **settings):
    return render_photograph(
        SpeckleSettings(pixel_size=PIXEL, depth=depth, **settings),
        RodScene(
            width=70,
            height=60,
            radius=np.array([14.0, 11.0]) * PIXEL,
            position=np.array([[20.3, 30.0], [48.0, 25.5]]) * PIXEL,
            rotation=np.array([0.3, -2.0]),
            bars=np.array([[[0.0, 10.0], [70.0, 12.0]]]) * PIXEL,
            pattern_seed=pattern_seed,
        ),
        noise_seed=noise_seed,
    )


def measure_motion(reference, current, centre, radius, guess):
    """Fit the motion (x, y, angle) of a disc patch in picture coordinates: least squares on quintic splines."""
    rows, columns = np.indices(reference.shape)
    patch = (columns - centre[0]) ** 2 + (rows - centre[1]) ** 2 < radius**2
    x, y, grey = columns[patch] - centre[0], rows[patch] - centre[1], reference[patch].astype(float)
    spline = spline_filter(current.astype(float), 5)

    def warped(motion):
        c, s = np.cos(motion[2]), np.sin(motion[2])
        points = [centre[1] + motion[1] + s * x + c * y, centre[0] + motion[0] + c * x - s * y]
        return map_coordinates(spline, points, order=5, prefilter=False)

    motion, step = np.array(guess, dtype=float), 1e-3
    for _ in range(12):
        slope = [(warped(motion + e) - warped(motion - e)) / (2 * step) for e in np.eye(3) * step]
        columns_of = np.column_stack([*slope, -grey, -np.ones_like(grey)])
        motion += np.linalg.lstsq(columns_of, -warped(motion), rcond=None)[0][:3]
    return motion


def motion_error(shift, angle, **settings):
    """Measured less true motion of one rod, in the picture's sense: y down, clockwise."""
    before = scene_of([31.0, 31.0], **settings)
    after = scene_of([31.0 + shift[0], 31.0 + shift[1]], [angle], **settings)
    truth = np.array([shift[0], -shift[1], -angle])
    return measure_motion(before, after, (31.0, 32.0), 17.0, truth + np.array([0.1, -0.1, 0.01])) - truth


@pytest.mark.parametrize("angle", [0.0, 0.02, 0.7])
@pytest.mark.parametrize("shift", [(0.1, 0.0), (0.25, -0.4), (0.5, 0.5)])
def test_motion_by_a_fraction_of_a_pixel_is_exact(shift, angle):
    error = motion_error(shift, angle, **STILL)
    assert np.abs(error[:2]).max() < SUBPIXEL
    assert abs(error[2]) < SUBPIXEL_ANGLE


def test_light_and_rims_fixed_in_the_picture_change_motion_little():
    assert np.abs(motion_error((0.37, -0.21), 0.05)[:2]).max() < UNDER_LIGHT


def test_motion_by_one_pixel_shifts_the_picture_by_one_pixel():
    bar = np.array([[5.0, 8.25], [60.5, 11.0]])
    rods = np.array([[20.3, 33.7], [45.1, 30.2]])
    arguments = {"rotation": [0.3, -1.0], "radius": [14.0, 10.5], "light": 0.0, "gap_texture": 0.0}
    here = scene_of(rods, bars=[bar], **arguments)
    there = scene_of(rods + np.array([1.0, 2.0]), bars=[bar + np.array([1.0, 2.0])], **arguments)
    np.testing.assert_allclose(there[:-2, 1:], here[2:, :-1], rtol=0, atol=ROUNDING)


def test_a_quarter_rotation_counter_clockwise_rotates_the_picture():
    upright = scene_of([32.0, 32.0], [0.4], size=(65, 65), **STILL)
    turned = scene_of([32.0, 32.0], [0.4 + np.pi / 2], size=(65, 65), **STILL)
    np.testing.assert_allclose(turned, np.rot90(upright), rtol=0, atol=ROUNDING)
    assert np.abs(upright - np.rot90(upright)).max() > 50.0


def test_a_rod_covers_its_area_about_its_position():
    flat = scene_of([20.3, 40.6], radius=[15.4], size=(64, 70), coverage=0.0, brightness_range=0.0, **STILL)
    settings = SpeckleSettings()
    fraction = (flat.astype(float) - settings.gap) / (settings.white - settings.gap)
    assert fraction.sum() == pytest.approx(np.pi * 15.4**2, rel=1e-4)
    rows, columns = np.indices(fraction.shape)
    assert (fraction * columns).sum() / fraction.sum() == pytest.approx(20.3, abs=1e-3)
    assert (fraction * rows).sum() / fraction.sum() == pytest.approx(63 - 40.6, abs=1e-3)


def test_edges_are_those_of_a_blurred_picture_on_square_pixels():
    fine = 9  # sub-pixels a side, of the plain reference: a disc, blurred, then summed over pixels
    centre, radius, blur = np.array([20.3, 18.8]), 12.7, 0.6
    axis = (np.arange(40 * fine) + 0.5) / fine - 0.5
    distance = np.hypot(axis[None] - centre[0], axis[:, None] - (39 - centre[1]))
    disc = np.clip((radius - distance) * fine + 0.5, 0.0, 1.0)
    pixels = gaussian_filter(disc, blur * fine, truncate=6.0).reshape(40, fine, 40, fine).mean(axis=(1, 3))
    flat = scene_of(centre, radius=[radius], size=(40, 40), coverage=0.0, brightness_range=0.0, blur=blur, **STILL)
    settings = SpeckleSettings()
    fraction = (flat - settings.gap) / (settings.white - settings.gap)
    assert np.abs(fraction - pixels).max() < 5e-3  # half a grey level of a contrast of 173 is 3e-3


def test_dots_cover_the_requested_fraction():
    places = np.array([[40.0 + 80 * i, 40.0 + 80 * j] for i in range(4) for j in range(3)])
    settings = SpeckleSettings()
    scene = scene_of(
        places, np.zeros(12), radius=np.full(12, 38.0), size=(240, 320), brightness_range=0.0, coverage=0.5, **STILL
    )
    rows, columns = np.indices(scene.shape)
    inside = (np.hypot(columns - places[:, :1, None], 239 - rows - places[:, 1:, None]) < 34.0).any(axis=0)
    painted = (settings.white - scene[inside].mean()) / (settings.white - settings.black)
    expected = 1 - 0.5**0.925  # the dots' mean strength is .925 of full black
    assert painted == pytest.approx(expected, abs=0.03)  # 12 rods of 200 dots: a standard error of about .01


def test_the_paint_of_a_rod_does_not_depend_on_other_rods():
    near = scene_of([[20.0, 30.0], [45.0, 30.0]], [0.1, 0.2], radius=[12.0, 9.0])
    far = scene_of([[20.0, 30.0], [52.0, 50.0]], [0.1, 2.2], radius=[12.0, 9.0])
    np.testing.assert_array_equal(near[20:47, 6:33], far[20:47, 6:33])
    assert np.abs(near - scene_of([[20.0, 30.0], [45.0, 30.0]], [0.1, 0.2], radius=[12.0, 9.0], seed=4)).max() > 50.0


def test_a_bar_lies_on_the_right_of_its_segment():
    bar = np.array([[[10.0, 20.0], [50.0, 20.0]]])  # eastwards: its right hand is south, the lower part of the picture
    settings = {"bar_thickness": 8 * PIXEL, "bar_coverage": 0.0, **STILL}
    scene = scene_of(np.zeros((0, 2)), [], radius=[], bars=bar, **settings)
    metal, gap = SpeckleSettings().bar_metal, SpeckleSettings().gap
    row = 63 - 20
    assert scene[row - 4, 30] == pytest.approx(gap, abs=ROUNDING)
    assert scene[row + 4, 30] == pytest.approx(metal, abs=0.1)  # 4 px from either edge, blurred by .67 px
    assert scene[row + 12, 30] == pytest.approx(gap, abs=ROUNDING)
    assert scene[row, 30] == pytest.approx((metal + gap) / 2, abs=ROUNDING)
    assert scene[row + 4, 6] == pytest.approx(gap, abs=ROUNDING)
    assert scene[row + 4, 54] == pytest.approx(gap, abs=ROUNDING)
    assert (scene.sum() - gap * scene.size) / (metal - gap) == pytest.approx(40 * 8, rel=1e-4)


def test_a_bars_marks_keep_their_distance_from_its_first_end():
    settings = {"bar_thickness": 12 * PIXEL, "size": (40, 420), **STILL}
    empty = {"position": np.zeros((0, 2)), "rotation": [], "radius": []}
    short = scene_of(**empty, bars=[[[10.0, 20.0], [200.0, 20.0]]], **settings)
    long = scene_of(**empty, bars=[[[10.0, 20.0], [400.0, 20.0]]], **settings)
    np.testing.assert_array_equal(short[:, :190], long[:, :190])
    marks = long[25, 15:395]
    assert marks.max() - marks.min() > 50.0
    assert np.abs(long[15:35, 20:190] - long[15:35, 210:380]).max() > 50.0  # they do not repeat


def test_same_inputs_give_the_same_bytes_and_other_noise_differs_by_noise_alone():
    first = photograph()
    assert first.dtype == np.uint8
    assert first.shape == (60, 70)
    assert first.tobytes() == photograph().tobytes()
    difference = first.astype(float) - photograph(noise_seed=1).astype(float)
    expected = np.sqrt(2 * (2.0**2 + 1 / 12))  # rounding adds 1/12 to each
    assert difference.std() == pytest.approx(expected, rel=0.05)  # 4 200 pixels: a standard error of 1.1 %


def test_sixteen_bits_carry_more_than_eight():
    deep = photograph(depth=16, noise=0.0)
    assert deep.dtype == np.uint16
    assert len(np.unique(deep)) > 1000
    assert np.abs(deep / 257.0 - photograph(noise=0.0)).max() <= 0.5 + ROUNDING


def test_exposure_saturates_instead_of_wrapping():
    scene = np.array([[-20.0, 300.0]], dtype=np.float32)
    assert expose(SpeckleSettings(noise=0.0), scene, noise_seed=0).tolist() == [[0, 255]]
    assert expose(SpeckleSettings(noise=0.0, depth=16), scene, noise_seed=0).tolist() == [[0, 65535]]


def apparent_radius_errors(rim_shading):
    """Return the mean error per rod of the apparent radius, where the grey level is halfway to the backing [px]."""
    places = np.array([[32.0 + 64 * i, 32.0 + 64 * j] for i in range(5) for j in range(4)])
    settings = {"rim_shading": rim_shading, "coverage": 0.0, "light": 0.0, "gap_texture": 0.0}
    scene = scene_of(places, np.zeros(20), radius=np.full(20, 25.0), size=(256, 320), **settings).astype(float)
    angle, distance = np.linspace(0, 2 * np.pi, 90, endpoint=False), np.arange(20.0, 29.0, 0.02)[:, None]
    errors = []
    for x, y in places:
        profile = map_coordinates(scene, [255 - y + distance * np.sin(angle), x + distance * np.cos(angle)])
        halfway = (profile[0] + SpeckleSettings().gap) / 2
        errors.append(distance[np.argmax(profile < halfway, axis=0), 0].mean() - 25.0)
    return np.array(errors)


def test_shaded_rims_reduce_the_apparent_radius_by_some_tenths_of_a_pixel():
    assert np.abs(apparent_radius_errors(0.0)).max() < 0.04  # the curvature of a blurred edge, and steps of .02 px
    shaded = apparent_radius_errors(SpeckleSettings().rim_shading)
    assert -0.3 < shaded.mean() < -0.1
    assert shaded.std() > 0.02  # rods differ


def test_light_is_uneven_within_its_stated_range():
    empty = {"position": np.zeros((0, 2)), "rotation": [], "radius": [], "gap_texture": 0.0, "size": (100, 140)}
    ratio = scene_of(**empty, light=0.15) / scene_of(**empty, light=0.0)
    assert 0.85 - ROUNDING < ratio.min() < 0.9
    assert 1.08 < ratio.max() < 1.15 + ROUNDING


def test_bodies_may_leave_the_picture():
    inside = scene_of([[70.0, 70.0]], [0.2], size=(140, 140), **STILL)
    cut = scene_of([[-2.0, 60.0]], [0.2], size=(70, 64), **STILL)
    np.testing.assert_allclose(cut[:30, :20], inside[60:90, 72:92], rtol=0, atol=ROUNDING)
    outside = scene_of([[-500.0, 20.0]], [0.2], bars=[[[-90.0, 0.0], [-90.0, 50.0]]], **STILL)
    np.testing.assert_allclose(outside, SpeckleSettings().gap, rtol=0, atol=ROUNDING)


def test_a_large_body_drawn_in_tiles_shows_no_seams():
    side = 2 * TILE
    large = {"radius": [200.0], "size": (side + 40, side + 40), "coverage": 0.2, **STILL}
    here, there = scene_of([210.0, 210.0], **large), scene_of([180.0, 195.0], **large)  # cut at other places
    np.testing.assert_allclose(there[50:400, 10:360], here[35:385, 40:390], rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("blur", [0.3, 0.6, 2.0])
def test_the_pixel_response_has_the_stated_variance(blur):
    taps = pixel_response(blur)
    offset = (np.arange(len(taps)) - len(taps) // 2) / FINE
    assert taps.sum() == pytest.approx(1.0)
    assert (taps * offset**2).sum() + (SMOOTHING / FINE) ** 2 == pytest.approx(blur**2 + 1 / 12, rel=5e-3)  # cut tails


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"depth": 12}, "depth must be 8 or 16"),
        ({"pixel_size": 0.0}, "pixel_size must be positive"),
        ({"noise": -1.0}, "noise must not be negative"),
        ({"coverage": 1.0}, "coverage must be in"),
        ({"dot_diameter": (2e-3, 1e-3)}, "dot_diameter must be ascending"),
    ],
)
def test_settings_out_of_range_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        SpeckleSettings(**changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"radius": [-20.0]}, "radius must be positive"),
        ({"rotation": [0.0, 1.0]}, "do not fit"),
        ({"position": [np.nan, 1.0]}, "position has values that are not finite"),
        ({"bars": [[[1.0, 1.0], [1.0, 1.0]]]}, "two ends must differ"),
        ({"bars": [[1.0, 1.0]]}, "bars must be"),
    ],
)
def test_bodies_that_cannot_be_drawn_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        scene_of(**{"position": [31.0, 31.0], **changes})
