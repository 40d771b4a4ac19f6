"""Small packings with known answers, shared by the tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rodsight.solver.bodies.grains import Array, GrainMotion, Grains
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import Contacts, detect_contacts
from rodsight.solver.nlgs.problem import ContactProblem, assemble
from rodsight.solver.nlgs.solve import NlgsSettings, solve

LENGTH = 0.06  # [m]


def rods(*radius: float) -> Grains:
    return Grains.of_rods(np.array(radius), density=2700.0, length=LENGTH)


def motion(position: Array, velocity: Array | None = None, spin: Array | None = None) -> GrainMotion:
    n = len(position)
    return GrainMotion(
        np.asarray(position, float),
        np.zeros((n, 2)) if velocity is None else np.asarray(velocity, float),
        np.zeros(n) if spin is None else np.asarray(spin, float),
        np.ones(n, bool),
    )


def box(width: float, height: float, *, top_load: float = np.nan) -> Walls:
    """Bottom, right, top, left at rest; the top carries a load [N]."""
    c = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    endpoints = np.stack([c, np.roll(c, -1, axis=0)], axis=1)
    return Walls(endpoints, np.zeros((4, 2, 2)), np.array([np.nan, np.nan, top_load, np.nan]))


def problem_of(
    grains: Grains,
    state: GrainMotion,
    walls: Walls,
    *,
    friction: float = 0.25,
    gravity: tuple[float, float] = (0.0, 0.0),
    impedance: Array | None = None,
    threshold: float = 1e-9,
) -> tuple[ContactProblem, Contacts]:
    contacts = detect_contacts(grains, state.position, state.present, walls, threshold)
    material = Material(friction, friction, 0.0, gravity)
    impedance = grains.mass * 1e3 if impedance is None else impedance
    return assemble(grains, state, walls, contacts, material, impedance), contacts


def squeezed_heap(rng: np.random.Generator, columns: int = 6, rows: int = 6) -> tuple[Grains, GrainMotion, Walls]:
    """A disordered heap of discs in a box, its grains moving at random: many contacts, a hard problem."""
    pitch = 0.0161
    x, y = np.meshgrid(np.arange(columns) * pitch, np.arange(rows) * pitch)
    position = np.column_stack([x.ravel(), y.ravel()]) + pitch / 2
    position += rng.uniform(-3e-4, 3e-4, position.shape)
    grains = rods(*rng.choice([0.0078, 0.0080, 0.0082], len(position)))
    state = motion(position, rng.normal(0, 1e-5, position.shape), rng.normal(0, 1e-3, len(position)))
    return grains, state, box(columns * pitch, rows * pitch, top_load=50.0)


@dataclass(frozen=True)
class Heap:
    """Grains at rest under their weight, and the contact forces that keep them there."""

    packing: Packing
    state: GrainMotion
    walls: Walls
    contacts: Contacts
    fn: Array  # (c,) [N]
    ft: Array  # (c,) [N]


def heap_at_rest(columns: int = 6, rows: int = 5) -> Heap:
    """Equal discs stacked close in an open box: in exact balance, for nothing moves."""
    radius, gravity = 0.008, (0.0, -9.81)
    position = np.array([
        (radius * (1 + 2 * column + row % 2), radius * (1 + row * np.sqrt(3.0)))
        for row in range(rows) for column in range(columns - row % 2)
    ])  # fmt: skip
    grains, walls = rods(*np.full(len(position), radius)), box(2 * radius * columns, 1.0)
    state = motion(position)
    problem, contacts = problem_of(grains, state, walls, friction=0.3, gravity=gravity, threshold=1e-9)
    found = solve(problem, NlgsSettings(sweeps=20_000, natural_map=1e-13, acceleration=5), every=50)
    packing = Packing(grains, LENGTH, Material(0.3, 0.3, 0.0, gravity), np.full(4, np.nan))
    return Heap(packing, state, walls, contacts, found.fn, found.ft)
