"""Inference of rods that were removed from a packing."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.bodies.grains import Array
from rodsight.solver.inferred.surroundings import Surroundings
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


def ring(closing: float, touching: int = 6, turning: float = 0.0, moving: float = 0.0, frames: int = 4) -> UnseenRods:
    """Infer rods inside a ring of six around a hole of their size, one of which moves inward after two frames.

    touching: of the six, the others are too far out; turning [rad], moving (along the ring, of a radius): per frame.
    """
    r = 8e-3
    angle = np.pi / 3 * np.arange(6)
    around = 2 * r * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    far = np.array([[0.05, 0.05], [-0.05, 0.05], [-0.05, -0.05], [0.05, -0.05]])
    position = np.tile(np.concatenate([around, far]), (frames, 1, 1))
    position[2:, 0] *= 1.0 - closing
    position[:, touching:6] *= 1.05
    for k in range(frames):
        turned = np.array([k * turning, k * turning + k * moving / 2.0])  # the rod 0 along the ring
        for rods, by in ((slice(0, 10), turned[0]), (slice(0, 1), turned[1] - turned[0])):
            c, s = np.cos(by), np.sin(by)
            position[k, rods] = position[k, rods] @ np.array([[c, s], [-s, c]])
    side = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
    walls = np.tile(np.stack([side, np.roll(side, -1, axis=0)], axis=1), (frames, 1, 1, 1))
    return infer_unseen(
        np.full(10, r), position, np.ones((frames, 10), bool), walls, UnseenRodSettings(NOISE, np.array([r]))
    )


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


def test_the_photographs_in_which_the_grains_around_rearrange_are_found() -> None:
    position = np.tile(np.array([[0.0, 0.02], [0.0, -0.02], [0.02, 0.0]]), (5, 1, 1))
    position[2:, 0, 1] += 3e-4
    position[3] += 0.1
    position[4, 1, 0] += 1e-3
    wall = np.tile([[[-1.0, -1.0], [1.0, -1.0]]], (5, 1, 1, 1))
    around = Surroundings(np.full(3, 0.01), position, np.ones((5, 3), bool), wall, NOISE)
    place = np.zeros((5, 2))
    place[3] = 0.1
    assert around.find_changed(place, 2e-4).tolist() == [0, 2, 4]
    assert around.find_changed(place, 4e-4).tolist() == [0, 4]
    lost = np.ones((5, 3), bool)
    lost[2:, 0] = False
    unseen = Surroundings(np.full(3, 0.01), position, lost, wall, NOISE)
    assert unseen.find_changed(place, 2e-4).tolist() == [0, 4]


def test_only_walls_that_bound_a_place_are_around_it() -> None:
    halves = np.array([[[[0.2, 0.0], [0.2, 0.1]], [[0.205, 0.1], [0.205, 0.2]]]])
    rod = np.array([[[0.05, 0.05]]])
    around = Surroundings(np.array([0.01]), rod, np.ones((1, 1), bool), halves, NOISE)
    assert around.gaps(np.array([0.203, 0.15]), 0, 0.01) == pytest.approx([-0.008], abs=1e-6)  # in the shifted half
    assert around.gaps(np.array([0.19, 0.15]), 0, 0.01) == pytest.approx([0.0, 0.005], abs=1e-6)
