"""Edges and rims against plain fits."""

import numpy as np
import pytest
from rodsight.tracking.detection.circles.edges import centre_variance, find_steepest
from rodsight.tracking.detection.circles.rim_profile import locate_edges, write_normal
from rodsight.tracking.detection.discs import find_highest, measure_distances
from rodsight.tracking.detection.rings import without_overlap
from rodsight.tracking.short_sort import median, select
from scipy.ndimage import distance_transform_edt, maximum_filter
from scipy.optimize import least_squares
from scipy.stats import norm

from tests.reference.twins.circles import fitted_circle
from tests.reference.twins.edges import apart, circle_step, rim, rim_misfit, sandwich_variance, steepest

pytestmark = pytest.mark.unit

CONVERGED = 2e-4  # [px] a fit ends at steps below a ten-thousandth
SERIES = 1e-11  # error of the normal distribution's series within a node of its table
LIMIT = 2e-9  # rest of the distribution beyond the end of its table
SAME = 5e-3  # [px] Gauss-Newton ends at steps below a thousandth


def edge_points(seed=3):
    """Points of a circle with noise, a tenth of them on a neighbour instead."""
    rng = np.random.default_rng(seed)
    angle = np.arange(0.0, 2.0 * np.pi, 1.0 / 24.0)
    ex, ey, radius = 0.6, -0.4, 24.5
    along = ex * np.cos(angle) + ey * np.sin(angle)
    across = ex * np.sin(angle) - ey * np.cos(angle)
    distance = along + np.sqrt(radius**2 - across**2) + rng.normal(0, 0.05, len(angle))
    distance[10:25] += rng.uniform(0.8, 2.0, 15)
    return angle, distance, rng.uniform(0.5, 2.0, len(angle)), (ex, ey, radius)


@pytest.mark.parametrize("scatter", [np.inf, 0.05])
def test_a_fitted_circle_is_a_fixed_point_of_the_plain_step(scatter):
    angle, distance, weight, (ex, ey, radius) = edge_points()
    found = fitted_circle((0.0, 0.0, 24.3), angle, distance, weight, radius_sd=scatter, min_scale=0.02)
    shift = np.array([found.x, found.y, found.radius - 24.3])
    step, residual, weights = circle_step(angle, distance, weight, 24.3, shift, scatter, 0.02)
    assert np.abs(step).max() < CONVERGED
    assert found.residual == pytest.approx(residual, abs=2 * CONVERGED)
    assert (weights[10:25] == 0.0).mean() > 0.8  # points on the neighbour have no weight
    assert [found.x, found.y] == pytest.approx([ex, ey], abs=0.05)
    if np.isinf(scatter):
        assert found.radius == pytest.approx(radius, abs=0.05)
    else:
        assert 24.3 < found.radius < radius  # the prior limits it
    assert 0.003 < found.sigma < 0.03


def test_a_rim_fit_is_the_plain_one():
    rng = np.random.default_rng(5)
    first, step, width, expected_dark = 14.0, 0.25, 0.8, 25.0
    r = first + step * np.arange(60)
    edges, slopes = rng.uniform(22.6, 23.4, 6), rng.uniform(-4.0, 4.0, 6)
    rays = np.stack([expected_dark + rim(r, e, 140.0, c, width) for e, c in zip(edges, slopes, strict=True)])
    rays = (rays + rng.normal(0, 0.5, rays.shape)).astype(np.float32)
    rays[5] = expected_dark + 1.0  # uniformly dark
    start = edges + rng.uniform(-0.3, 0.3, 6)
    start[4] = np.nan
    angle = np.linspace(0.0, 5.0, 6)
    edge, level, misfit, dark = locate_edges(rays, (first, step), start, angle, width, extent=width, rounds=1)
    assert np.isnan(edge).tolist() == [False] * 4 + [True] * 2
    for p in range(4):
        assert dark[p] == pytest.approx(rays[p][(r > start[p] + 1.0) & (r <= start[p] + 2.4)].min(), abs=1.0)
        end = r[np.argmin(np.where((r >= start[p] + 1.0) & (r <= start[p] + 2.4 + step / 2), rays[p], np.inf))]
        # The fit extends from 1.2 px inside the rough edge to 3 px outside, or to the start of the dark level.
        chosen = (r >= start[p] - 1.2 - 1e-9) & (r <= min(start[p] + 3.0, end) + 1e-9)
        plain = least_squares(
            lambda v, p=p, c=chosen: rim_misfit(rays[p][c], r[c], v, dark[p], width, 0.0, 0.75, step, level[p]),
            [start[p], 140.0, 0.0], xtol=1e-12, ftol=1e-12,
        )  # fmt: skip
        assert edge[p] == pytest.approx(plain.x[0], abs=SAME)
        assert level[p] == pytest.approx(plain.x[1], rel=5e-3)
        rest = rays[p][chosen] - dark[p] - rim(r[chosen], *plain.x, width)
        assert misfit[p] == pytest.approx(np.sqrt(np.mean(rest**2)), rel=0.05)
        assert edge[p] == pytest.approx(edges[p], abs=0.1)


@pytest.mark.parametrize("narrow", [False, True])
def test_the_steepest_descent_of_a_ray_is_the_plain_one(narrow):
    rng = np.random.default_rng(8)
    first, radius, window = 14.0, 19.0, 2.5
    r = first + 0.25 * np.arange(45)
    edge = np.array([18.2, 20.1, 19.0, 30.0, 18.7])
    rays = 40.0 + 120.0 / (1.0 + np.exp((r - edge[:, None]) / 0.4)) + rng.normal(0.0, 1.0, (5, len(r)))
    rays[3] = 100.0 + r  # rises all the way
    rays = rays.astype(np.float32)
    rays[4, 40] = np.nan  # leaves the photograph
    edges, in_view = np.empty((5, 3)), np.empty(5, np.bool_)
    find_steepest(rays, first, radius, window, narrow, edges, in_view)
    assert in_view.tolist() == [True] * 4 + [False]
    for p in range(3):
        assert edges[p] == pytest.approx(steepest(rays[p].astype(float), first, radius, window, narrow), rel=1e-4)
    assert np.isnan(edges[3:, 0]).all()
    assert edges[3:, 1].tolist() == [0.0, 0.0]


def test_circles_remove_later_ones_that_overlap_them():
    rng = np.random.default_rng(9)
    x, y, radius = rng.uniform(0.0, 60.0, 150), rng.uniform(5.0, 40.0, 150), rng.uniform(1.0, 7.0, 150)
    kept = without_overlap(x, y, radius, allowed=0.2)
    assert kept.tolist() == apart(x, y, radius, 0.2)
    assert 10 < len(kept) < 100
    assert without_overlap(x[:0], y[:0], radius[:0], allowed=0.2).tolist() == []


@pytest.mark.parametrize("scatter", [np.inf, 0.1])
def test_the_variance_of_a_centre_is_that_of_the_scores(scatter):
    rng = np.random.default_rng(10)
    radius, angle = 20.0, np.linspace(0.0, 6.2, 60)
    stretch = (angle * radius / 8.0).astype(int)
    w = rng.uniform(0.1, 1.0, 60)
    w[(stretch == 2) | (stretch == 9)] = 0.0
    score, root = rng.normal(size=(stretch.max() + 1, 3)), rng.normal(size=(3, 3))
    inverse = root @ root.T
    expected = sandwich_variance(score, np.bincount(stretch, w), inverse, 0.07, scatter)
    assert centre_variance(angle, radius, w, score, inverse, 0.07, scatter) == pytest.approx(expected, rel=1e-12)


def test_the_tabulated_normal_distribution_is_the_plain_one():
    t = np.concatenate([np.linspace(-5.99, 5.99, 4001), [-np.inf, -1e9, -6.1, 6.1, 1e9, np.inf]])
    cumulative, density = np.empty(len(t)), np.empty(len(t))
    write_normal(t, cumulative, density)
    assert cumulative[:4001] == pytest.approx(norm.cdf(t[:4001]), abs=SERIES)
    assert density[:4001] == pytest.approx(norm.pdf(t[:4001]), abs=SERIES)
    assert cumulative[4001:] == pytest.approx([0.0] * 3 + [1.0] * 3, abs=LIMIT)
    assert density[4001:] == pytest.approx(0.0, abs=10.0 * LIMIT)


def test_distances_to_the_dark_are_the_plain_ones():
    rng = np.random.default_rng(12)
    bright = (rng.uniform(size=(60, 90)) < 0.995).astype(np.uint8)
    bright[:, :30] = 1  # columns without any dark
    centres = (bright * (rng.uniform(size=bright.shape) < 0.3)).astype(np.uint8)
    distance = np.zeros(bright.shape, np.float32)
    measure_distances(bright, centres, np.empty(bright.shape, np.int32), distance)
    expected = np.where(centres > 0, distance_transform_edt(bright), 0.0).astype(np.float32)
    assert distance.tolist() == expected.tolist()
    measure_distances(np.ones_like(bright), centres, np.empty(bright.shape, np.int32), distance)
    assert np.isinf(distance[centres > 0]).all()


def test_the_highest_pixels_are_the_plain_ones():
    rng = np.random.default_rng(13)
    distance = rng.integers(0, 12, (40, 50)).astype(np.float32)  # many equal ones
    expected = np.argwhere((distance == maximum_filter(distance, 3)) & (distance >= 8.0))
    places = np.empty((len(expected), 2), np.intp)
    assert find_highest(distance, np.float32(8.0), places) == len(expected)
    assert places.tolist() == expected.tolist()
    assert find_highest(distance, np.float32(8.0), places[:5]) == len(expected)


@pytest.mark.parametrize("count", [1, 2, 3, 10, 61])
def test_selected_values_are_those_of_the_sorted_ones(count):
    rng = np.random.default_rng(count)
    for values in (rng.normal(size=count), rng.integers(0, 4, count).astype(np.float64), np.arange(count, dtype=float)):
        assert median(values) == np.median(values)
        for place in range(count):
            work = values.copy()
            assert select(work, place) == np.sort(values)[place]
            assert (work[:place] <= work[place]).all()
            assert (work[place:] >= work[place]).all()
