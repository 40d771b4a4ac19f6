"""Pose of the camera relative to the walls in each photograph, where the walls were measured independently of it.

A camera that moves between two photographs shifts, rotates and scales all rods alike, but not walls measured by a
displacement sensor. Rods that bear on a wall keep their gap to it, whatever the errors of their radii, so that common
changes of all gaps to walls are the camera's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..bodies.wall_shapes import STRAIGHT, all_sides
from ..calibration.gaps import GapRows, MeasuredSequence, find_gap_rows, measure_gaps
from ..quantity import Quantity
from .picture_shifts import find_picture_shifts

REACH = 0.1  # mean radii: greatest gap of pairs that may bear on the wall, in more than half of all frames
FARTHEST = 1.0  # mean radii: greatest gap of these pairs in the others, where the camera may be displaced
PRIOR = 0.05  # mean radii: prior standard deviation of a shift, and of a rotation or stretch at the farthest rod
MIN_NOISE = 1e-4  # mean radii: lower limit of the noise of a gap
ROUNDS = 12
MIN_PAIRS = 8  # gaps at walls in a frame; with fewer in any frame no pose is estimated
MIN_EVIDENCE = 6.0  # mean square of the poses over their variance above which they are applied; 1: noise alone


@dataclass(frozen=True, slots=True)
class CameraPose:
    """Pose of the camera in every frame; if applied, positions were corrected by it.

    It is relative to the walls where it is large, else to its median over the photographs.
    """

    shift: Annotated[Array, Quantity("shift of the picture relative to the walls", "m", "frame xy", since=2)]
    rotation: Annotated[
        Array,
        Quantity(
            "rotation of the picture relative to the walls, counter-clockwise",
            "rad",
            "frame",
            since=2,
            path="boundary/camera/turn",
        ),
    ]
    stretch: Annotated[Array, Quantity("relative stretch of the picture", dims="frame", since=2)]
    shift_sd: Annotated[Array, Quantity("standard deviation of the shift", "m", "frame xy", since=2)]
    centre: Annotated[Array, Quantity("point about which the picture rotates and stretches", "m", "xy", since=2)]
    evidence: Annotated[float, Quantity("mean square of all poses over their variance; 1: noise alone", since=2)]
    applied: Annotated[bool, Quantity("whether positions were corrected by it", since=2, absent=False)]

    @classmethod
    def unknown(cls, frame_count: int) -> CameraPose:
        """Return zero poses of unknown accuracy, which are not applied."""
        zero = np.zeros(frame_count)
        plane = np.zeros((frame_count, 2))
        return cls(plane, zero, zero, np.full_like(plane, np.nan), np.zeros(2), np.nan, applied=False)

    def correct(self, position: Array) -> Array:
        """Correct centres (f, n, 2) [m] by the pose.

        Notes
        -----
        x ← x − t − φ ẑ × (x − m) − λ (x − m), with t the shift, φ the rotation, λ the stretch, m the centre.
        """
        place = position - self.centre
        rotated = self.rotation[:, None, None] * np.stack([-place[..., 1], place[..., 0]], axis=2)
        return position - self.shift[:, None] - rotated - self.stretch[:, None, None] * place


def find_camera_pose(sequence: MeasuredSequence) -> CameraPose:
    """Estimate the pose of every photograph; unknown where too few rods bear on walls.

    Notes
    -----
    In frame k, the gap of pair p at a wall of outward normal n is g = ḡ_p − n·(t_k + φ_k ẑ × r + λ_k r) + noise, with r
    the rod's position from the mean of all and ḡ_p the pair's usual gap. Poses minimise Σ W(e/(3 s)) e²/σ² plus their
    Gaussian priors in twelve rounds, with e the residual, W(u) = (1 + u²)⁻², ḡ_p the median of the pair, and s
    shrinking from the prior to the noise. The priors are about the coarse shifts of `find_picture_shifts`, zero without
    large ones, and the median of the poses over the photographs is that of the coarse shifts. They are applied if the
    mean of pose²/variance exceeds 6.
    """
    radius, seen = float(sequence.radius.mean()), np.any(sequence.present, axis=1)
    # A photograph that is displaced opens the gaps at one wall and closes those at the opposite one: without the open
    # ones its displacement would seem smaller.
    rows = find_gap_rows(sequence, -np.inf, wall_reach=FARTHEST * radius)
    geometry = measure_gaps(rows, sequence.position, sequence.endpoints, sequence.radius, sequence.side)
    start = np.zeros((len(seen), 2))
    if np.all(all_sides(sequence.side, sequence.wall_count) == STRAIGHT):  # the rods at a circle show no direction
        start = find_picture_shifts(rows, geometry, seen, radius)
    bears = geometry.gap + np.einsum("mk,mk->m", geometry.normal, start[rows.frame]) < REACH * radius
    often = np.bincount(rows.pair[bears], minlength=int(rows.pair.max(initial=-1)) + 1) > 0.5 * seen.sum()
    rows, geometry = rows.select(often[rows.pair]), geometry.select(often[rows.pair])
    if rows.count == 0 or np.bincount(rows.frame, minlength=sequence.frame_count)[seen].min() < MIN_PAIRS:
        return CameraPose.unknown(sequence.frame_count)
    at = sequence.position[rows.frame, rows.i]
    centre = at.mean(axis=0)
    place = at - centre
    reach = float(np.linalg.norm(place, axis=1).max())
    normal = geometry.normal
    # A shift t of the picture moves every rod outward by n·t, which reduces its gap.
    derivative = -np.column_stack([
        normal, (-normal[:, 0] * place[:, 1] + normal[:, 1] * place[:, 0]) / reach,
        np.einsum("mk,mk->m", normal, place) / reach,
    ])  # fmt: skip
    noise = np.maximum(sequence.sigma[rows.frame, rows.i], MIN_NOISE * radius)
    pose, variance = _fit(rows, geometry.gap, derivative, noise, PRIOR * radius, start)
    evidence = float(np.mean((pose**2 / variance)[seen]))
    applied = evidence > MIN_EVIDENCE
    shown = pose if applied else np.zeros_like(pose)
    return CameraPose(
        shown[:, :2], shown[:, 2] / reach, shown[:, 3] / reach, np.sqrt(variance[:, :2]), centre, evidence, applied
    )


def _fit(rows: GapRows, gap: Array, derivative: Array, noise: Array, prior: float, shift: Array) -> tuple[Array, Array]:
    """Fit poses (f, 4) [m] and their variances by re-weighted least squares, in turn with the pairs' median gaps.

    The pose begins with the coarse shift (f, 2) [m] of each picture.
    """
    frames = len(shift)
    start, variance = np.column_stack([shift, np.zeros_like(shift)]), np.full((frames, 4), prior**2)
    pose = start.copy()
    order = np.argsort(rows.frame, kind="stable")
    ends = np.searchsorted(rows.frame[order], np.arange(frames + 1))
    scale = np.maximum(noise, prior)
    for _ in range(ROUNDS):
        left = gap - np.einsum("mk,mk->m", derivative, pose[rows.frame])
        left = left - _median_gaps(rows.pair, left)[rows.pair]
        scale = np.maximum(noise, 0.5 * scale)  # from the prior to the noise
        weight = 1.0 / (1.0 + (left / (3.0 * scale)) ** 2) ** 2 / noise**2
        for k in range(frames):
            at = order[ends[k] : ends[k + 1]]
            d, w = derivative[at], weight[at]
            normal = d.T @ (w[:, None] * d) + np.eye(4) / prior**2
            inverse = np.linalg.inv(normal)
            step = inverse @ (d.T @ (w * left[at]) - (pose[k] - start[k]) / prior**2)
            pose[k] += step
            variance[k] = np.diag(inverse)
        fitted = np.diff(ends) > 0
        # A common pose would be an error of the walls; the mean would hold part of a single displacement.
        pose[fitted] -= np.median((pose - start)[fitted], axis=0)
    return pose, variance


def _median_gaps(pair: NDArray[np.int32], gap: Array) -> Array:
    """Compute the median gap (p,) [m] of every pair: most frames show it bearing."""
    count = int(pair.max()) + 1
    order = np.lexsort((gap, pair))
    start, stop = np.searchsorted(pair[order], [np.arange(count), np.arange(1, count + 1)])
    found = np.flatnonzero(stop > start)
    middle = np.zeros(count)
    middle[found] = gap[order][(start + (stop - start) // 2)[found]]
    return middle
