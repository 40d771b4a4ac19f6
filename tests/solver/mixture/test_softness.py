"""Soft grains are told from hard ones whose radii, centres or scale are wrong."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest

from solver.bodies.grains import Grains
from solver.mixture import positions
from solver.mixture.positions import Positions
from solver.mixture.softness import find_overlap
from solver.posterior.settings import PosteriorSettings
from tests.solver.posterior.simulated import SimulatedShear, simulate_shear

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")


@pytest.fixture(scope="module")
def hard() -> SimulatedShear:
    return simulate_shear(0.25, 6)


@pytest.fixture(scope="module")
def soft() -> SimulatedShear:
    return simulate_shear(0.25, 6, normal_stiffness=2e5)


def test_soft_grains_are_found_and_hard_ones_are_not(hard, soft) -> None:
    assert find_overlap(hard.packing, hard.snapshots) == 0.0
    assert find_overlap(soft.packing, soft.snapshots) > 1e-4


@pytest.mark.parametrize("error", ["radii", "all radii alike"])
def test_wrong_radii_of_hard_grains_are_no_softness(hard, error) -> None:
    rng = np.random.default_rng(1)
    radius = hard.packing.grains.radius
    wrong = radius * (1.0 + 0.01 * rng.normal(size=len(radius))) if error == "radii" else radius + 2.5e-4
    packing = replace(hard.packing, grains=Grains.of_rods(wrong, density=2700.0, length=0.06))
    assert find_overlap(packing, hard.snapshots) == 0.0


def test_positions_say_the_same_of_a_frame_whatever_was_asked_before(soft) -> None:
    brief = PosteriorSettings(annealing=20, settling=5, kept=10)
    one, two = (Positions(soft.packing, soft.snapshots, brief) for _ in range(2))
    two.at(4)
    first, second = one.at(2), two.at(2)
    assert first is not None
    assert second is not None
    assert np.array_equal(first.fn, second.fn)


def test_the_first_frame_is_asked_at_length_unless_it_is_asked_again(soft, monkeypatch) -> None:
    brief, kept = PosteriorSettings(annealing=20, settling=5, kept=10), []
    monkeypatch.setattr(positions, "infer_frame", lambda _, settings, *rest: kept.append(settings.kept))
    for first_again in (False, True):
        asked = Positions(soft.packing, soft.snapshots, brief, first_again=first_again)
        asked.at(0)
        asked.at(2)
    assert kept == [brief.alone().kept, brief.kept, brief.kept, brief.kept]
