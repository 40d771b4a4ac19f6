"""How much the motion that leads to a frame could have told of its forces, whatever was made of it.

Agreement is no information: where nothing slides, or where noise hides what slides, all members say the same, and
nothing contradicts them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts
from solver.contacts.kinematics import relative_motion
from solver.detection.displacement import displacement_scale

if TYPE_CHECKING:
    from solver.sequence.frame_problem import FrameProblem

SLIDES = 3.0  # standard deviations of a measured sliding beyond which it is seen
STRONG = 0.5  # of the mean force: contacts that surely touch
ROBUST = 1.4826  # standard deviation over the median absolute deviation


@dataclass(frozen=True, slots=True)
class Information:
    """What a frame's motion and gaps could tell. NaN: not known."""

    noise: float  # [m] standard deviation of a position component
    motion: float  # [m] typical displacement between neighbours since the last photograph, free of noise
    sliding: float  # share of the bearing contacts that slide by more than noise
    slide_signal: float  # rms sliding of the bearing contacts over its noise, noise taken off
    gap_error: float  # [m] how far gaps of strong contacts are from nothing, noise taken off
    diameter: float  # [m] mean
    beyond: int  # grains beyond a wall, which touch nothing there
    soft: bool = False  # gaps are overlaps that forces make


NO_INFORMATION = Information(np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, 0)


def measure_information(problem: FrameProblem, contacts: Contacts, fn: Array, walls: Walls) -> Information:
    """What could be told of a frame with normal forces fn (c,) [N] on contacts; walls: as they moved."""
    snapshot, grains = problem.snapshot, problem.packing.grains
    bearing = fn > 0.0
    noise = snapshot.sigma
    motion = motion_scale(problem)
    sliding = signal = np.nan
    if bearing.any():
        moving = problem.motion.grains
        _, speed = relative_motion(contacts, grains.radius, moving.velocity, moving.spin, walls)
        slid = (np.abs(speed) * problem.motion.interval)[bearing]
        doubt = noise * np.where(contacts.with_wall[bearing], 2.0, 8.0**0.5)
        sliding = float((slid > SLIDES * doubt).mean())
        signal = float(np.sqrt(max(np.mean(slid**2) / np.mean(doubt**2) - 1.0, 0.0)))
    return Information(
        noise, motion, sliding, signal, _gap_error(contacts, fn, noise), 2.0 * float(grains.radius.mean()),
        _count_beyond(problem.walls, snapshot.position[snapshot.present]), problem.settings.soft,
    )  # fmt: skip


def motion_scale(problem: FrameProblem) -> float:
    """How far neighbours moved past each other on the way to the frame [m], noise taken off; NaN of fewer than two."""
    moving, interval = problem.motion.grains, problem.motion.interval
    if moving.present.sum() < 2:
        return np.nan
    after = np.where(moving.present[:, None], moving.position, np.nan)
    sigma = np.full(len(after), problem.snapshot.sigma)
    return displacement_scale(after - interval * moving.velocity, after, sigma)


def _gap_error(contacts: Contacts, fn: Array, noise: float) -> float:
    """Robust scatter of the gaps of strong contacts [m] beyond noise."""
    bearing = fn > 0.0
    strong = fn > STRONG * fn[bearing].mean() if bearing.any() else bearing
    if strong.sum() < 10:
        return np.nan
    gap = contacts.gap[strong]
    scatter = (ROBUST * np.median(np.abs(gap - np.median(gap)))) ** 2
    expected = noise**2 * np.where(contacts.with_wall[strong], 1.0, 2.0).mean()
    return float(np.sqrt(max(scatter - expected, 0.0)))


def _count_beyond(walls: Walls, position: Array) -> int:
    """Grains at position (m, 2) [m] whose centre is beyond a wall beside which they are."""
    offset = position[:, None, :] - walls.endpoints[None, :, 0, :]
    out = np.einsum("nwk,wk->nw", offset, walls.outward)
    along = np.einsum("nwk,wk->nw", offset, walls.direction)
    beside: NDArray[np.bool_] = (along > 0.0) & (along < walls.length[None, :])
    return int((beside & (out > 0.0)).any(axis=1).sum())
