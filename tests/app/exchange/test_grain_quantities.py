"""Quantities of single grains: the stress of the packing is the mean of its grains', motion is that of the tracks."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.exchange.grain_quantities import GRAIN_COLUMNS, measure_grains

LAST = 4


@pytest.fixture(scope="module")
def measured(results):
    shape = (results.tracks.frame_count, results.tracks.grain_count)
    return {name: column.reshape(shape) for name, column in measure_grains(results).items()}


def test_stresses_weighted_with_volumes_are_the_stress_of_the_packing(results, measured):
    statistics, area = results.statistics[LAST], np.pi * results.tracks.radius**2
    for a, row in enumerate("xy"):
        for b, column in enumerate("xy"):
            mean = np.sum(measured[f"stress_{row}{column}"][LAST] * area) / statistics.area
            # Branch vectors end at measured centres and points, arms at R n: they differ by gaps.
            assert mean == pytest.approx(statistics.stress[a, b], abs=2e-3 * statistics.pressure)


def test_coordination_numbers_add_up_to_twice_the_bearing_contacts_between_grains(results, measured):
    forces = results.frames[LAST]
    bears = np.where(forces.contacts.with_wall, 1.0, 2.0) @ forces.bearing_probability
    assert measured["coordination_number"][LAST].sum() == pytest.approx(bears)


def test_motion_is_since_the_frame_before(results, measured):
    tracks = results.tracks
    np.testing.assert_array_equal(measured["displacement_y"][2], tracks.position[2, :, 1] - tracks.position[1, :, 1])
    np.testing.assert_array_equal(measured["rotation"][3], tracks.rotation[3] - tracks.rotation[2])
    for name in ("displacement_x", "rotation", "strain_xy", "D2min"):
        assert np.isnan(measured[name][0]).all()
        assert np.isfinite(measured[name][1:]).all()


def test_lost_grains_have_neither_motion_nor_stress(with_a_loss):
    rows = {name: column.reshape(5, 40)[2, 3] for name, column in measure_grains(with_a_loss).items()}
    assert set(rows) == set(GRAIN_COLUMNS)
    assert np.isnan(list(rows.values())).all()
