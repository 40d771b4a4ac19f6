import numpy as np
import pytest

from solver.detection.band_inverse import band_inverse

EXACT = 1e-12  # relative, of a well-conditioned matrix


def banded(n: int, band: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A positive definite matrix, and its lower band."""
    rng = np.random.default_rng(seed)
    half = np.tril(rng.normal(size=(n, n))) * (np.subtract.outer(np.arange(n), np.arange(n)) <= band)
    matrix = half @ half.T + np.eye(n)
    lower = np.zeros((band + 1, n))
    for d in range(band + 1):
        lower[d, : n - d] = np.diag(matrix, -d)
    return matrix, lower


@pytest.mark.parametrize(("n", "band"), [(1, 0), (5, 0), (6, 5), (40, 7)])
def test_within_the_band_it_is_the_whole_inverse(n: int, band: int):
    matrix, lower = banded(n, band, seed=n)
    whole = np.linalg.inv(matrix)
    _, found = band_inverse(lower)
    for d in range(band + 1):
        np.testing.assert_allclose(found[: n - d, d], np.diag(whole, -d), rtol=0, atol=EXACT * np.abs(whole).max())


def test_an_indefinite_matrix_is_refused():
    with pytest.raises(np.linalg.LinAlgError):
        band_inverse(np.array([[1.0, -1.0], [0.0, 0.0]]))
