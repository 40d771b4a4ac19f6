"""Jammed disordered packings of any size under a static load, for the benchmarks.

Rods of three radii start on a jittered lattice in a box a little too small for them and are pushed apart as soft,
frictionless discs until they are at rest (FIRE: Bitzek et al. 2006). The overlapping pairs then form a rigid network
with forces in equilibrium; a plate on top and one on the right have the same pressure, all other walls are fixed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from rodsight.solver.bodies.grains import Array, GrainMotion, Grains
from rodsight.solver.bodies.packing import Material
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import Contacts, detect_contacts
from rodsight.solver.nlgs.problem import ContactProblem, assemble
from scipy.spatial import KDTree

RADII, FRACTIONS = (0.007, 0.008, 0.011), (0.40, 0.41, 0.19)  # [m], by number
SOLID_FRACTION = 0.86  # above the .842 at which frictionless discs jam
LENGTH, DENSITY = 0.06, 2700.0  # [m], [kg/m³]
PRESSURE = 50e3  # [Pa]
FRICTION = 0.25
IMPEDANCE = 1e3  # [1/s] times the mass; a static load's forces do not depend on it
SKIN = 0.3  # of the mean radius
AT_REST = 1e-3  # largest force residual over the mean overlap force
ROUNDS, STEPS = 400, 200


@dataclass(frozen=True, slots=True)
class StaticPacking:
    """A packing at rest with its contacts."""

    grains: Grains
    motion: GrainMotion
    walls: Walls
    contacts: Contacts

    @property
    def mean_force(self) -> float:
        """f₀ = σ L d [N]."""
        return PRESSURE * LENGTH * 2.0 * float(self.grains.radius.mean())


def jammed_packing(count: int, seed: int = 0, rest: float = AT_REST) -> StaticPacking:
    """Make a packing of `count` rods in a square box under pressure from above and from the right.

    rest: largest force residual over the mean overlap force; 2 suffices to time sweeps.
    """
    rng = np.random.default_rng(seed)
    radius = rng.choice(RADII, count, p=FRACTIONS)
    side = float(np.sqrt(np.pi * np.sum(radius**2) / SOLID_FRACTION))
    columns = int(np.ceil(np.sqrt(count)))
    site = np.stack(np.divmod(rng.permutation(columns * columns)[:count], columns)[::-1], axis=1)
    position = (site + 0.5 + rng.uniform(-0.3, 0.3, (count, 2))) * (side / columns)
    _push_apart(position, radius, side, rest)

    corner = np.array([[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]])
    endpoints = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
    load = PRESSURE * side * LENGTH
    walls = Walls(endpoints, np.zeros((4, 2, 2)), np.array([np.nan, load, load, np.nan]))
    grains = Grains.of_rods(radius, density=DENSITY, length=LENGTH)
    motion = GrainMotion(position, np.zeros((count, 2)), np.zeros(count), np.ones(count, np.bool_))
    return StaticPacking(grains, motion, walls, detect_contacts(grains, position, motion.present, walls, 0.0))


def static_problem(packing: StaticPacking) -> ContactProblem:
    """Assemble the contact problem of the packing at rest under its loads."""
    return assemble(
        packing.grains,
        packing.motion,
        packing.walls,
        packing.contacts,
        Material(FRICTION, FRICTION),
        packing.grains.mass * IMPEDANCE,
    )


def _push_apart(position: Array, radius: Array, side: float, rest: float) -> None:
    """Relax the discs in place, to rest."""
    mean = float(radius.mean())
    velocity, force = np.zeros_like(position), np.zeros_like(position)
    state = np.array([0.1, 0.1, 0.0])  # FIRE: time step, mixing, steps downhill
    for _ in range(ROUNDS):
        pairs = KDTree(position).query_pairs(2.0 * radius.max() + SKIN * mean, output_type="ndarray").astype(np.int32)
        gap = np.linalg.norm(position[pairs[:, 0]] - position[pairs[:, 1]], axis=1) - radius[pairs].sum(axis=1)
        pairs = np.ascontiguousarray(pairs[gap < SKIN * mean])
        if _relax(position, radius, side, pairs, velocity, force, state, STEPS, 0.4 * SKIN * mean, rest) < rest:
            return
    raise RuntimeError(f"the packing of {len(radius)} rods did not come to rest")


@njit(cache=True)
def _relax(position, radius, side, pairs, velocity, force, state, steps, reach, rest):  # type: ignore[no-untyped-def]
    """Advance by FIRE until a disc may leave the reach of the pair list; returns the residual over the mean force."""
    start = position.copy()
    unbalance = np.inf
    for _ in range(steps):
        mean = _spring_forces(position, radius, side, pairs, force)
        greatest, power, fast, strong, moved = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(len(radius)):  # loops: whole arrays take ten times as long to compile
            square = force[i, 0] ** 2 + force[i, 1] ** 2
            greatest, strong = max(greatest, square), strong + square
            power += force[i, 0] * velocity[i, 0] + force[i, 1] * velocity[i, 1]
            fast += velocity[i, 0] ** 2 + velocity[i, 1] ** 2
        unbalance = np.sqrt(greatest) / mean if mean > 0 else 0.0
        if unbalance < rest:
            break
        keep, turn = 0.0, 0.0
        if power > 0:
            keep, turn = 1.0 - state[1], state[1] * np.sqrt(fast / max(strong, 1e-300))
            state[2] += 1
            if state[2] > 5:
                state[0] = min(state[0] * 1.1, 0.5)
                state[1] *= 0.99
        else:
            state[0], state[1], state[2] = 0.5 * state[0], 0.1, 0.0
        for i in range(len(radius)):
            for k in range(2):
                velocity[i, k] = keep * velocity[i, k] + (turn + state[0]) * force[i, k]
                position[i, k] += state[0] * velocity[i, k]
            moved = max(moved, (position[i, 0] - start[i, 0]) ** 2 + (position[i, 1] - start[i, 1]) ** 2)
        if moved > reach**2:
            break
    return unbalance


@njit(cache=True)
def _spring_forces(position, radius, side, pairs, force):  # type: ignore[no-untyped-def]
    """Compute forces of unit springs between overlapping discs and at the four walls; returns the mean overlap."""
    for i in range(len(radius)):
        force[i, 0], force[i, 1] = 0.0, 0.0
    total, count = 0.0, 0
    for c in range(len(pairs)):
        i, j = pairs[c, 0], pairs[c, 1]
        dx, dy = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1]
        reach = radius[i] + radius[j]
        square = dx * dx + dy * dy
        if square < reach * reach and square > 0.0:
            distance = np.sqrt(square)
            overlap = reach - distance
            fx, fy = overlap * dx / distance, overlap * dy / distance
            force[i, 0] -= fx
            force[i, 1] -= fy
            force[j, 0] += fx
            force[j, 1] += fy
            total += overlap
            count += 1
    for i in range(len(radius)):
        for k in range(2):
            force[i, k] += max(radius[i] - position[i, k], 0.0) - max(position[i, k] + radius[i] - side, 0.0)
    return total / max(count, 1)
