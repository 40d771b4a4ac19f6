"""Positions and contacts from one another: rods that touch have no gap, which tells where they are.

Noise moves every centre by itself, but the gaps of a dense packing tie the centres together: nearly as many contacts
as there are coordinates. A pair that the photographs of a window show to touch therefore corrects both its grains, and
they correct what is known of their other pairs. Both sides are brought to agree by expectation propagation: the
gaps, pair by pair over time, by the smoother of `contact_probability`; the positions, photograph by photograph
over all pairs, by least squares. What a pair is judged by never contains what it contributed itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded
from scipy.sparse import coo_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from solver.bodies.grains import Array, Grains
from solver.bodies.motion import Snapshot
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts, measure_contacts, measure_pairs
from solver.contacts.pairs import Keys, are_there, make_keys, recall
from solver.detection.band_inverse import band_inverse
from solver.detection.displacement import displacement_scale
from solver.detection.touch_probability import (
    AHEAD,
    BACK,
    Candidates,
    ContactProbabilitySettings,
    find_candidates,
    smooth_gaps,
)

BLOCK = 16  # frames that are refined together, besides the windows of the first and last of them
ROUNDS = 2  # between gaps and positions; more change nothing that matters
INFORMATIVE = 0.02  # P(touch) from which on a pair says something about positions
OUTLIER = 4.0  # standard deviations of overlap beyond which a pair says nothing: a radius or a track is wrong
DAMPING = 0.7  # share of the new message in every round
LEAST_CAVITY = 0.02  # of a pair's information that must come from elsewhere, for rounding


@dataclass(frozen=True, slots=True)
class RefinedBlock:
    """Consecutive frames, refined together."""

    start: int  # first frame
    key: Keys  # (c,) candidates, ascending
    touch: Array  # (f, c) P(touch)
    position: Array  # (f, n, 2) [m] refined; NaN where a grain is missing
    slide_variance: Array  # (f, c) [m²] of the pair's relative position along its tangent

    def position_at(self, frame: int) -> Array:
        return self.position[frame - self.start]

    def contacts_at(
        self, snapshot: Snapshot, frame: int, grains: Grains, walls: Walls, least: float
    ) -> tuple[Contacts, Array]:
        """Pairs that touch with more than the least probability, measured as photographed, with their P(touch) (c,).

        snapshot: that of the frame, with stand-ins for lost grains.
        """
        touch = self.touch[frame - self.start]
        keep = (touch > least) & are_there(self.key, snapshot.present, grains.count + walls.count)
        return measure_pairs(grains, snapshot.position, walls, self.key[keep]), touch[keep]

    def slide_deviation(self, contacts: Contacts, frames: tuple[int, int], sigma: tuple[float, float]) -> Array:
        """Standard deviation of the sliding measured at contacts between two frames (c,) [m].

        sigma [m]: of a position component in either frame, and of the rim where a rotation is measured.
        """
        grains = np.where(contacts.with_wall, 1.0, 2.0)
        total = np.zeros(contacts.count)
        for frame, each in zip(frames, sigma, strict=True):
            moved = grains * each**2
            refined = recall(contacts.key, self.key, self.slide_variance[frame - self.start], fill=np.nan)
            moved = np.where(np.isfinite(refined), refined, moved)
            total += moved + grains * each**2
        return np.sqrt(total)


def block_of(frame: int, frame_count: int) -> tuple[int, int, int]:
    """Number of the block that a frame belongs to, and the frames (first, end) that are refined for it."""
    number = frame // BLOCK
    return number, max(number * BLOCK - BACK, 0), min((number + 1) * BLOCK + AHEAD, frame_count)


def refine(
    grains: Grains, snapshots: Sequence[Snapshot], settings: ContactProbabilitySettings, *, start: int = 0
) -> RefinedBlock:
    """Refine consecutive snapshots together; start: number of the first."""
    position = np.stack([each.position for each in snapshots])
    present = np.stack([each.present for each in snapshots])
    sigma = np.repeat([[each.sigma] for each in snapshots], grains.count, axis=1).astype(np.float64)
    walls = [Walls.at_rest(s.endpoints) for s in snapshots]
    seen = np.where(present[:, :, None], position, np.nan)
    pairs = find_candidates(grains, position, present, sigma, walls, settings)
    scale = np.array([
        displacement_scale(seen[f], seen[f + 1], 0.5 * (sigma[f] + sigma[f + 1])) for f in range(len(snapshots) - 1)
    ])  # fmt: skip
    network = _Network.of(grains, pairs)
    normal = np.stack([
        measure_contacts(grains, seen[f], walls[f], pairs.i, pairs.j).normal for f in range(len(snapshots))
    ])  # fmt: skip

    spread = settings.overlap**2
    cavity, doubt = pairs.gap.copy(), np.maximum(pairs.sigma**2 - spread, (1e-3 * pairs.sigma) ** 2)
    weight, pull = np.zeros_like(cavity), np.zeros_like(cavity)  # of the message: 1/variance, mean/variance
    slide, shift = np.empty_like(cavity), np.empty_like(seen)
    for step in range(ROUNDS):
        found = smooth_gaps(cavity, np.sqrt(doubt + spread), scale, settings)
        useful = np.isfinite(cavity) & (found.touch > INFORMATIVE)
        useful &= cavity + 0.5 * settings.overlap > -OUTLIER * np.sqrt(doubt + spread)
        with np.errstate(invalid="ignore", divide="ignore"):
            sharper = 1.0 / found.variance - 1.0 / doubt
            useful &= sharper > 0.0
            new_weight = np.where(useful, sharper, 0.0)
            new_pull = np.where(useful, found.mean / found.variance - cavity / doubt, 0.0)
        part = DAMPING if step else 1.0
        weight, pull = weight + part * (new_weight - weight), pull + part * (new_pull - pull)
        for f in range(len(snapshots)):
            shift[f], gap, variance, slide[f] = network.solve(normal[f], pairs.gap[f], weight[f], pull[f], sigma[f])
            with np.errstate(divide="ignore"):
                left = np.maximum(1.0 / variance - weight[f], LEAST_CAVITY / variance)
            doubt[f] = np.where(np.isfinite(gap), 1.0 / left, doubt[f])
            cavity[f] = (gap / variance - pull[f]) / left
    touch = smooth_gaps(cavity, np.sqrt(doubt + spread), scale, settings).touch
    bodies = grains.count + (walls[0].count if walls else 0)
    return RefinedBlock(start, make_keys(pairs.i, pairs.j, bodies), touch, seen + shift, slide)


@dataclass(frozen=True, slots=True)
class _Network:
    """The candidates of a block as a banded problem in the grains' displacements."""

    i: NDArray[np.int64]  # (c,) place of the grain in the ordering
    j: NDArray[np.int64]  # (c,) place of the other; where it is a wall, that of the grain itself
    wall: NDArray[np.bool_]  # (c,)
    place: NDArray[np.int64]  # (n,) of each grain in the ordering
    band: int  # entries below the diagonal

    @classmethod
    def of(cls, grains: Grains, pairs: Candidates) -> _Network:
        n = grains.count
        wall = pairs.j >= n
        i, j = pairs.i.astype(np.int64), np.where(wall, pairs.i, pairs.j).astype(np.int64)
        graph = coo_array((np.ones(2 * len(i)), (np.append(i, j), np.append(j, i))), shape=(n, n)).tocsr()
        place = np.empty(n, np.int64)
        place[reverse_cuthill_mckee(graph, symmetric_mode=True)] = np.arange(n)
        widest = int(np.abs(place[i] - place[j]).max(initial=0))
        return cls(place[i], place[j], wall, place, 2 * widest + 1)

    def solve(
        self, normal: Array, gap: Array, weight: Array, pull: Array, sigma: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Displacements (n, 2) that agree best with the messages, and what they make of the pairs.

        normal (c, 2); gap (c,) [m] as measured; weight (c,) [1/m²] and pull (c,) [1/m] of the messages; sigma (n,)
        [m]. The pairs' gaps (c,) [m], their variance and that along the tangent (c,) [m²].
        """
        n = len(self.place)
        known = np.isfinite(gap)
        normal, gap = np.where(known[:, None], normal, 0.0), np.where(known, gap, 0.0)
        weight, pull = np.where(known, weight, 0.0), np.where(known, pull, 0.0)
        matrix, right = np.zeros((self.band + 1, 2 * n)), np.zeros(2 * n)
        matrix[0, np.repeat(2 * self.place, 2) + np.tile([0, 1], n)] = np.repeat(sigma**-2.0, 2)
        force = (pull - weight * gap)[:, None] * normal
        other = ~self.wall
        low, high = np.minimum(self.i, self.j), np.maximum(self.i, self.j)
        for a in range(2):
            np.add.at(right, 2 * self.i + a, -force[:, a])
            np.add.at(right, 2 * self.j[other] + a, force[other, a])
            for b in range(2):
                block = weight * normal[:, a] * normal[:, b]
                if b <= a:
                    np.add.at(matrix[a - b], 2 * self.i + b, block)
                    np.add.at(matrix[a - b], 2 * self.j[other] + b, block[other])
                down = 2 * (high - low)[other] + a - b
                np.add.at(matrix, (down, 2 * low[other] + b), -block[other])
        factor, inverse = band_inverse(matrix)
        moved = cho_solve_banded((factor, True), right, check_finite=False).reshape(n, 2)
        between = np.where(self.wall[:, None], 0.0, moved[self.j]) - moved[self.i]
        found = gap + np.einsum("ca,ca->c", normal, between)
        tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
        nan = np.where(known, 0.0, np.nan)
        return (
            moved[self.place], found + nan,
            self._variance(inverse, normal) + nan, self._variance(inverse, tangent) + nan,
        )  # fmt: skip

    def _variance(self, inverse: Array, direction: Array) -> Array:
        """Of the pairs' relative positions along directions (c, 2), from the inverse within the band (c,) [m²]."""
        low, high = np.minimum(self.i, self.j), np.maximum(self.i, self.j)
        total = np.zeros(len(direction))
        for a in range(2):
            for b in range(2):
                product = direction[:, a] * direction[:, b]
                own = inverse[2 * self.i + min(a, b), abs(a - b)]
                partner = inverse[2 * self.j + min(a, b), abs(a - b)]
                down = np.maximum(2 * (high - low) + a - b, 0)
                cross = inverse[2 * low + b, down]
                total += product * np.where(self.wall, own, own + partner - 2.0 * cross)
        return np.maximum(total, 1e-30)
