"""Wrong rotations, recognised by those that rolling among the neighbours leads to expect."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.diagnosis.rotation_tests import SPAN_SIGMAS, _deformation, _span, examine_rotations

from .test_direct_tests import FRAMES, NOISE, PITCH, SIDE, STEP, N, box, rolling_tracks


def with_rolling(factor, step=STEP):
    """The same with the rotations that rolling without noise leads to expect, times a factor."""
    from rodsight.solver.inferred.unknown_rotations import fill_unknown_rotations

    tracks, exact, walls = rolling_tracks(step), rolling_tracks(step, 0.0), box()
    unknown = np.full_like(tracks.rotation, np.nan)
    expected = fill_unknown_rotations(
        exact.radius, exact.position, unknown, exact.present, walls.endpoints, side=walls.side, cell=None
    )
    return replace(tracks, rotation=factor * expected)


@pytest.mark.parametrize(
    ("factor", "cause"), [(1.0, None), (-1.0, "rotation_sign"), (57.3, "rotation_in_degrees"), (0.0, "rotation_zero")]
)
def test_wrong_rotations_are_recognised(factor, cause):
    found = examine_rotations(with_rolling(factor), box())
    assert [each.cause for each in found] == ([] if cause is None else [cause])


def test_rotations_that_noise_hides_from_one_photograph_to_the_next_are_compared_over_several():
    small = 3.0 * NOISE / PITCH
    assert [each.cause for each in examine_rotations(with_rolling(-1.0, small), box())] == ["rotation_sign"]
    assert examine_rotations(with_rolling(1.0, small), box()) == []


def test_a_step_leads_over_the_fewest_photographs_that_move_the_rods_enough():
    moved = _deformation(rolling_tracks(1.0, 0.0), 1)
    for span in (1, 2, 4):
        assert _span(rolling_tracks(1.05 * SPAN_SIGMAS * NOISE / (span * moved))) == span
    most = FRAMES - 1
    assert _span(rolling_tracks(0.5 * SPAN_SIGMAS * NOISE / (most * moved))) == most


@pytest.mark.parametrize(("factor", "cause"), [(1.0, None), (-1.0, "rotation_sign"), (57.3, "rotation_in_degrees")])
def test_rods_that_turn_with_the_packing_show_wrong_rotations(factor, cause):
    tracks = rolling_tracks(0.0)
    angle = 0.01 * np.arange(FRAMES)
    turn = np.moveaxis(np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]), 2, 0)
    noise = 1e-3 * np.random.default_rng(1).normal(size=(FRAMES, N))
    turned = replace(tracks, position=tracks.position @ turn, rotation=factor * (angle[:, None] + noise))
    found = examine_rotations(turned, box())
    assert [each.cause for each in found] == ([] if cause is None else [cause])


def test_unknown_and_unrelated_rotations_give_no_finding():
    tracks = rolling_tracks()
    assert examine_rotations(replace(tracks, rotation=np.full((FRAMES, N), np.nan)), box()) == []
    random = np.random.default_rng(5).normal(size=(FRAMES, N))
    usual = float(np.median(np.abs(np.diff(with_rolling(1.0).rotation, axis=0))))
    assert examine_rotations(replace(tracks, rotation=10.0 * usual * random), box()) == []
    (found,) = examine_rotations(replace(tracks, rotation=1e3 * usual * random), box())
    assert found.cause == "rotation_in_degrees"
    assert found.evidence.endswith("without relation to it")


@pytest.mark.parametrize(("factor", "cause"), [(1.0, None), (57.3, "rotation_in_degrees")])
def test_rods_that_turn_like_gears_are_not_given_in_degrees(factor, cause):
    """Alternate rotations of a square lattice slide nowhere, whatever their size."""
    tracks, small = rolling_tracks(), with_rolling(1.0)
    row, column = np.divmod(np.arange(N), SIDE)
    usual = float(np.median(np.abs(np.diff(small.rotation, axis=0))))
    gears = 40.0 * usual * np.where((row + column) % 2, 1.0, -1.0) * np.arange(FRAMES)[:, None]
    found = examine_rotations(replace(tracks, rotation=factor * (small.rotation + gears)), box())
    assert [each.cause for each in found] == ([] if cause is None else [cause])
