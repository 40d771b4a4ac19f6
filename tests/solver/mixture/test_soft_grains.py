"""Detection of soft grains, as distinct from hard ones with wrong radii, centres or scale."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.contacts.pairs import split_keys
from rodsight.solver.mixture.soft_grains import (
    FEWEST_PAIRS,
    LEAST_OF_PAIRS,
    find_soft_overlap,
    fraction_of_pairs,
    judge_gaps,
)
from rodsight.solver.posterior.sequence_evidence import gather_position_evidence

from tests.solver.posterior.simulated import NOISE, SimulatedShear, simulate_shear

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")


@pytest.fixture(scope="module")
def hard() -> SimulatedShear:
    return simulate_shear(0.25, 6)


@pytest.fixture(scope="module")
def soft() -> SimulatedShear:
    return simulate_shear(0.25, 6, normal_stiffness=2e5)


@pytest.mark.thorough
def test_soft_grains_are_found_and_hard_ones_are_not(hard, soft) -> None:
    assert find_soft_overlap(hard.packing, hard.snapshots) == 0.0
    assert find_soft_overlap(soft.packing, soft.snapshots) > 1e-4


@pytest.mark.thorough
def test_a_wrong_scale_hides_overlaps_among_gaps_that_scatter(hard, soft) -> None:
    overlap, hidden = judge_gaps(soft.packing, soft.snapshots)
    assert not hidden
    smaller = Grains.of_rods(soft.packing.grains.radius - 0.5 * overlap, density=2700.0, length=0.06)
    assert judge_gaps(replace(soft.packing, grains=smaller), soft.snapshots) == (0.0, True)
    assert judge_gaps(hard.packing, hard.snapshots) == (0.0, False)


def test_overlaps_of_twice_the_noise_are_found() -> None:
    stiffer = simulate_shear(0.25, 6, normal_stiffness=4e6)
    assert find_soft_overlap(stiffer.packing, stiffer.snapshots) == pytest.approx(1.3 * NOISE, rel=0.1)


def test_large_overlaps_that_are_all_alike_are_no_softness(hard) -> None:
    """Errors of the centres make the gaps scatter more than noise, but not as much as forces of that mean overlap."""
    wrong = hard.packing.grains.radius + 1.9 * NOISE
    packing = replace(hard.packing, grains=Grains.of_rods(wrong, density=2700.0, length=0.06))
    error = 1.2 * NOISE * np.random.default_rng(1).standard_normal(hard.snapshots[0].position.shape)
    seen = [replace(each, position=each.position + error) for each in hard.snapshots]
    assert judge_gaps(packing, seen) == (0.0, True)


@pytest.mark.parametrize("error", ["radii", "all radii alike", "a fifth too large"])
def test_wrong_radii_of_hard_grains_are_no_softness(hard, error) -> None:
    rng = np.random.default_rng(1)
    radius = hard.packing.grains.radius
    wrong = {
        "radii": radius * (1.0 + 0.01 * rng.normal(size=len(radius))),
        "all radii alike": radius + 2.5e-4,
        "a fifth too large": radius * (1.0 + 0.02 * (rng.random(len(radius)) < 0.2)),
    }[error]
    packing = replace(hard.packing, grains=Grains.of_rods(wrong, density=2700.0, length=0.06))
    assert find_soft_overlap(packing, hard.snapshots) == 0.0


def test_an_overlap_without_variance_of_its_own_is_no_softness(hard) -> None:
    """The overlap is 2.4 times the standard deviation of the gaps, which is three quarters of the noise."""
    packing = replace(
        hard.packing, grains=Grains.of_rods(hard.packing.grains.radius + 1.2 * NOISE, density=2700.0, length=0.06)
    )
    assert find_soft_overlap(packing, hard.snapshots) == 0.0
    assert judge_gaps(packing, hard.snapshots) == (0.0, False)  # nor is any hidden


def test_overlaps_of_pairs_are_distinguished_from_errors_of_grains(soft) -> None:
    evidence = gather_position_evidence(soft.packing, soft.snapshots)
    assert fraction_of_pairs(evidence) > 1.5 * LEAST_OF_PAIRS
    count = soft.packing.grains.count
    i, j = split_keys(evidence.key, count + len(soft.packing.pressure))
    own = np.append(np.random.default_rng(2).random(count), np.zeros(len(soft.packing.pressure)))
    of_grains = replace(evidence, gap=np.broadcast_to(-own[i] - own[j], evidence.gap.shape))
    assert fraction_of_pairs(of_grains) < 1e-6
    few = replace(evidence, gap=np.where(np.arange(len(i)) < FEWEST_PAIRS, evidence.gap, np.nan))
    assert fraction_of_pairs(few) == 1.0
