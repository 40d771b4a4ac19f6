"""Errors of hard rods that hardly move are found by their forces."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from rodsight.inference.correction import hard_grain_errors as module
from rodsight.inference.correction.hard_grain_errors import (
    FITS,
    PASSES,
    correct_hard_grains,
    errors_by_forces,
    size_of_errors,
    without_own_corrections,
)
from rodsight.inference.infer_sequence import infer_sequence
from rodsight.inference.snapshots import measure_sequence
from rodsight.solver.calibration.equations import rotate_offsets
from rodsight.solver.calibration.grain_errors import GrainErrors
from rodsight.solver.frame_forces import FrameStatus

from tests.app.inference.scenarios import Solved, agreement, solve

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")


@pytest.fixture(scope="module")
def wrong_centres(tmp_path_factory: pytest.TempPathFactory) -> Solved:
    return solve(tmp_path_factory.mktemp("scenario"), "centres", 5, grains=70)


@pytest.fixture
def uncertain(wrong_centres, monkeypatch):
    """Sequences of which frames are solved beforehand; their forces are expected to be as good as `expected`."""
    solved = []

    def expect(expected: float, status: FrameStatus = FrameStatus.SETTLED):
        def solve_first(sequence, count):
            solved.append(sequence)
            return [replace(each, expected_correlation=expected, status=status) for each in wrong_centres.frames]

        monkeypatch.setattr(module, "solve_first", solve_first)
        return solved

    return expect


def test_errors_are_found_anew_where_the_motion_shows_little(wrong_centres, uncertain):
    solved = uncertain(FITS - 0.01)
    sequence = wrong_centres.sequence
    found = correct_hard_grains(sequence)
    assert len(solved) == PASSES
    assert solved[0] is sequence
    assert solved[1] is not sequence  # repeated with better forces
    assert found.calibration is not None
    assert found.settings.centres_by_forces
    assert "µm rms) were found again by the forces of the first photographs" in found.remark
    # Its own corrections are those of its tracks, so that the first frame takes them back.
    restored = without_own_corrections(found.tracks, found.walls, found.calibration)
    before = without_own_corrections(sequence.tracks, sequence.walls, sequence.calibration)
    np.testing.assert_allclose(restored.position, before.position, atol=1e-12)
    np.testing.assert_allclose(restored.radius, before.radius, atol=1e-12)
    change = np.abs(found.calibration.offset - sequence.calibration.offset)
    assert change.max() > 1e-6
    assert 0.0 < found.calibration.offset_sd.max() < 1e-4
    np.testing.assert_array_equal(found.packing.grains.radius, found.tracks.radius)


def test_the_errors_are_the_mean_over_the_passes_and_the_calibration(wrong_centres, uncertain, monkeypatch):
    uncertain(FITS - 0.01)
    sequence = wrong_centres.sequence
    n, number = sequence.packing.grains.count, iter((1.0, 3.0, 5.0, 7.0))

    def find(measured, frames, size):
        return GrainErrors(np.full((n, 2), 1e-6 * next(number)), np.zeros(n), 0.0, np.zeros((5, 3 * n)))

    monkeypatch.setattr(module, "errors_by_forces", find)
    found = correct_hard_grains(sequence)
    np.testing.assert_allclose(found.calibration.offset, (sequence.calibration.offset + 16e-6) / (PASSES + 1))


def test_errors_of_radii_are_left_to_calibration(wrong_centres, uncertain, monkeypatch):
    solved = uncertain(FITS - 0.01)
    monkeypatch.setattr(module, "size_of_errors", lambda evidence: (1e-5, 1e-5))
    assert correct_hard_grains(wrong_centres.sequence) is wrong_centres.sequence
    assert solved == []


@pytest.mark.parametrize(
    ("expected", "status"), [(FITS + 0.01, FrameStatus.SETTLED), (FITS - 0.01, FrameStatus.SUSPECT)]
)
def test_errors_stay_where_the_motion_confirms_forces_or_contradicts_them(wrong_centres, uncertain, expected, status):
    uncertain(expected, status)
    assert correct_hard_grains(wrong_centres.sequence) is wrong_centres.sequence


@pytest.mark.parametrize("change", [{"soft": True}, {"positions": "never"}])
def test_nothing_is_solved_for_soft_rods_or_without_positions(wrong_centres, uncertain, change):
    solved = uncertain(0.1)
    sequence = wrong_centres.sequence
    other = replace(sequence, settings=replace(sequence.settings, **change))
    assert correct_hard_grains(other) is other
    other = replace(sequence, calibration=None)
    assert correct_hard_grains(other) is other
    assert solved == []


def test_one_frame_does_not_determine_errors(wrong_centres):
    measured = measure_sequence(wrong_centres.sequence.tracks, wrong_centres.sequence.walls)
    frames = [replace(each, status=FrameStatus.SETTLED) for each in wrong_centres.frames]
    assert errors_by_forces(measured, frames[1:2], (1e-5, 0.0)) is None
    found = errors_by_forces(measured, frames[1:3], (1e-5, 0.0))
    assert found is not None
    assert not found.radius.any()


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "rise"), [("rising_centres", 0.03), ("stepped_centres", 0.0)])
def test_forces_of_rods_at_rest_become_more_accurate(tmp_path, scenario, rise, monkeypatch):
    solved = solve(tmp_path, scenario, 43, grains=150)
    after = infer_sequence(solved.inputs)
    monkeypatch.setattr("rodsight.inference.infer_sequence.correct_hard_grains", lambda sequence, progress: sequence)
    before = infer_sequence(solved.inputs)
    r = np.array([[agreement(each, solved.true[each.frame]) for each in some.frames] for some in (before, after)])
    assert r[1].mean() > r[0].mean() + rise


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
