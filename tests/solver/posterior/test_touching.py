import numpy as np
import pytest

from solver.posterior.touching import LEAST_SHARE, fit_touching

REACH = 10.0


def gaps_of(share: float, frames: int = 4, pairs: int = 1500, slope: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Touching about −0.5 with scatter 0.7, or open anywhere beyond; one trait of unit variance."""
    rng = np.random.default_rng(5)
    trait = rng.normal(0.0, 1.0, (pairs, 1))
    opened = np.where(rng.random((frames, pairs)) < share, 0.0, rng.uniform(0.0, REACH, (frames, pairs)))
    gap = -0.5 + slope * trait[:, 0] + opened + rng.normal(0.0, 0.7, (frames, pairs))
    return np.where(gap < REACH, gap, np.nan), trait


@pytest.mark.parametrize("share", [0.5, 0.8])
def test_mean_scatter_and_share_of_touching_gaps_are_found(share: float) -> None:
    gap, trait = gaps_of(share, slope=0.4)
    found = fit_touching(gap, trait, REACH, narrow=0.3)
    assert found.offset == pytest.approx(-0.5, abs=0.06)
    assert found.slope[0] == pytest.approx(0.4, abs=0.06)
    assert found.deviation == pytest.approx(0.7, rel=0.06)
    np.testing.assert_allclose(found.share, share, atol=0.06)


def test_every_frame_of_many_has_its_own_share() -> None:
    less, trait = gaps_of(0.5, frames=10, slope=0.4)
    more, _ = gaps_of(0.8, frames=10, slope=0.4)
    found = fit_touching(np.concatenate([less, more]), trait, REACH, narrow=0.3)
    np.testing.assert_allclose(found.share, np.repeat([0.5, 0.8], 10), atol=0.07)
    assert found.slope[0] == pytest.approx(0.4, abs=0.04)


def test_the_share_that_touches_has_a_floor() -> None:
    gap, trait = gaps_of(0.15)
    assert fit_touching(gap, trait, REACH, narrow=0.3).share.min() == LEAST_SHARE


def test_far_gaps_do_not_touch_and_unknown_ones_are_said_not_to() -> None:
    gap, trait = gaps_of(0.7)
    gap[0, :3] = -0.5, 6.0, np.nan
    touch = fit_touching(gap, trait, REACH, narrow=0.3).probability(gap, trait, REACH)
    assert touch[0, 0] > 0.9
    assert touch[0, 1] < 1e-6
    assert touch[0, 2] == 0.0


def test_nothing_near_is_an_error() -> None:
    with pytest.raises(ValueError, match="no pair of bodies"):
        fit_touching(np.full((2, 3), np.nan), np.zeros((3, 1)), REACH, 1.0)
