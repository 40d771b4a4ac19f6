import numpy as np
import pytest

from solver.bodies.near_discs import find_near_discs


def all_pairs(place: np.ndarray, radius: np.ndarray, threshold: float) -> set[tuple[int, int]]:
    """Every pair looked at by itself."""
    apart = np.linalg.norm(place[:, None] - place[None], axis=2) - radius[:, None] - radius[None]
    i, j = np.nonzero(np.triu(apart < threshold, 1))
    return set(zip(i.tolist(), j.tolist(), strict=True))


@pytest.mark.parametrize("threshold", [-0.5, 0.0, 0.3, 4.0])
@pytest.mark.parametrize("shape", ["square", "strip", "a few far away", "in one place but one"])
def test_every_pair_is_found_once_and_none_that_is_farther(shape: str, threshold: float) -> None:
    rng = np.random.default_rng(1)
    place, radius = rng.uniform(0.0, 30.0, (300, 2)), rng.uniform(0.5, 1.0, 300)
    if shape == "strip":
        place[:, 1] *= 0.02
    elif shape == "a few far away":
        place[:2] += [[1e6, 0.0], [-1e4, 1e9]]
        place[2] = place[0] + 1.0
    elif shape == "in one place but one":
        place[1:] = place[1] + 1e-3 * rng.normal(0.0, 1.0, (299, 2))
    found = find_near_discs(place, radius, threshold)
    assert np.all(found[:, 0] < found[:, 1])
    assert len(found) == len(np.unique(found, axis=0))
    assert {(int(i), int(j)) for i, j in found} == all_pairs(place, radius, threshold)


def test_one_far_disc_costs_nothing() -> None:
    place = np.random.default_rng(0).uniform(0.0, 300.0, (40_000, 2))
    place[0] = 1e12
    assert len(find_near_discs(place, np.full(40_000, 0.5), 0.01)) < 100_000


def test_no_pair_without_two_discs_or_with_a_threshold_below_all_gaps() -> None:
    for count, threshold in ((0, 1.0), (1, 1.0), (5, -3.0)):
        assert find_near_discs(np.zeros((count, 2)), np.ones(count), threshold).shape == (0, 2)


def test_a_place_that_is_no_number_is_refused() -> None:
    with pytest.raises(ValueError, match="not finite"):
        find_near_discs(np.array([[0.0, 0.0], [np.nan, 1.0]]), np.ones(2), 0.1)
