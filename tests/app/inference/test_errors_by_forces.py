"""Errors of single rods are found by forces of solved photographs, and taken back."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from rodsight.inference.correction.errors_by_forces import find_errors, size_of_errors, without_own_corrections
from rodsight.inference.snapshots import measure_sequence
from rodsight.solver.calibration.equations import rotate_offsets
from rodsight.solver.frame_forces import FrameStatus

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")


def test_one_frame_does_not_determine_errors(wrong_centres):
    measured = measure_sequence(wrong_centres.sequence.tracks, wrong_centres.sequence.walls)
    frames = [replace(each, status=FrameStatus.SETTLED) for each in wrong_centres.frames]
    assert find_errors(measured, frames[1:2], (1e-5, 0.0)) is None
    found = find_errors(measured, frames[1:3], (1e-5, 0.0))
    assert found is not None
    errors, force = found
    assert not errors.radius.any()
    assert force > 0.0


def test_own_corrections_of_grains_are_taken_back_and_shared_ones_stay(wrong_centres):
    sequence, given = wrong_centres.sequence, wrong_centres.inputs.tracks
    calibration = sequence.calibration
    assert calibration is not None
    own = 1e-5 * np.random.default_rng(2).normal(size=given.grain_count)
    moved = np.stack([own, 2.0 * own[::-1]], axis=1)
    measured = measure_sequence(sequence.tracks, sequence.walls)
    corrected = replace(
        sequence.tracks,
        radius=sequence.tracks.radius + own,
        position=sequence.tracks.position + rotate_offsets(measured, moved),
    )
    other = replace(calibration, radius=calibration.radius + own, offset=calibration.offset + moved)
    found = without_own_corrections(corrected, sequence.walls, other)
    before = without_own_corrections(sequence.tracks, sequence.walls, calibration)
    np.testing.assert_allclose(found.radius, before.radius, atol=1e-12)
    np.testing.assert_allclose(found.position, before.position, atol=1e-12)
    np.testing.assert_allclose(found.radius, given.radius + calibration.shared_radius(given.radius), atol=1e-9)


@pytest.mark.parametrize(
    ("centre_sd", "radius_sd", "expected"), [(3e-5, 2e-5, (8e-10**0.5, 2e-5)), (1e-5, 4e-6, (0.0, 0.0))]
)
def test_errors_that_noise_hides_are_left(centre_sd, radius_sd, expected):
    evidence = SimpleNamespace(
        noise=SimpleNamespace(sigma=1e-5), centre_sd=np.array([0.0, centre_sd, 1.0]), radius_sd=radius_sd
    )
    assert size_of_errors(evidence) == pytest.approx(expected)
