"""Friction of the base: its drag, and the coefficient that trial solutions find."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.diagnosis.base_friction import BaseFrictionError, coefficient_of, measure_base_friction
from rodsight.inference.snapshots import make_snapshots
from rodsight.solver.bodies.rods import RodMaterial

from .test_diagnose import INPUTS


def test_the_base_drags_every_rod_against_its_motion():
    material = RodMaterial(base_friction=2.0)
    packing = material.pack(INPUTS.tracks.radius, INPUTS.walls.pressure)
    snapshots = make_snapshots(INPUTS.tracks, INPUTS.walls)
    dragged = packing.at_frame(snapshots, 3)
    moved = snapshots[3].position - snapshots[2].position
    size = np.linalg.norm(moved, axis=1)
    fast = size > 10 * snapshots[3].sigma
    assert fast.sum() >= 20
    expected = -2.0 * 9.81 * packing.grains.mass[:, None] * moved / size[:, None]
    assert dragged.weight[fast] == pytest.approx(expected[fast], rel=0.05)
    assert RodMaterial().pack(INPUTS.tracks.radius, INPUTS.walls.pressure).at_frame(snapshots, 3).grains.drag is None


@pytest.mark.parametrize("true", [0.0, 0.07, 0.3])
def test_the_coefficient_with_the_highest_score_is_found(true):
    best = coefficient_of(INPUTS, true)
    found = measure_base_friction(INPUTS, lambda inputs: -((inputs.material.base_friction - best) ** 2))
    assert found.material.base_friction == pytest.approx(best, abs=1e-6)
    assert not found.material.base_friction_measured


def test_without_a_load_it_is_undetermined():
    free = replace(INPUTS, walls=replace(INPUTS.walls, pressure=np.full(2, np.nan)))
    with pytest.raises(BaseFrictionError, match="known load"):
        measure_base_friction(free, lambda _: 0.0)
