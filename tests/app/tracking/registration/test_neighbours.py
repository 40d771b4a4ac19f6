"""Local motion of neighbours against a plain fit, and overlapping pairs."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.tracking.registration.neighbour_kernels import find_nearest
from rodsight.tracking.registration.neighbours import local_motion, nearby_median, overlaps

pytestmark = pytest.mark.unit


@pytest.fixture
def positions() -> np.ndarray:
    """Forty grains (n, 2) [px] at random places."""
    return np.random.default_rng(3).uniform(0.0, 300.0, (40, 2))


def shear(positions: np.ndarray) -> np.ndarray:
    """Displacements (n, 2) [px] of an affine motion."""
    return np.array([4.0, -2.0]) + positions @ np.array([[0.02, 0.01], [-0.03, 0.015]])


def plain_local_motion(
    known: np.ndarray, displacement: np.ndarray, query: np.ndarray, left_out: int | None
) -> tuple[np.ndarray, float]:
    """Predict one displacement by a weighted least-squares fit, and the median deviation of the neighbours."""
    distance = np.linalg.norm(known - query, axis=1)
    if left_out is not None:
        distance[left_out] = np.inf
    nearest = np.argsort(distance)[:12]
    median = np.median(displacement[nearest], axis=0)
    deviation = np.linalg.norm(displacement[nearest] - median, axis=1)
    farthest = distance[nearest].max()
    weight = np.exp(-2.0 * (distance[nearest] / farthest) ** 2)
    weight[deviation >= 4.0 * np.median(deviation) + 0.25] = 0.0
    design = np.column_stack([np.ones(12), (known[nearest] - query) / farthest])
    root = np.sqrt(weight)[:, None]
    # Two rows without data regularise the gradient: a weight of 0.01 each.
    rows = np.vstack([root * design, [[0.0, 0.1, 0.0], [0.0, 0.0, 0.1]]])
    values = np.vstack([root * (displacement[nearest] - median), np.zeros((2, 2))])
    solution = np.linalg.lstsq(rows, values, rcond=None)[0]
    misfit = displacement[nearest] - median - design @ solution
    return median + solution[0], float(np.median(np.linalg.norm(misfit, axis=1)))


@pytest.mark.parametrize("exclude_self", [False, True])
def test_local_motion_is_the_plain_weighted_affine_fit(positions: np.ndarray, exclude_self: bool) -> None:
    rng = np.random.default_rng(5)
    displacement = shear(positions) + rng.normal(0.0, 0.3, positions.shape)
    displacement[::7] += 15.0  # outliers
    query = positions if exclude_self else rng.uniform(0.0, 300.0, (20, 2))
    predicted, median_deviation = local_motion(positions, displacement, query, exclude_self=exclude_self)
    for k, place in enumerate(query):
        expected, deviation = plain_local_motion(positions, displacement, place, k if exclude_self else None)
        assert predicted[k] == pytest.approx(expected, abs=1e-6)
        assert median_deviation[k] == pytest.approx(deviation, abs=1e-6)


def test_small_deviations_from_a_common_displacement_have_weight(positions: np.ndarray) -> None:
    displacement = np.tile([2.0, 1.0], (len(positions), 1))
    displacement[::3, 0] += 0.2  # most of the twelve neighbours have no deviation: their median one is zero
    query = np.random.default_rng(8).uniform(0.0, 300.0, (20, 2))
    predicted, median_deviation = local_motion(positions, displacement, query, exclude_self=False)
    for k, place in enumerate(query):
        expected, deviation = plain_local_motion(positions, displacement, place, None)
        assert predicted[k] == pytest.approx(expected, abs=1e-6)
        assert median_deviation[k] == pytest.approx(deviation, abs=1e-6)


def test_a_gradient_is_extrapolated_beyond_the_neighbours(positions: np.ndarray) -> None:
    corner = np.array([[-20.0, -20.0]])
    predicted, _ = local_motion(positions, shear(positions), corner, exclude_self=False)
    nearest = np.argsort(np.linalg.norm(positions - corner, axis=1))[:12]
    median_error = np.linalg.norm(np.median(shear(positions)[nearest], axis=0) - shear(corner)[0])
    assert np.linalg.norm(predicted[0] - shear(corner)[0]) < 0.2 * median_error


def test_a_grain_has_no_weight_in_its_own_prediction(positions: np.ndarray) -> None:
    displacement = np.tile([2.0, 1.0], (len(positions), 1))
    displacement[7] = [30.0, -20.0]
    predicted, median_deviation = local_motion(positions, displacement, positions, exclude_self=True)
    assert predicted == pytest.approx(np.tile([2.0, 1.0], (len(positions), 1)), abs=1e-9)
    assert median_deviation == pytest.approx(0.0, abs=1e-9)


def test_few_neighbours_give_their_median() -> None:
    known = np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]])
    displacement = np.array([[1.0, 0.0], [2.0, 0.0], [9.0, 3.0]])
    predicted, median_deviation = local_motion(known, displacement, np.array([[40.0, 40.0]]), exclude_self=False)
    assert predicted.tolist() == [[2.0, 0.0]]
    assert median_deviation.tolist() == [1.0]


@pytest.mark.parametrize(("count", "exclude_self"), [(0, False), (1, True)])
def test_without_neighbours_the_motion_is_unknown(count: int, exclude_self: bool) -> None:
    known = np.zeros((count, 2))
    query = known if exclude_self else np.zeros((1, 2))
    predicted, median_deviation = local_motion(known, known, query, exclude_self=exclude_self)
    assert np.isnan(predicted).all()
    assert np.isnan(median_deviation).all()


@pytest.mark.parametrize(("width", "height"), [(300.0, 200.0), (2000.0, 3.0), (0.0, 500.0), (0.0, 0.0)])
@pytest.mark.parametrize(("count", "wanted"), [(40, 12), (300, 5), (7, 7), (1, 1)])
def test_the_nearest_are_found_in_their_order(width: float, height: float, count: int, wanted: int) -> None:
    rng = np.random.default_rng(4)
    known = rng.uniform(0.0, 1.0, (count, 2)) * [width, height]
    # Places among the grains, beside them and far away.
    query = np.concatenate([known, known[:1] + rng.normal(0.0, 400.0, (60, 2))])
    index, distance = np.empty((len(query), wanted), np.intp), np.empty((len(query), wanted))
    find_nearest(known, query, index, distance)
    all_distances = np.linalg.norm(known[None] - query[:, None], axis=2)
    assert distance == pytest.approx(np.sort(all_distances, axis=1)[:, :wanted], abs=1e-9)
    assert np.take_along_axis(all_distances, index, 1) == pytest.approx(distance, abs=1e-9)
    assert all(len(set(row)) == wanted for row in index.tolist())


def test_neighbours_of_unknown_places_are_an_error() -> None:
    known = np.zeros((3, 2))
    with pytest.raises(ValueError, match="finite"):
        nearby_median(known, np.ones(3), np.array([[np.nan, 0.0]]), 1)


def test_a_nearby_median_is_of_the_nearest_alone() -> None:
    known = np.array([[float(k), 0.0] for k in range(8)])
    value = np.array([1.0, 5.0, 2.0, 50.0, 60.0, 70.0, 80.0, 90.0])
    assert nearby_median(known, value, np.array([[0.0, 0.0], [7.0, 0.0]]), 3).tolist() == [2.0, 80.0]
    assert np.isnan(nearby_median(known[:0], value[:0], known)).all()


def test_pairs_overlap_by_more_than_a_fraction_of_the_smaller_radius() -> None:
    radius = np.array([20.0, 10.0])
    allowed = 0.2  # 2 px here
    for distance, expected in ((28.1, []), (27.9, [[0, 1]])):
        assert overlaps(np.array([[0.0, 0.0], [distance, 0.0]]), radius, allowed).tolist() == expected
    assert overlaps(np.zeros((1, 2)), radius[:1], allowed).shape == (0, 2)
