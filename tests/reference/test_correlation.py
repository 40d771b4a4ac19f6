"""The compiled loops of correlation against the plain ones.

SINGLE: photographs, spline weights and sums of a search are in single precision, seven digits of some hundred grey
levels; what is derived from them keeps four to five.
"""

import numpy as np
import pytest
from numba import njit
from rodsight.tracking.correlation import kernels
from rodsight.tracking.correlation.coarse_to_fine import select_distinct_places
from rodsight.tracking.correlation.noise import image_noise
from rodsight.tracking.correlation.search import angles_to_try, disc_offsets, search_patch
from rodsight.tracking.correlation.search_parts import search_parts
from rodsight.tracking.correlation.splines import spline_coefficients
from rodsight.tracking.detection.circles.edges import sample_rays
from rodsight.tracking.interpolation.projections import project_cubic, project_quintic
from rodsight.tracking.interpolation.recursive_filter import quintic_coefficients
from rodsight.tracking.interpolation.spline_values import interpolate_cubic, interpolate_quintic
from rodsight.tracking.interpolation.spline_vectors import read_cubic, read_quintic
from scipy.ndimage import correlate, correlate1d, gaussian_filter

from tests.reference.twins.correlation import (
    best_places,
    cut_patch,
    fit_plainly,
    pixels_within,
    search_plainly,
    tukey_fixed_point,
)
from tests.reference.twins.splines import value, values

pytestmark = pytest.mark.unit

SINGLE = 2e-5
CENTRE, REACH = (30.3, 27.8), 9.2


@njit
def read_all(coefficients, at, finely):
    """The spline at points (p, 2); only compiled code reads several taps at once."""
    found = np.empty(len(at))
    for k in range(len(at)):
        ix, iy = int(at[k, 0]), int(at[k, 1])
        tx, ty = np.float32(at[k, 0] - ix), np.float32(at[k, 1] - iy)
        found[k] = read_quintic(coefficients, ix, iy, tx, ty) if finely else read_cubic(coefficients, ix, iy, tx, ty)
    return found


@njit
def project(coefficients, blocks, count, corner, place, level, sums, finely):
    x, y, cos, sin = place
    if finely:
        project_quintic(coefficients, blocks, count, corner[0], corner[1], x, y, cos, sin, level, sums)
    else:
        project_cubic(coefficients, blocks, count, corner[0], corner[1], x, y, cos, sin, level, sums)


@pytest.fixture(scope="module")
def picture():
    """A speckled photograph (h, w) [grey]."""
    noise = np.random.default_rng(8).normal(size=(60, 64))
    return (110.0 + 320.0 * gaussian_filter(noise, 1.6)).astype(np.float32)


@pytest.fixture(scope="module")
def patch(picture):
    return cut_patch(picture, spline_coefficients(picture), *CENTRE, REACH)


def fill(picture, coefficients=None):
    data = np.empty((kernels.count_pixels(*CENTRE, REACH), 6), np.float32)
    inverse, statistics = np.empty((3, 3)), np.empty(3)
    coefficients = spline_coefficients(picture) if coefficients is None else coefficients
    good = kernels.fill_patch(picture, coefficients, *CENTRE, REACH, data, inverse, statistics)
    return good, data, inverse, statistics


def packed(data):
    blocks = np.empty((-(-len(data) // kernels.LANES), kernels.COLUMNS, kernels.LANES), np.float32)
    kernels.pack_blocks(data, blocks)
    return blocks


def fit_rigidly(coefficients, data, inverse, max_shift, min_zncc, tolerance, limit, pose, fit):
    coarse = np.empty((5, 5))
    kernels.fill_coarse(data, coarse)
    kernels.fit_rigid(
        coefficients, packed(data), len(data), coarse, inverse, REACH, max_shift, min_zncc, tolerance, limit, pose, fit,
        np.empty(kernels.SUMS),
    )  # fmt: skip


def moved(picture, shift, angle, gain=1.3, level=-20.0):
    """The picture rotated about the patch's centre, shifted, with other gain and offset; and the pose to be found."""
    c, s = np.cos(angle), np.sin(angle)
    fine = quintic_coefficients(np.pad(picture, 12, mode="reflect"))
    y, x = np.nonzero(np.ones(picture.shape, bool))
    dx, dy = x - CENTRE[0] - shift[0], y - CENTRE[1] - shift[1]
    result = values(fine, CENTRE[0] + c * dx + s * dy + 12, CENTRE[1] - s * dx + c * dy + 12, 5)
    result = (level + gain * result.reshape(picture.shape)).astype(np.float32)
    return result, np.array([CENTRE[0] + shift[0], CENTRE[1] + shift[1], angle])


def test_the_spline_interpolates_between_pixels(picture):
    at = np.random.default_rng(1).uniform([4.0, 4.0], [58.0, 54.0], (40, 2))
    for coefficients, read, degree in (
        (spline_coefficients(picture), interpolate_cubic, 3),
        (quintic_coefficients(picture), interpolate_quintic, 5),
    ):
        found = [read(coefficients, int(x), int(y), np.float32(x - int(x)), np.float32(y - int(y))) for x, y in at]
        expected = [value(coefficients, x, y, degree) for x, y in at]
        assert found == pytest.approx(expected, rel=SINGLE)


def test_whole_rows_of_taps_read_the_same_spline(picture):
    at = np.random.default_rng(2).uniform([4.0, 4.0], [59.0, 55.0], (40, 2))
    for coefficients, degree in ((spline_coefficients(picture), 3), (quintic_coefficients(picture), 5)):
        found = read_all(coefficients, at, degree == 5)
        assert found == pytest.approx([value(coefficients, x, y, degree) for x, y in at], rel=SINGLE)


@pytest.mark.parametrize("finely", [True, False])
@pytest.mark.parametrize(("angle", "count"), [(0.0, 16), (0.4, 21), (-2.5, 7)])
def test_the_photograph_is_projected_on_the_images_of_a_patch(picture, finely, angle, count):
    rng = np.random.default_rng(3)
    data = rng.normal(size=(count, 6)).astype(np.float32)
    data[:, :2] *= 4.0
    coefficients, level = quintic_coefficients(picture), np.float32(103.0)
    c, s = np.cos(angle), np.sin(angle)
    x, y = 30.3 + c * data[:, 0] - s * data[:, 1], 27.8 + s * data[:, 0] + c * data[:, 1]
    grey = values(coefficients, x, y, 5 if finely else 3) - level
    sums = np.full(kernels.SUMS, np.nan)
    place = tuple(np.float32([27.3, 26.8, c, s]))
    project(coefficients, packed(data), count, (3, 1), place, level, sums, finely)
    expected = [*(grey @ data[:, 2:]), grey.sum(), grey @ grey]
    assert sums == pytest.approx(expected, abs=1e-5 * np.abs(grey).sum() * np.abs(data).max())
    assert sums[-1] == pytest.approx(expected[-1], rel=1e-5)


@pytest.mark.parametrize("count", [1, 8, 9, kernels.COARSE_PIXELS * 3 + 5])
def test_the_pixels_of_the_coarse_steps_are_the_first_of_the_blocks(count):
    data = np.random.default_rng(4).normal(size=(count, 6)).astype(np.float32)
    blocks = packed(data).transpose(0, 2, 1).reshape(-1, 6)
    stride = kernels.coarse_stride(count)
    coarse = data[::stride]
    assert kernels.count_coarse(count) == len(coarse)
    assert np.array_equal(blocks[: len(coarse)], coarse)
    assert sorted(blocks[:count].tolist()) == sorted(data.tolist())
    assert not blocks[count:].any()


@pytest.mark.parametrize("shape", [(60, 64), (3, 7), (1, 40), (45, 1), (33, 100)])
def test_recursive_filters_invert_the_sampled_quintic_spline(shape):
    image = np.random.default_rng(5).uniform(0.0, 255.0, shape).astype(np.float32)
    coefficients = quintic_coefficients(image).astype(np.float64)
    for axis in (0, 1):
        taps = np.array([1.0, 26.0, 66.0, 26.0, 1.0]) / 120.0
        coefficients = correlate1d(coefficients, taps, axis=axis, mode="mirror")
    assert coefficients == pytest.approx(image, abs=1e-3)


def test_a_subset_of_pixels_gives_the_same_direction():
    rng = np.random.default_rng(4)
    data = rng.normal(size=(kernels.COARSE_PIXELS * 3 + 5, 6)).astype(np.float32)
    coarse = np.empty((5, 5))
    kernels.fill_coarse(data, coarse)
    chosen = data[::3].astype(np.float64)
    design = np.column_stack([chosen[:, 3:], chosen[:, 2], np.ones(len(chosen))])
    assert coarse == pytest.approx(np.linalg.inv(design.T @ design), rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("shape", [(64, 96), (70, 100), (20, 23)])
def test_noise_is_the_mean_mask_response_on_uniform_tiles(shape):
    image = np.random.default_rng(6).normal(100.0, 3.0, shape).astype(np.float32)
    tile = min(32, *shape)
    mask = np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0])
    answer = np.abs(correlate(image.astype(np.float64), mask, mode="mirror"))
    rows, columns = shape[0] // tile, shape[1] // tile
    tiles = answer[: rows * tile, : columns * tile].reshape(rows, tile, columns, tile).mean(axis=(1, 3))
    assert image_noise(image) == pytest.approx(np.percentile(tiles, 10.0) / np.sqrt(2.0 / np.pi) / 6.0, rel=1e-5)
    assert image_noise(image) == pytest.approx(3.0, rel=0.2)


def test_the_most_similar_places_are_distinct():
    places = np.array([[5.0, 5.0, 0.1, 0.7], [6.0, 5.0, 0.2, 0.9], [5.5, 5.0, 2.0, 0.5], [30.0, 5.0, 0.1, 0.6],
                       [0.0, 0.0, 0.0, -1.0]])  # fmt: skip
    best = np.empty((4, 4))
    select_distinct_places(np.stack([places, places], 1)[:, 0], 3.0, best)  # a column, as in the search
    assert best[:3].tolist() == [places[1].tolist(), places[3].tolist(), places[2].tolist()]
    assert best[3, 3] == -1.0


def test_rays_are_read_only_within_the_photograph(picture):
    coefficients = spline_coefficients(picture)
    angle, first, step = np.array([0.3, 2.5, 4.0]), 20.0, 0.75
    rays = np.empty((3, 30), np.float32)
    sample_rays(coefficients, 31.0, 29.0, angle, first, step, rays)
    for p in range(3):
        for k in range(30):
            r = first + step * k
            px, py = 31.0 + r * np.cos(angle[p]), 29.0 + r * np.sin(angle[p])
            if 1.0 <= px < 62.0 and 1.0 <= py < 58.0:
                assert rays[p, k] == pytest.approx(value(coefficients, px, py, 3), rel=SINGLE)
            else:
                assert np.isnan(rays[p, k])
    assert np.isnan(rays).any()


def test_a_patch_has_the_statistics_of_its_pixels(picture, patch):
    good, data, inverse, statistics = fill(picture)
    assert good
    assert len(data) == len(patch.f) == len(pixels_within(*CENTRE, REACH))
    assert data[:, 0] == pytest.approx(patch.dx, abs=1e-5)
    assert data[:, 1] == pytest.approx(patch.dy, abs=1e-5)
    assert data[:, 2] == pytest.approx(patch.f, abs=SINGLE)
    assert data[:, 3:] == pytest.approx(patch.descent, abs=SINGLE * np.abs(patch.descent).max())
    assert inverse == pytest.approx(np.linalg.inv(patch.descent.T @ patch.descent), rel=1e-3, abs=1e-6)
    assert statistics == pytest.approx([patch.norm, patch.mean, patch.correlation_length], rel=SINGLE)


def test_a_patch_without_texture_is_none():
    assert not fill(np.full((60, 64), 90.0, np.float32))[0]


@pytest.mark.parametrize(("shift", "angle"), [((0.37, -0.61), 0.05), ((-1.4, 1.1), -0.12)])
def test_a_fit_ends_where_the_plain_one_does(picture, patch, shift, angle):
    image, true = moved(picture, shift, angle)
    image += np.random.default_rng(9).normal(0.0, 2.0, image.shape).astype(np.float32)
    coefficients = quintic_coefficients(image)
    _, data, inverse, _ = fill(picture)
    pose, fit = np.array([*CENTRE, 0.0]), np.zeros(kernels.FIT_COLUMNS)
    fit_rigidly(coefficients, data, inverse, 4.0, 0.0, 1e-3, 40, pose, fit)
    expected, zncc, residual, gain, offset = fit_plainly(coefficients, patch, REACH, np.array([*CENTRE, 0.0]))
    assert fit[kernels.CODE] == kernels.CONVERGED
    # Either stops at steps below a thousandth of a pixel.
    assert pose == pytest.approx(expected, abs=1e-3)
    assert pose == pytest.approx(true, abs=0.05)
    assert fit[kernels.ZNCC] == pytest.approx(zncc, abs=1e-5)
    assert fit[kernels.RESIDUAL] == pytest.approx(residual, rel=0.02)
    assert fit[[kernels.GAIN, kernels.OFFSET]] == pytest.approx([gain, offset], rel=1e-4)
    # With no step allowed it only evaluates.
    still, look = true.copy(), np.zeros(kernels.FIT_COLUMNS)
    fit_rigidly(coefficients, data, inverse, 4.0, 0.0, 1e-3, 0, still, look)
    assert np.array_equal(still, true)
    assert look[kernels.CODE] == kernels.UNFINISHED
    assert look[kernels.ZNCC] > 0.99


def test_a_fit_is_rejected_by_its_limits(picture):
    image, _ = moved(picture, (0.4, 0.2), 0.0)
    coefficients = quintic_coefficients(image)
    _, data, inverse, _ = fill(picture)

    def code(start, *, max_shift=4.0, min_zncc=0.0, limit=40):
        fit = np.zeros(kernels.FIT_COLUMNS)
        fit_rigidly(coefficients, data, inverse, max_shift, min_zncc, 1e-3, limit, np.array([*start, 0.0]), fit)
        return fit[kernels.CODE]

    assert code((11.0, 28.0)) == kernels.LEFT_IMAGE
    assert code(CENTRE, max_shift=0.2) == kernels.DIVERGED
    assert code((CENTRE[0] + 6.0, CENTRE[1] - 5.0), max_shift=50.0, min_zncc=0.99) == kernels.DIVERGED
    assert code(CENTRE, limit=1) == kernels.UNFINISHED
    assert code(CENTRE) == kernels.CONVERGED


def test_a_robust_fit_ends_at_the_fixed_point_of_tukeys_weights(picture, patch):
    image, true = moved(picture, (0.3, -0.2), 0.03)
    image[:, 35:] = 240.0  # a bright cover over a part
    coefficients = quintic_coefficients(image)
    _, data, _, _ = fill(picture)
    pose, fit, covariance = true.copy(), np.zeros(kernels.FIT_COLUMNS), np.zeros((3, 3))
    noise, gain, offset = 1.0, 1.3 * patch.norm, 1.3 * patch.mean - 20.0
    kernels.fit_robust(coefficients, data, REACH, 3.0, noise, gain, offset, 60, pose, fit, covariance)
    assert fit[kernels.CODE] == kernels.CONVERGED
    assert pose == pytest.approx(true, abs=0.05)
    step, spread, a, b, kept, residual = tukey_fixed_point(
        coefficients, patch, pose, fit[kernels.GAIN], fit[kernels.OFFSET], noise
    )
    assert np.abs(step[:2]).sum() + REACH * abs(step[2]) < 0.005  # the convergence criterion of the fit
    assert (a, b) == pytest.approx((fit[kernels.GAIN], fit[kernels.OFFSET]), rel=0.01)
    assert fit[kernels.KEPT] == pytest.approx(kept, abs=0.01)
    assert kept < 0.9
    assert fit[kernels.RESIDUAL] == pytest.approx(residual, rel=0.05)
    assert covariance == pytest.approx(spread, rel=0.06, abs=1e-3 * np.abs(spread).max())


def test_a_robust_fit_rejects_a_fully_covered_patch(picture, patch):
    image = picture.copy()
    image[:, 25:] = np.random.default_rng(3).uniform(0, 255, image[:, 25:].shape)
    _, data, _, _ = fill(picture)
    fit = np.zeros(kernels.FIT_COLUMNS)
    kernels.fit_robust(
        quintic_coefficients(image), data, REACH, 3.0, 1.0, patch.norm, patch.mean, 60, np.array([*CENTRE, 0.0]), fit,
        np.zeros((3, 3)),
    )  # fmt: skip
    assert fit[kernels.CODE] == kernels.DIVERGED
    kernels.fit_robust(
        quintic_coefficients(image), data, REACH, 3.0, 1.0, patch.norm, patch.mean, 60, np.array([9.0, 28.0, 0.0]), fit,
        np.zeros((3, 3)),
    )  # fmt: skip
    assert fit[kernels.CODE] == kernels.LEFT_IMAGE


def test_a_robust_fit_without_a_known_light_diverges(picture, patch):
    _, data, _, _ = fill(picture)
    for light in ((np.nan, patch.mean), (patch.norm, np.nan), (np.inf, patch.mean)):
        fit = np.zeros(kernels.FIT_COLUMNS)
        with np.errstate(invalid="ignore"):  # infinite light, without compilation
            kernels.fit_robust(
                quintic_coefficients(picture), data, REACH, 3.0, 1.0, *light, 60, np.array([*CENTRE, 0.0]), fit,
                np.zeros((3, 3)),
            )  # fmt: skip
        assert fit[kernels.CODE] == kernels.DIVERGED
        assert fit[kernels.ZNCC] == 0.0


@pytest.mark.parametrize("along", [0, 1])
def test_stripes_are_no_texture(picture, along):
    stripes = np.repeat(picture.mean(axis=along, keepdims=True), picture.shape[along], axis=along)
    assert not fill(np.ascontiguousarray(stripes))[0]


@pytest.mark.parametrize(
    ("matrix", "definite"),
    [
        ([[2.0, 1.0], [1.0, 2.0]], True), ([[1.0, 1.0], [1.0, 1.0]], False), ([[1.0, 2.0], [2.0, 1.0]], False),
        ([[np.nan, 0.0], [0.0, 1.0]], False), ([[1.0, 0.0], [0.0, np.inf]], False), ([[0.0, 0.0], [0.0, 1.0]], False),
    ],
)  # fmt: skip
def test_a_matrix_without_an_inverse_is_recognised(matrix, definite):
    assert kernels.is_positive_definite(np.array(matrix)) == definite


def test_the_pixels_of_a_disc_are_ordered_by_quarters():
    x, y, start = disc_offsets(6.3)
    assert sorted(zip(x.tolist(), y.tolist(), strict=True)) == sorted(pixels_within(0.0, 0.0, 6.3))
    quarters = [
        lambda a, b: a >= 0 and b >= 0,
        lambda a, b: a < 0 <= b,
        lambda a, b: a < 0 and b < 0,
        lambda a, b: b < 0 <= a,
    ]
    for q, belongs in enumerate(quarters):
        rows = slice(start[q], start[q + 1])
        assert start[q] < start[q + 1]
        assert all(belongs(a, b) for a, b in zip(x[rows], y[rows], strict=True))


@pytest.mark.parametrize(("search", "parts"), [(search_patch, False), (search_parts, True)])
@pytest.mark.parametrize("angle_window", [0.4, 1.0])
def test_a_search_finds_the_exhaustive_maximum(picture, search, parts, angle_window):
    reach, origin, spacing, window = 5.0, (22.3, 24.6), 3.0, 6.0
    image, _ = moved(picture, (2.0, -1.0), 0.2)
    image[:, 38:] = 250.0
    reference = spline_coefficients(picture)
    angles, sectors = angles_to_try(0.1, reach, angle_window)
    assert np.abs(np.diff(angles)).max() * reach <= 1.2 + 1e-9
    places = [(x, y) for y in range(20, 33) for x in range(25, 38)]
    scores = search_plainly(reference, image, origin, reach, places, angles, parts=parts)
    expected = best_places(scores, places, angles, sectors, spacing, 4)
    best = np.empty((4, 4))
    search(reference, image, *origin, reach, 31.0, 26.0, 0.1, window, angle_window, spacing, best)
    assert best == pytest.approx(np.array(expected), abs=1e-4)


def test_a_search_beyond_the_photograph_finds_nothing(picture):
    best = np.empty((2, 4))
    search_patch(spline_coefficients(picture), picture, 22.0, 24.0, 5.0, -30.0, 24.0, 0.0, 6.0, 0.3, 3.0, best)
    assert best[:, 3].tolist() == [-1.0, -1.0]
