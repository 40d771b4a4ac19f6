import numpy as np
import pytest
from rodsight.solver.bodies.disc_pairs import find_disc_pairs


def all_pairs(position: np.ndarray, radius: np.ndarray, threshold: float) -> set[tuple[int, int]]:
    """All pairs by brute force."""
    apart = np.linalg.norm(position[:, None] - position[None], axis=2) - radius[:, None] - radius[None]
    i, j = np.nonzero(np.triu(apart < threshold, 1))
    return set(zip(i.tolist(), j.tolist(), strict=True))


@pytest.mark.parametrize("threshold", [-0.5, 0.0, 0.3, 4.0])
@pytest.mark.parametrize("shape", ["square", "strip", "a few distant ones", "all but one in one position"])
def test_every_pair_below_the_threshold_is_found_once(shape: str, threshold: float) -> None:
    rng = np.random.default_rng(1)
    position, radius = rng.uniform(0.0, 30.0, (300, 2)), rng.uniform(0.5, 1.0, 300)
    if shape == "strip":
        position[:, 1] *= 0.02
    elif shape == "a few distant ones":
        position[:2] += [[1e6, 0.0], [-1e4, 1e9]]
        position[2] = position[0] + 1.0
    elif shape == "all but one in one position":
        position[1:] = position[1] + 1e-3 * rng.normal(0.0, 1.0, (299, 2))
    found = find_disc_pairs(position, radius, threshold)
    assert np.all(found[:, 0] < found[:, 1])
    assert len(found) == len(np.unique(found, axis=0))
    assert {(int(i), int(j)) for i, j in found} == all_pairs(position, radius, threshold)


def test_one_distant_disc_does_not_enlarge_the_search() -> None:
    position = np.random.default_rng(0).uniform(0.0, 300.0, (40_000, 2))
    position[0] = 1e12
    assert len(find_disc_pairs(position, np.full(40_000, 0.5), 0.01)) < 100_000


def test_no_pair_without_two_discs_or_with_a_threshold_below_all_gaps() -> None:
    for count, threshold in ((0, 1.0), (1, 1.0), (5, -3.0)):
        assert find_disc_pairs(np.zeros((count, 2)), np.ones(count), threshold).shape == (0, 2)


def test_position_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="not finite"):
        find_disc_pairs(np.array([[0.0, 0.0], [np.nan, 1.0]]), np.ones(2), 0.1)
