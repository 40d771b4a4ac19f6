"""How the camera stood against the walls in each photograph, where the walls were measured otherwise.

A camera that moves between two photographs shifts, turns and enlarges all rods alike; walls that a displacement sensor
told do not follow. Rods that bear on a wall keep their gap to it, whatever their radii are wrong by, so that what all
gaps to all walls change from one photograph to the next is the camera's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.quantity import Quantity
from solver.calibration.gaps import GapRows, MeasuredSequence, find_gap_rows, measure_gaps

REACH = 0.1  # mean radii: pairs whose gaps come nearer in some frame may bear on the wall
PRIOR = 0.05  # mean radii by which a photograph may move, or its corners turn or stretch
FINEST = 1e-4  # mean radii: gaps are not known better
ROUNDS = 12
LEAST_PAIRS = 8  # wall gaps in a frame below which its pose is not asked for
DECISIVE = 6.0  # mean square of the poses over their variance; 1 is noise alone


@dataclass(frozen=True, slots=True)
class CameraPose:
    """Pose of the camera in every frame, against its mean. Applied: positions are moved back."""

    shift: Annotated[Array, Quantity("shift of the picture against the walls", "m", "frame xy", since=2)]
    turn: Annotated[
        Array, Quantity("turn of the picture against the walls, counter-clockwise", "rad", "frame", since=2)
    ]
    stretch: Annotated[Array, Quantity("relative enlargement of the picture", dims="frame", since=2)]
    shift_sd: Annotated[Array, Quantity("standard deviation of the shift", "m", "frame xy", since=2)]
    centre: Annotated[Array, Quantity("point about which the picture turns and stretches", "m", "xy", since=2)]
    evidence: Annotated[float, Quantity("mean square of all poses over their variance; 1: noise alone", since=2)]
    applied: Annotated[bool, Quantity("whether positions were corrected by it", since=2, absent=False)]

    @classmethod
    def unknown(cls, frame_count: int) -> CameraPose:
        """The pose where nothing tells it."""
        zero = np.zeros(frame_count)
        plane = np.zeros((frame_count, 2))
        return cls(plane, zero, zero, np.full_like(plane, np.nan), np.zeros(2), np.nan, applied=False)

    def correct(self, position: Array) -> Array:
        """Centres (f, n, 2) [m] as the walls see them."""
        place = position - self.centre
        turned = self.turn[:, None, None] * np.stack([-place[..., 1], place[..., 0]], axis=2)
        return position - self.shift[:, None] - turned - self.stretch[:, None, None] * place


def find_camera_pose(sequence: MeasuredSequence) -> CameraPose:
    """Find the pose of every photograph; unknown where too few rods bear on walls to tell."""
    radius = float(sequence.radius.mean())
    rows = _wall_rows(sequence, REACH * radius)
    seen = sequence.present.any(axis=1)
    if rows.count == 0 or np.bincount(rows.frame, minlength=sequence.frame_count)[seen].min() < LEAST_PAIRS:
        return CameraPose.unknown(sequence.frame_count)
    geometry = measure_gaps(rows, sequence.position, sequence.endpoints, sequence.radius, sequence.side)
    at = sequence.position[rows.frame, rows.i]
    centre = at.mean(axis=0)
    place = at - centre
    reach = float(np.linalg.norm(place, axis=1).max())
    normal = geometry.normal
    # A picture that is shifted by t has every rod further out by n·t, and its gap less by so much.
    derivative = -np.column_stack([
        normal, (-normal[:, 0] * place[:, 1] + normal[:, 1] * place[:, 0]) / reach,
        np.einsum("mk,mk->m", normal, place) / reach,
    ])  # fmt: skip
    noise = np.maximum(sequence.sigma[rows.frame, rows.i], FINEST * radius)
    pose, variance = _fit(rows, geometry.gap, derivative, noise, PRIOR * radius, sequence.frame_count)
    evidence = float(np.mean((pose**2 / variance)[seen]))
    applied = evidence > DECISIVE
    shown = pose if applied else np.zeros_like(pose)
    return CameraPose(
        shown[:, :2], shown[:, 2] / reach, shown[:, 3] / reach, np.sqrt(variance[:, :2]), centre, evidence, applied
    )


def _wall_rows(sequence: MeasuredSequence, reach: float) -> GapRows:
    """Gaps to walls of pairs that are near in more than half of all frames."""
    rows = find_gap_rows(sequence, -np.inf, wall_reach=reach)
    often = (
        np.bincount(rows.pair, minlength=int(rows.pair.max(initial=-1)) + 1) > 0.5 * sequence.present.any(axis=1).sum()
    )
    return rows.select(often[rows.pair])


def _fit(rows: GapRows, gap: Array, derivative: Array, noise: Array, prior: float, frames: int) -> tuple[Array, Array]:
    """Poses (f, 4) [m] and their variances, by re-weighted least squares in turn with each pair's own usual gap."""
    pose, variance = np.zeros((frames, 4)), np.full((frames, 4), prior**2)
    order = np.argsort(rows.frame, kind="stable")
    ends = np.searchsorted(rows.frame[order], np.arange(frames + 1))
    scale = np.maximum(noise, prior)
    for _ in range(ROUNDS):
        left = gap - np.einsum("mk,mk->m", derivative, pose[rows.frame])
        left = left - _usual(rows.pair, left)[rows.pair]
        scale = np.maximum(noise, 0.5 * scale)  # from the poses' own size to the noise
        weight = 1.0 / (1.0 + (left / (3.0 * scale)) ** 2) ** 2 / noise**2
        for k in range(frames):
            at = order[ends[k] : ends[k + 1]]
            d, w = derivative[at], weight[at]
            normal = d.T @ (w[:, None] * d) + np.eye(4) / prior**2
            inverse = np.linalg.inv(normal)
            step = inverse @ (d.T @ (w * left[at]) - pose[k] / prior**2)
            pose[k] += step
            variance[k] = np.diag(inverse)
        told = np.diff(ends) > 0
        pose[told] -= pose[told].mean(axis=0)  # what all photographs share is where the walls are
    return pose, variance


def _usual(pair: NDArray[np.int32], gap: Array) -> Array:
    """The gap of every pair while it bears: its median, for those looked at are near in most frames (p,) [m]."""
    count = int(pair.max()) + 1
    order = np.lexsort((gap, pair))
    start, stop = np.searchsorted(pair[order], [np.arange(count), np.arange(1, count + 1)])
    found = np.flatnonzero(stop > start)
    middle = np.zeros(count)
    middle[found] = gap[order][(start + (stop - start) // 2)[found]]
    return middle
