import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.motion import Snapshot
from rodsight.solver.detection.precision import Precision, corrected_precision, measure_precision, scale_precision

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
def test_noise_is_measured_whatever_precision_is_stated(sigma: float):
    found = measure_precision(*touching(sigma, 0.0))
    assert found is not None
    assert found.sigma == pytest.approx(sigma, rel=WITHIN)


def test_overlap_is_separated_from_noise():
    found = measure_precision(*touching(SIGMA, 5e-5))
    assert found is not None
    assert found.sigma == pytest.approx(SIGMA, rel=WITHIN)
    assert 3e-5 < found.overlap < 8e-5


def test_too_few_gaps_give_no_precision():
    grains, snapshots = touching(SIGMA, 0.0)
    assert measure_precision(grains, snapshots[:2]) is None
    few = [Snapshot(s.time, s.position, s.rotation, np.arange(SIDE**2) < 5, s.endpoints, s.sigma) for s in snapshots]
    assert measure_precision(grains, few) is None


def test_stated_precision_is_kept_unless_contradicted():
    assert corrected_precision(Precision(1.2e-5, 5e-6, 1000), [1e-5], 5e-6) == (1.0, pytest.approx(5e-6))
    factor, overlap = corrected_precision(Precision(2e-5, 4e-5, 1000), [1e-5], 5e-6)
    assert factor == pytest.approx(2.0)
    assert 3e-5 < overlap < 4e-5
    assert [s.sigma for s in scale_precision(touching(SIGMA, 0.0)[1], factor)] == [2e-5] * 6


def test_noise_alone_gives_no_overlap():
    found = measure_precision(*touching(4e-5, 0.0))
    assert found is not None
    # Half-normal mean gaps of three photographs have an rms of √(2/3) σ, by noise alone.
    assert found.overlap < 0.3 * 4e-5


def test_contradiction_is_found_in_both_directions():
    assert corrected_precision(Precision(5e-6, 0.0, 1000), [1e-5], 0.0)[0] == pytest.approx(0.5)
    assert corrected_precision(Precision(0.8e-5, 0.0, 1000), [1e-5], 0.0)[0] == 1.0


def test_gaps_that_never_vary_as_in_interpolated_photographs_give_no_precision():
    grains, snapshots = touching(0.0, 5e-5)
    assert measure_precision(grains, snapshots) is None
