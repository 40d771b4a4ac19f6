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

from solver.bodies.grains import Array, Grains
from solver.bodies.motion import Snapshot
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts, measure_contacts, measure_pairs
from solver.contacts.pairs import Keys, are_there, make_keys, recall
from solver.detection.displacement import displacement_scale
from solver.detection.position_network import PositionNetwork
from solver.detection.touch_probability import (
    AHEAD,
    BACK,
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
    walls = [s.walls for s in snapshots]
    seen = np.where(present[:, :, None], position, np.nan)
    pairs = find_candidates(grains, position, present, sigma, walls, settings)
    scale = np.array([
        displacement_scale(seen[f], seen[f + 1], 0.5 * (sigma[f] + sigma[f + 1])) for f in range(len(snapshots) - 1)
    ])  # fmt: skip
    network = PositionNetwork.of(grains, pairs)
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
            told = network.refine(normal[f], pairs.gap[f], weight[f], pull[f], sigma[f])
            shift[f], slide[f] = told.displacement, told.slide_variance
            variance = told.gap_variance
            with np.errstate(divide="ignore"):
                left = np.maximum(1.0 / variance - weight[f], LEAST_CAVITY / variance)
            doubt[f] = np.where(np.isfinite(told.gap), 1.0 / left, doubt[f])
            cavity[f] = (told.gap / variance - pull[f]) / left
    touch = smooth_gaps(cavity, np.sqrt(doubt + spread), scale, settings).touch
    bodies = grains.count + (walls[0].count if walls else 0)
    return RefinedBlock(start, make_keys(pairs.i, pairs.j, bodies), touch, seen + shift, slide)
