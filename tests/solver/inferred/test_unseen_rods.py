"""Inference of rods that were removed from a packing."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.bodies.grains import Array
from rodsight.solver.inferred import unseen_rods
from rodsight.solver.inferred.surroundings import Surroundings, gaps
from rodsight.solver.inferred.unseen_rods import UnseenRods, UnseenRodSettings, infer_unseen

from tests.golden.forces import NOISE, STORED

pytestmark = pytest.mark.unit

GONE = (11, 36, 50)  # none of them a rattler


@pytest.fixture(scope="module")
def poses() -> dict[str, np.ndarray]:
    """A simulated shear of 60 rods in 4 photographs."""
    with np.load(STORED) as stored:
        return {name.removeprefix("poses/"): stored[name] for name in stored.files if name.startswith("poses/")}


def infer(poses: dict[str, np.ndarray], gone: tuple[int, ...], sizes: Array | None, overlap: float = 0.0) -> UnseenRods:
    seen = np.setdiff1d(np.arange(len(poses["radius"])), gone)
    position = poses["position"][:, seen]
    return infer_unseen(
        poses["radius"][seen], position, np.isfinite(position).all(axis=2), poses["endpoints"],
        UnseenRodSettings(NOISE, sizes, overlap),
    )  # fmt: skip


def test_removed_rods_are_inferred(poses) -> None:
    found = infer(poses, GONE, np.unique(poses["radius"]))
    true = poses["position"][:, list(GONE)]
    for q, rod in enumerate(GONE):
        away = np.linalg.norm(found.position - true[:, None, q], axis=2).max(axis=0)
        best = int(np.argmin(away))
        assert away[best] < 0.05 * poses["radius"][rod]
        assert found.radius[best] == pytest.approx(poses["radius"][rod], rel=0.01)
        assert np.all(found.sigma[:, best] < 4 * NOISE)


@pytest.mark.parametrize("gone", [(10, 11), (25, 32), (32, 40)])
def test_two_removed_rods_that_hold_each_other_are_inferred(poses, monkeypatch, gone) -> None:
    sizes = np.unique(poses["radius"])
    found = infer(poses, gone, sizes)
    assert found.count == 2
    for rod in gone:
        away = np.linalg.norm(found.position - poses["position"][:, None, rod], axis=2).max(axis=0)
        assert away.min() < 0.05 * poses["radius"][rod]
    monkeypatch.setattr(unseen_rods, "_select_pair", lambda *_: [])
    assert infer(poses, gone, sizes).count == 0


def test_removed_rods_of_unknown_size_are_inferred(poses) -> None:
    found = infer(poses, GONE, None)
    true = poses["position"][:, list(GONE)]
    for q, rod in enumerate(GONE):
        away = np.linalg.norm(found.position - true[:, None, q], axis=2).max(axis=0)
        best = int(np.argmin(away))
        assert away[best] < 0.05 * poses["radius"][rod]
        assert found.radius[best] == pytest.approx(poses["radius"][rod], rel=0.005)
    assert infer(poses, (), None).count == 0


@pytest.mark.slow
@pytest.mark.parametrize("mean", [2e-4, 1e-4], ids=["all alike", "twice the mean"])
def test_removed_soft_rods_are_inferred_with_a_known_overlap(poses, mean) -> None:
    overlap = 2e-4
    soft = poses | {"radius": poses["radius"] + 0.5 * overlap}
    sizes = np.unique(soft["radius"])
    found = infer(soft, GONE, sizes, mean)
    true = poses["position"][:, list(GONE)]
    for q, rod in enumerate(GONE):
        away = np.linalg.norm(found.position - true[:, None, q], axis=2).max(axis=0)
        best = int(np.argmin(away))
        assert away[best] < 0.05 * soft["radius"][rod]
        assert found.radius[best] == pytest.approx(soft["radius"][rod], rel=0.01)
    assert infer(soft, GONE, sizes).count < len(GONE)
    assert infer(soft, (), sizes, mean).count == 0


def test_no_rod_is_inferred_where_none_is_missing(poses) -> None:
    assert infer(poses, (), np.unique(poses["radius"])).count == 0


def test_an_inferred_rod_overlaps_nothing(poses) -> None:
    found = infer(poses, GONE, np.unique(poses["radius"]))
    seen = np.setdiff1d(np.arange(len(poses["radius"])), GONE)
    for k, position in enumerate(poses["position"][:, seen]):
        apart = np.linalg.norm(position[None] - found.position[k][:, None], axis=2)
        gap = apart - poses["radius"][seen][None] - found.radius[:, None]
        assert np.nanmin(gap) > -10 * NOISE


def test_two_photographs_are_not_enough(poses) -> None:
    short = {name: values[:2] if name in ("position", "endpoints") else values for name, values in poses.items()}
    assert infer(short, GONE, np.unique(poses["radius"])).count == 0


def ring(
    closing: float,
    touching: int = 6,
    turning: float = 0.0,
    moving: float = 0.0,
    frames: int = 4,
    *,
    known: bool = True,
    wandering: float = 0.0,
    free: bool = True,
) -> UnseenRods:
    """Infer rods inside a ring of six around a hole of their size, one of which moves inward after two frames.

    touching: of the six, the others are too far out; turning [rad], moving (along the ring, of a radius): per frame;
    known: their size; wandering [m]: of those that touch, outward and inward in turn; free: not of the boundary.
    """
    r = 8e-3
    angle = np.pi / 3 * np.array([0, 2, 4, 1, 3, 5])
    around = 2 * r * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    far = np.array([[0.05, 0.05], [-0.05, 0.05], [-0.05, -0.05], [0.05, -0.05]])
    position = np.tile(np.concatenate([around, far]), (frames, 1, 1))
    position[2:, 0] *= 1.0 - closing
    position[:, touching:6] *= 1.05
    position[1::2, :touching] *= 1.0 + wandering / (2.0 * r)
    for k in range(frames):
        turned = np.array([k * turning, k * turning + k * moving / 2.0])  # the rod 0 along the ring
        for rods, by in ((slice(0, 10), turned[0]), (slice(0, 1), turned[1] - turned[0])):
            c, s = np.cos(by), np.sin(by)
            position[k, rods] = position[k, rods] @ np.array([[c, s], [-s, c]])
    side = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
    walls = np.tile(np.stack([side, np.roll(side, -1, axis=0)], axis=1), (frames, 1, 1, 1))
    return infer_unseen(
        np.full(10, r), position, np.ones((frames, 10), bool), walls,
        UnseenRodSettings(NOISE, np.array([r]) if known else None, boundary=np.full(10, not free)),
    )  # fmt: skip


def test_hole_that_other_rods_enter_holds_no_rod() -> None:
    held = ring(closing=0.0)
    assert held.count == 1
    assert held.position == pytest.approx(0.0, abs=1e-6)
    # six gaps in all directions, and its motion relative to its neighbours, a tenth of its radius
    assert held.sigma == pytest.approx(1.0 / np.sqrt(3.0 / NOISE**2 + 1.0 / 8e-4**2), rel=1e-3)
    assert ring(closing=0.1).count == 0


def test_contacts_that_stay_the_same_count_once() -> None:
    """Three touch by chance in a packing that only turns; where it rearranges, a rod holds them apart."""
    assert ring(closing=0.0, touching=3, frames=6).count == 0
    assert ring(closing=0.0, touching=3, turning=0.05, frames=6).count == 0
    assert ring(closing=0.0, touching=3, moving=-0.02, frames=6).count == 1
    assert ring(closing=0.0, touching=4, turning=0.05, frames=6).count == 1  # held by two beyond any two


def test_a_pore_whose_bodies_leave_gaps_of_several_standard_deviations_is_no_rod(monkeypatch) -> None:
    def found(wandering: float) -> int:
        return ring(closing=0.0, touching=3, moving=-0.03, frames=8, wandering=wandering * NOISE).count

    assert [found(0.0), found(1.0), found(2.0)] == [1, 1, 0]
    monkeypatch.setattr(unseen_rods, "GAP_MISFIT", 3.0)
    assert found(2.0) == 1


def test_a_size_that_is_unknown_is_that_on_which_bodies_agree_while_they_rearrange(monkeypatch) -> None:
    assert ring(closing=0.0, touching=3, moving=-0.03, frames=8, known=False).count == 1
    assert ring(closing=0.0, touching=3, turning=0.05, frames=8, known=False).count == 0
    assert ring(closing=0.0, touching=3, moving=-0.03, frames=8, known=False, wandering=2.0 * NOISE).count == 1
    monkeypatch.setattr(unseen_rods, "SIZE_MISFIT", 0.5)  # an amplitude of one standard deviation is more
    assert ring(closing=0.0, touching=3, moving=-0.03, frames=8, known=False, wandering=2.0 * NOISE).count == 0


def test_circles_of_unknown_size_touch_three_bodies_and_overlap_none() -> None:
    around = box(np.array([[-0.02, 0.0], [0.02, 0.0], [0.0, 0.02], [0.0, -0.015], [0.06, 0.06]]))
    found = sorted(around.find_circles(0, (4e-3, 1.05e-2), 1e-6, None), key=lambda each: each[0][0])
    x = 2.5e-3  # of circles that touch one at the side, and those above and below
    assert [size for _, size in found] == pytest.approx([np.hypot(x, 0.0175) - 0.01] * 2)
    assert np.array([at for at, _ in found]) == pytest.approx(np.array([[-x, x], [x, x]]))
    assert around.find_circles(0, (4e-3, 7e-3), 1e-6, None) == []
    assert around.find_circles(0, (4e-3, 9e-3), 1e-6, np.array([[0.09, 0.09]])) == []


def test_a_size_is_fitted_to_the_bodies_that_touch() -> None:
    angle = np.radians([0.0, 120.0, 240.0])
    around = box(0.018 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    size, weight = around.fit_size(np.array([2e-5, 0.0]), 0, 7.95e-3, 1e-4)
    assert size == pytest.approx(8e-3, abs=1e-7)
    assert weight == pytest.approx(3.0, rel=1e-2)
    assert around.fit_size(np.zeros(2), 0, 7.5e-3, 1e-4)[1] == 0.0  # none touches


def test_contacts_count_where_the_bodies_that_touch_rearrange() -> None:
    angle = np.radians([0.0, 120.0, 240.0])
    ring_of_three = 0.018 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    position = np.tile(ring_of_three, (6, 1, 1))
    for k, turned in enumerate(np.radians([0.0, 0.0, 2.0, 4.0, 4.0, 2.0])):  # of the first, along the ring
        position[k, 0] = 0.018 * np.array([np.cos(turned), np.sin(turned)])
    assert box(position).count_rearranged(np.zeros((6, 2)), 8e-3, (1e-4, 1e-4), 1e-4) == 4
    assert box(position).count_rearranged(np.zeros((6, 2)), 8e-3, (1e-4, 1e-4), 5e-4) == 2
    assert box(position).count_rearranged(np.zeros((6, 2)), 7e-3, (1e-4, 1e-4), 1e-4) == 0  # nothing touches
    angle = np.radians([0.0, 90.0, 180.0, 270.0])
    position = np.tile(0.018 * np.stack([np.cos(angle), np.sin(angle)], axis=1), (2, 1, 1))
    position[0, 0] = 0.05
    late = box(position)
    late.present[0, 0] = False  # how far it moved is not known
    assert late.count_rearranged(np.zeros((2, 2)), 8e-3, (1e-4, 1e-4), 1e-4) == 1


def test_a_wall_is_around_a_place_although_it_is_far_from_the_grains_there() -> None:
    around = box(np.array([[0.035, 0.0]]))
    assert len(around.bodies(np.array([0.08, 0.0]), 0, 0.015)[0]) == 5
    assert len(around.bodies(np.array([0.01, 0.0]), 0, 0.008)[0]) == 1


def box(position: np.ndarray) -> Surroundings:
    """Grains of radius .01 at (n, 2) or (f, n, 2) in a box of .2 around the origin."""
    position = position if position.ndim == 3 else position[None]
    side = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
    walls = np.tile(np.stack([side, np.roll(side, -1, axis=0)], axis=1), (len(position), 1, 1, 1))
    f, n = position.shape[:2]
    return Surroundings(np.full(n, 0.01), position, np.ones((f, n), bool), walls, NOISE)


def test_only_walls_that_bound_a_place_are_around_it() -> None:
    halves = np.array([[[[0.2, 0.0], [0.2, 0.1]], [[0.205, 0.1], [0.205, 0.2]]]])
    rod = np.array([[[0.05, 0.05]]])
    around = Surroundings(np.array([0.01]), rod, np.ones((1, 1), bool), halves, NOISE)
    for x, expected in ((0.203, [-0.008]), (0.19, [0.0, 0.005])):  # in the shifted half, and before both
        place = np.array([x, 0.15])
        assert gaps(around.bodies(place, 0, 0.01), place, 0.01) == pytest.approx(expected, abs=1e-6)


def test_a_rod_that_only_walls_and_the_boundary_hold_is_none() -> None:
    """Boundary rods, as those of a chain that leaves the packing, and walls hold it: no force inside needs it."""
    place = np.zeros((2, 2))
    neighbours = np.repeat(np.array([[[0.02, 0.0], [-0.02, 0.0], [0.0, 0.0202]]]), 2, axis=0)
    around, n = box(neighbours), 3
    assert around.count_free(place, 0.01, (1e-5, 1e-5)) == 2.0
    given = around.radius, neighbours, np.ones((2, n), bool), np.zeros((2, 0, 2, 2)), NOISE, None
    assert Surroundings(*given, np.array([True, False, True])).count_free(place, 0.01, (1e-5, 1e-5)) == 1.0
    assert Surroundings(*given, np.zeros(n, bool)).count_free(place, 0.01, (1e-5, 1e-5)) == 0.0
    assert ring(closing=0.0).count == 1
    assert ring(closing=0.0, free=False).count == 0
