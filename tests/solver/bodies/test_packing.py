"""A packing states whether anything known bears on its grains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.packing import Packing

from tests.solver.posterior.test_sequence_evidence import lattice_sequence


@pytest.fixture(scope="module")
def bare() -> Packing:
    """Neither load nor weight."""
    packing, _ = lattice_sequence(0.0)
    return replace(
        packing,
        pressure=np.full(len(packing.pressure), np.nan),
        material=replace(packing.material, gravity=(0.0, 0.0)),
    )


def with_boundary(packing: Packing) -> Packing:
    boundary = np.zeros(len(packing.grains.radius), np.bool_)
    boundary[0] = True
    return replace(packing, grains=replace(packing.grains, boundary=boundary))


def test_without_load_and_weight_nothing_bears_on_the_grains(bare: Packing) -> None:
    assert not bare.is_loaded


def test_a_load_on_one_wall_is_enough(bare: Packing) -> None:
    pressure = bare.pressure.copy()
    pressure[0] = 5e4
    assert replace(bare, pressure=pressure).is_loaded
    assert with_boundary(replace(bare, pressure=pressure)).is_loaded


def test_weight_is_enough_unless_boundary_grains_carry_it(bare: Packing) -> None:
    heavy = replace(bare, material=replace(bare.material, gravity=(0.0, -9.81)))
    assert heavy.is_loaded
    assert not with_boundary(heavy).is_loaded


def test_a_light_load_changes_the_stress_of_a_heavy_packing_little() -> None:
    packing, snapshots = lattice_sequence(0.0)  # the third wall is loaded, the ratio of forces that of its loads
    one, two = (replace(snapshots[0], load=np.array([np.nan, np.nan, load, np.nan])) for load in (30.0, 10.0))
    assert packing.load_ratio(one, two) == pytest.approx(3.0)
    heavy = replace(packing, material=replace(packing.material, gravity=(0.0, -9.81)))
    weight = 0.5 * float(packing.grains.mass.sum()) * 9.81
    assert heavy.load_ratio(one, two) == pytest.approx((30.0 + weight) / (10.0 + weight))
    assert replace(packing, pressure=np.full(4, np.nan)).load_ratio(one, two) == 1.0
