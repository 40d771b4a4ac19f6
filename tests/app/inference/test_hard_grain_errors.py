"""Errors of hard rods that hardly move are found by their forces."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from rodsight.inference.correction import hard_grain_errors as module
from rodsight.inference.correction.errors_by_forces import without_own_corrections
from rodsight.inference.correction.hard_grain_errors import FITS, PASSES, correct_hard_grains
from rodsight.inference.infer_sequence import infer_sequence
from rodsight.inference.solve_frames import Beginning
from rodsight.solver.calibration.grain_errors import GrainErrors
from rodsight.solver.frame_forces import FrameStatus

from tests.app.inference.scenarios import agreement, solve

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")


@pytest.fixture
def uncertain(wrong_centres, monkeypatch):
    """Sequences of which frames are solved beforehand; their forces are expected to be as good as `expected`."""
    solved = []

    def expect(expected: float, status: FrameStatus = FrameStatus.SETTLED):
        def solve_first(sequence, count):
            solved.append(sequence)
            return [replace(each, expected_correlation=expected, status=status) for each in wrong_centres.frames]

        def solve_beginning(sequence, count, observer):
            return Beginning(tuple(SimpleNamespace(forces=each) for each in solve_first(sequence, count)), iter(()))

        monkeypatch.setattr(module, "solve_first", solve_first)
        monkeypatch.setattr(module, "solve_beginning", solve_beginning)
        return solved

    return expect


def test_errors_are_found_anew_where_the_motion_shows_little(wrong_centres, uncertain):
    solved = uncertain(FITS - 0.01)
    sequence = wrong_centres.sequence
    found, beginning = correct_hard_grains(sequence)
    assert beginning is None  # it is that of another sequence
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
        return GrainErrors(np.full((n, 2), 1e-6 * next(number)), np.zeros(n), 0.0, np.zeros((5, 3 * n))), 1.0

    monkeypatch.setattr(module, "find_errors", find)
    found, _ = correct_hard_grains(sequence)
    np.testing.assert_allclose(found.calibration.offset, (sequence.calibration.offset + 16e-6) / (PASSES + 1))


def test_errors_of_radii_are_left_to_calibration(wrong_centres, uncertain, monkeypatch):
    solved = uncertain(FITS - 0.01)
    monkeypatch.setattr(module, "size_of_errors", lambda evidence: (1e-5, 1e-5))
    assert correct_hard_grains(wrong_centres.sequence)[0] is wrong_centres.sequence
    assert solved == []


@pytest.mark.parametrize(
    ("expected", "status"), [(FITS + 0.01, FrameStatus.SETTLED), (FITS - 0.01, FrameStatus.SUSPECT)]
)
def test_errors_stay_where_the_motion_confirms_forces_or_contradicts_them(wrong_centres, uncertain, expected, status):
    uncertain(expected, status)
    sequence, beginning = correct_hard_grains(wrong_centres.sequence)
    assert sequence is wrong_centres.sequence
    assert beginning is not None
    assert len(beginning.frames) == len(wrong_centres.frames)


def test_frames_of_many_rods_are_not_kept(wrong_centres, uncertain, monkeypatch):
    solved = uncertain(FITS + 0.01)
    monkeypatch.setattr(module, "MOST_POSES", 12 * wrong_centres.sequence.tracks.grain_count - 1)
    assert correct_hard_grains(wrong_centres.sequence) == (wrong_centres.sequence, None)
    assert len(solved) == 1


@pytest.mark.parametrize("change", [{"soft": True}, {"positions": "never"}])
def test_nothing_is_solved_for_soft_rods_or_without_positions(wrong_centres, uncertain, change):
    solved = uncertain(0.1)
    sequence = wrong_centres.sequence
    other = replace(sequence, settings=replace(sequence.settings, **change))
    assert correct_hard_grains(other) == (other, None)
    other = replace(sequence, calibration=None)
    assert correct_hard_grains(other) == (other, None)
    assert solved == []


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "rise"), [("rising_centres", 0.03), ("stepped_centres", 0.0)])
def test_forces_of_rods_at_rest_become_more_accurate(tmp_path, scenario, rise, monkeypatch):
    solved = solve(tmp_path, scenario, 43, grains=150)
    after = infer_sequence(solved.inputs)
    unchanged = "rodsight.inference.infer_sequence.correct_hard_grains"
    monkeypatch.setattr(unchanged, lambda sequence, observer: (sequence, None))
    before = infer_sequence(solved.inputs)
    r = np.array([[agreement(each, solved.true[each.frame]) for each in some.frames] for some in (before, after)])
    assert r[1].mean() > r[0].mean() + rise
