"""Which contacts slide: what the probability must do, whatever its constants."""

from dataclasses import replace

import numpy as np
import pytest

from solver.contacts.contacts import ContactState
from solver.statistics.sliding import SlidingSigns, cone_share, contact_state, slides_at, sliding_probability


def _signs(count: int, **how) -> SlidingSigns:
    """Of hard grains without weight that move, none seen to slide, no member on the cone."""
    none = np.zeros(count)
    return replace(SlidingSigns(np.zeros((count, 2)), none, none, none, 0.0, soft=False), **how)


def test_what_its_members_see_on_the_cone_slides():
    mobilised = np.array([0.2, 0.95, 0.95, 0.95])
    share = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    seen = np.full(4, 20.0)
    found = sliding_probability(mobilised, _signs(4, cone_share=share))
    assert found[0] < 0.05
    assert np.all(np.diff(found) > 0)
    assert sliding_probability(mobilised, _signs(4, cone_share=share, slip=seen, reach=0.1 * seen))[3] > 0.7
    assert sliding_probability(np.array([1.0, 1.6]), _signs(2))[1] == sliding_probability(np.ones(1), _signs(1))[0]


def test_what_is_seen_to_slide_against_its_force_slides_more_likely_than_what_slides_along_it():
    slip = np.array([0.0, 1.0, 8.0, -8.0])
    still, noise, against, along = sliding_probability(np.full(4, 0.9), _signs(4, slip=slip, reach=np.abs(slip) / 8))
    assert along > 1.5 * still
    assert against > 1.3 * along
    assert noise < 1.2 * still


def test_what_leapt_in_the_interval_may_have_come_to_rest_since():
    slip = np.array([8.0, 60.0])
    seen, leapt = sliding_probability(np.full(2, 0.9), _signs(2, slip=slip, reach=np.ones(2)))
    assert 0.3 * seen < leapt < 0.8 * seen


def test_what_is_heavy_comes_to_rest_off_the_cone():
    mobilised = np.full(2, 0.9)
    for borne in (None, 0.4):
        light, heavy = sliding_probability(mobilised, _signs(2, weight=np.array([0.0, 0.3]), borne=borne))
        assert heavy < 0.4 * light


def test_positions_hide_what_slides_above_all_where_grains_are_soft():
    mobilised = np.array([0.6])
    motion, hard, soft = (
        sliding_probability(mobilised, _signs(1, positions_share=share, soft=soft))[0]
        for share, soft in ((0.0, False), (1.0, False), (1.0, True))
    )
    assert motion < hard < soft


def test_in_a_fresh_packing_nothing_slides_yet_whatever_slides_afterwards():
    slip, mobilised = np.full(1, 30.0), np.array([0.9])
    share = np.ones((1, 2))
    later, fresh, sheared = (
        sliding_probability(mobilised, _signs(1, cone_share=share, slip=slip, reach=slip / 10, borne=borne))[0]
        for borne in (None, 0.14, 0.4)
    )
    assert fresh < 0.1 < 0.3 < sheared < later


def test_a_chain_slides_where_its_own_force_is_on_the_cone():
    found = sliding_probability(np.array([0.1, 0.8, 1.0, 1.3]), None)
    assert found[0] < 0.05
    assert found[2] > 0.5 > found[1]
    assert found[3] == found[2]


def test_what_more_likely_slides_than_not_is_said_to_and_what_bears_nothing_is_open():
    state = contact_state(np.array([1.0, 1.0, 0.0]), np.array([0.4, 0.6, 0.9]))
    assert state.tolist() == [ContactState.STICKING, ContactState.SLIDING, ContactState.OPEN]


def test_of_a_friction_told_too_high_more_contacts_slide_than_was_found():
    found = np.array([0.0, 0.2, 0.8, 1.0])
    assert (slides_at(found, 0.4, 0.25) > found).tolist() == [False, True, True, False]
    assert slides_at(found, 0.25, 0.25) == pytest.approx(found)
    assert slides_at(found, 0.4, 0.25, 0.0) == pytest.approx(found)  # positions alone


def test_shares_are_counted_by_the_kind_of_member():
    convex = np.array([False, True, True])
    fn = np.array([[1.0, 1.0], [1.0, 0.0], [2.0, 1.0]])
    ft = np.array([[0.25, 0.1], [-0.25, 0.0], [0.1, 0.25]])
    assert cone_share(fn, ft, np.array([0.25, 0.25]), convex) == pytest.approx(np.array([[0.5, 1.0], [0.5, 0.0]]))
    assert not cone_share(fn[:1], ft[:1], np.array([0.25, 0.25]), convex[:1])[:, 0].any()
