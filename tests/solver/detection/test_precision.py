import numpy as np
import pytest

from solver.bodies.grains import Grains
from solver.bodies.motion import Snapshot
from solver.detection.precision import Precision, believed_precision, measure_precision, with_precision

R, SIDE = 0.01, 20
WITHIN = 0.1  # relative, of a standard deviation from some thousand gaps
SIGMA = 1e-5  # [m]


def touching(sigma: float, overlap: float, frames: int = 6) -> tuple[Grains, list[Snapshot]]:
    """A square lattice of rods whose rows overlap by exponentially distributed amounts, measured with noise."""
    rng = np.random.default_rng(5)
    step = 2 * R - rng.exponential(overlap / np.sqrt(2.0), SIDE) if overlap else np.full(SIDE, 2 * R)
    x = np.cumsum(step)
    start = np.stack(np.meshgrid(x, 2.001 * R * np.arange(SIDE) + 0.05), axis=-1).reshape(-1, 2)
    n = SIDE**2
    endpoints = np.array([[[0.0, 0.0], [1.0, 0.0]]])
    snapshots = [
        Snapshot(30.0 * f, start + rng.normal(scale=sigma, size=(n, 2)), np.zeros(n), np.ones(n, bool), endpoints, 1e-5)
        for f in range(frames)
    ]
    return Grains.of_rods(np.full(n, R), density=2700.0, length=0.06), snapshots


@pytest.mark.parametrize("sigma", [2e-6, 1e-5, 4e-5])
def test_noise_is_read_off_gaps_whatever_is_stated(sigma: float):
    found = measure_precision(*touching(sigma, 0.0))
    assert found is not None
    assert found.sigma == pytest.approx(sigma, rel=WITHIN)


def test_overlap_is_told_from_noise():
    found = measure_precision(*touching(SIGMA, 5e-5))
    assert found is not None
    assert found.sigma == pytest.approx(SIGMA, rel=WITHIN)
    assert 3e-5 < found.overlap < 8e-5


def test_too_few_gaps_tell_nothing():
    grains, snapshots = touching(SIGMA, 0.0)
    assert measure_precision(grains, snapshots[:2]) is None
    few = [Snapshot(s.time, s.position, s.rotation, np.arange(SIDE**2) < 5, s.endpoints, s.sigma) for s in snapshots]
    assert measure_precision(grains, few) is None


def test_what_is_stated_stands_unless_it_is_contradicted():
    assert believed_precision(Precision(1.2e-5, 5e-6, 1000), [1e-5], 5e-6) == (1.0, pytest.approx(5e-6))
    factor, overlap = believed_precision(Precision(2e-5, 4e-5, 1000), [1e-5], 5e-6)
    assert factor == pytest.approx(2.0)
    assert 3e-5 < overlap < 4e-5
    assert [s.sigma for s in with_precision(touching(SIGMA, 0.0)[1], factor)] == [2e-5] * 6


def test_noise_alone_makes_no_overlap():
    found = measure_precision(*touching(4e-5, 0.0))
    assert found is not None
    # Half-normal gaps of three photographs have an rms of √(2/3) σ, which is the noise and nothing else.
    assert found.overlap < 0.3 * 4e-5


def test_a_precision_stated_too_low_is_contradicted_as_one_too_high():
    assert believed_precision(Precision(5e-6, 0.0, 1000), [1e-5], 0.0)[0] == pytest.approx(0.5)
    assert believed_precision(Precision(0.8e-5, 0.0, 1000), [1e-5], 0.0)[0] == 1.0
