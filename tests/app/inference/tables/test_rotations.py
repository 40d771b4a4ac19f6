"""Wrong rotations, recognised by those that rolling among the neighbours leads to expect."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.correction.tables.rotations import (
    CORRECTIONS,
    SPAN_SIGMAS,
    _deformation,
    _Sliding,
    _span,
    correct_rotations,
)

from ..diagnosis.test_direct_tests import FRAMES, NOISE, PITCH, SIDE, STEP, N, box, rolling_tracks

DEGREE = np.rad2deg(1.0)


def with_rolling(factor, step=STEP):
    """The same with the rotations that rolling without noise leads to expect, times a factor."""
    from rodsight.solver.inferred.unknown_rotations import fill_unknown_rotations

    tracks, exact, walls = rolling_tracks(step), rolling_tracks(step, 0.0), box()
    unknown = np.full_like(tracks.rotation, np.nan)
    expected = fill_unknown_rotations(
        exact.radius, exact.position, unknown, exact.present, walls.endpoints, side=walls.side, cell=None
    )
    return replace(tracks, rotation=factor * expected)


def causes(tracks):
    """What is found wrong with the rotations, and corrected."""
    _, found = correct_rotations(tracks, box())
    assert all(each.corrected for each in found)
    return [each.cause for each in found]


@pytest.mark.parametrize(
    ("factor", "named"),
    [
        (1.0, []),
        (-1.0, ["rotation_sign"]),
        (DEGREE, ["rotation_in_degrees"]),
        (-DEGREE, ["rotation_sign", "rotation_in_degrees"]),
    ],
)
def test_wrong_rotations_are_recognised_and_corrected(factor, named):
    stated, true = with_rolling(factor), with_rolling(1.0)
    corrected, found = correct_rotations(stated, box())
    assert [each.cause for each in found] == named
    np.testing.assert_allclose(corrected.rotation, true.rotation, rtol=1e-12)
    assert [each.describe() for each in found] == [
        f"rotations were taken to be {CORRECTIONS[each.cause][1]}, since {each.evidence}" for each in found
    ]


def test_rotations_that_are_zero_in_every_photograph_are_unknown():
    corrected, (found,) = correct_rotations(with_rolling(0.0), box())
    assert found.cause == "rotation_zero"
    assert np.isnan(corrected.rotation).all()


def test_rotations_with_which_neighbours_slide_no_less_are_named_but_not_corrected(monkeypatch):
    one = np.ones(1)
    assert _Sliding(one, -one).name("rotation_sign", "").corrected
    assert not _Sliding(one, one).name("rotation_sign", "").corrected
    assert not _Sliding(np.empty(0), np.empty(0)).name("rotation_sign", "").corrected
    monkeypatch.setattr(_Sliding, "ratio", lambda sliding, cause: 1.0)
    stated = with_rolling(-1.0)
    corrected, (found,) = correct_rotations(stated, box())
    assert found.cause == "rotation_sign"
    assert found.describe() == ""
    assert corrected is stated


def test_rotations_that_noise_hides_from_one_photograph_to_the_next_are_compared_over_several():
    small = 3.0 * NOISE / PITCH
    assert causes(with_rolling(-1.0, small)) == ["rotation_sign"]
    assert causes(with_rolling(1.0, small)) == []


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
    assert causes(turned) == ([] if cause is None else [cause])


def test_unknown_and_unrelated_rotations_give_no_finding():
    tracks = rolling_tracks()
    assert causes(replace(tracks, rotation=np.full((FRAMES, N), np.nan))) == []
    random = np.random.default_rng(5).normal(size=(FRAMES, N))
    usual = float(np.median(np.abs(np.diff(with_rolling(1.0).rotation, axis=0))))
    assert causes(replace(tracks, rotation=10.0 * usual * random)) == []
    _, (found,) = correct_rotations(replace(tracks, rotation=1e3 * usual * random), box())
    assert found.cause == "rotation_in_degrees"
    assert found.evidence.endswith("without relation to it")


@pytest.mark.parametrize(("factor", "cause"), [(1.0, None), (57.3, "rotation_in_degrees")])
def test_rods_that_turn_like_gears_are_not_given_in_degrees(factor, cause):
    """Alternate rotations of a square lattice slide nowhere, whatever their size."""
    tracks, small = rolling_tracks(), with_rolling(1.0)
    row, column = np.divmod(np.arange(N), SIDE)
    usual = float(np.median(np.abs(np.diff(small.rotation, axis=0))))
    gears = 40.0 * usual * np.where((row + column) % 2, 1.0, -1.0) * np.arange(FRAMES)[:, None]
    assert causes(replace(tracks, rotation=factor * (small.rotation + gears))) == ([] if cause is None else [cause])
