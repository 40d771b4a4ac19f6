"""Joint refinement of positions and contacts by expectation propagation.

The noise of every centre is independent, but a dense packing has nearly as many contacts as coordinates, and a pair
that touches has zero gap. A pair that touches in a window of photographs therefore corrects the positions of both its
grains, and these correct their other pairs. The factors are the gaps, pair by pair over time (the smoother of
`touch_probability`), and the positions, photograph by photograph over all pairs (least squares). The cavity
distribution of a pair excludes its own message.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..bodies.grains import Array, Grains
from ..bodies.motion import Snapshot
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts, measure_contacts, measure_pairs
from ..contacts.pairs import Keys, are_present, make_keys, match_values
from .displacement import displacement_scale
from .position_network import PositionNetwork
from .touch_probability import (
    AHEAD,
    BACK,
    ContactProbabilitySettings,
    find_touch_candidates,
    smooth_gaps,
)

BLOCK = 16  # frames refined together, in addition to the windows of the first and last of them
ROUNDS = 2  # of messages between gaps and positions; more rounds have no significant effect
INFORMATIVE = 0.02  # P(touch) above which a pair sends a message to the positions
OUTLIER = 4.0  # [σ] overlap beyond which a pair sends no message: a radius or a track is wrong
DAMPING = 0.7  # weight of the new message from the second round on
LEAST_CAVITY = 0.02  # least fraction of a pair's precision that must come from other pairs, against rounding


@dataclass(frozen=True, slots=True)
class RefinedBlock:
    """Consecutive frames that were refined together."""

    start: int  # first frame
    key: Keys  # (c,) candidate pairs, ascending
    touch: Array  # (f, c) P(touch)
    position: Array  # (f, n, 2) [m] refined; NaN where a grain is missing
    sliding_variance: Array  # (f, c) [m²] of the pair's relative position along its tangent

    def position_at(self, frame: int) -> Array:
        return self.position[frame - self.start]

    def contacts_at(
        self, snapshot: Snapshot, frame: int, grains: Grains, walls: Walls, least: float
    ) -> tuple[Contacts, Array]:
        """Return the contacts with P(touch) above `least`, at their measured positions, and P(touch) (c,).

        snapshot: that of the frame, with lost grains interpolated.
        """
        touch = self.touch[frame - self.start]
        keep = (touch > least) & are_present(self.key, snapshot.present, grains.count + walls.count)
        return measure_pairs(grains, snapshot.position, walls, self.key[keep]), touch[keep]

    def sliding_sd(self, contacts: Contacts, frames: tuple[int, int], sigma: tuple[float, float]) -> Array:
        """Return the standard deviation of the measured sliding at contacts between two frames (c,) [m].

        sigma [m]: standard deviation of a position component in either frame, and of the rim's rotation.
        """
        grains = np.where(contacts.with_wall, 1.0, 2.0)
        total = np.zeros(contacts.count)
        for frame, each in zip(frames, sigma, strict=True):
            moved = grains * each**2
            refined = match_values(contacts.key, self.key, self.sliding_variance[frame - self.start], fill=np.nan)
            moved = np.where(np.isfinite(refined), refined, moved)
            total += moved + grains * each**2
        return np.sqrt(total)


def block_of(frame: int, frame_count: int, span: int = 1) -> tuple[int, int, int]:
    """Return the number of a frame's block, and the range of frames (first, end) that are refined for it.

    span: photographs over which sliding is read; the widest interval reaches twice as far either way.
    """
    number, back, ahead = frame // BLOCK, max(BACK, 2 * span), max(AHEAD, 2 * span)
    return number, max(number * BLOCK - back, 0), min((number + 1) * BLOCK + ahead, frame_count)


def refine(
    grains: Grains, snapshots: Sequence[Snapshot], settings: ContactProbabilitySettings, *, start: int = 0
) -> RefinedBlock:
    """Refine consecutive snapshots together; start: frame number of the first one."""
    position = np.stack([each.position for each in snapshots])
    present = np.stack([each.present for each in snapshots])
    sigma = np.repeat([[each.sigma] for each in snapshots], grains.count, axis=1).astype(np.float64)
    walls = [s.walls for s in snapshots]
    seen = np.where(present[:, :, None], position, np.nan)
    pairs = find_touch_candidates(grains, position, present, sigma, walls, settings)
    scale = np.array([
        displacement_scale(seen[f], seen[f + 1], 0.5 * (sigma[f] + sigma[f + 1])) for f in range(len(snapshots) - 1)
    ])  # fmt: skip
    network = PositionNetwork.of(grains, pairs)
    normal = np.stack([
        measure_contacts(grains, seen[f], walls[f], pairs.i, pairs.j).normal for f in range(len(snapshots))
    ])  # fmt: skip

    overlap_variance = settings.overlap**2
    cavity, cavity_variance = pairs.gap.copy(), np.maximum(pairs.sigma**2 - overlap_variance, (1e-3 * pairs.sigma) ** 2)
    weight, pull = np.zeros_like(cavity), np.zeros_like(cavity)  # of the message: 1/variance, mean/variance
    sliding_variance, shift = np.empty_like(cavity), np.empty_like(seen)
    for step in range(ROUNDS):
        found = smooth_gaps(cavity, np.sqrt(cavity_variance + overlap_variance), scale, settings)
        useful = np.isfinite(cavity) & (found.touch > INFORMATIVE)
        useful &= cavity + 0.5 * settings.overlap > -OUTLIER * np.sqrt(cavity_variance + overlap_variance)
        with np.errstate(invalid="ignore", divide="ignore"):
            precision = 1.0 / found.variance - 1.0 / cavity_variance
            useful &= precision > 0.0
            new_weight = np.where(useful, precision, 0.0)
            new_pull = np.where(useful, found.mean / found.variance - cavity / cavity_variance, 0.0)
        damping = DAMPING if step else 1.0
        weight, pull = weight + damping * (new_weight - weight), pull + damping * (new_pull - pull)
        for f in range(len(snapshots)):
            refined = network.refine(normal[f], pairs.gap[f], weight[f], pull[f], sigma[f])
            shift[f], sliding_variance[f] = refined.displacement, refined.sliding_variance
            variance = refined.gap_variance
            with np.errstate(divide="ignore"):
                remaining = np.maximum(1.0 / variance - weight[f], LEAST_CAVITY / variance)
            cavity_variance[f] = np.where(np.isfinite(refined.gap), 1.0 / remaining, cavity_variance[f])
            cavity[f] = (refined.gap / variance - pull[f]) / remaining
    touch = smooth_gaps(cavity, np.sqrt(cavity_variance + overlap_variance), scale, settings).touch
    bodies = grains.count + (walls[0].count if walls else 0)
    return RefinedBlock(start, make_keys(pairs.i, pairs.j, bodies), touch, seen + shift, sliding_variance)
