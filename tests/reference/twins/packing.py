"""One packing that reaches every branch of the solver's kernels, used by all comparisons."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from rodsight.solver.bodies.cell import Cell
from rodsight.solver.bodies.grains import Array, GrainMotion, Grains
from rodsight.solver.bodies.packing import Material
from rodsight.solver.bodies.wall_shapes import OUT, STRAIGHT
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import Contacts, detect_contacts
from rodsight.solver.nlgs.problem import ContactProblem, PreparedContacts, assemble

COLUMNS, ROWS = 13, 12
PITCH = 0.0161  # [m]
LOST = (0, 30, 77, 140)


@dataclass(frozen=True, slots=True)
class Case:
    """The arguments of `assemble`."""

    grains: Grains
    motion: GrainMotion
    walls: Walls
    contacts: Contacts
    material: Material
    impedance: Array  # (n,) [N s/m]
    closing: Array  # (c,) [m/s]

    def assemble(self) -> ContactProblem:
        return assemble(
            self.grains,
            self.motion,
            self.walls,
            self.contacts,
            self.material,
            self.impedance,
            PreparedContacts(self.closing),
        )


def make_case(seed: int = 7, *, with_boundary: bool = False) -> Case:
    """A disordered packing between walls that move, rotate and carry loads.

    with_boundary: some grains are boundary, and contacts reach across a cell that deforms, as if there were one, too.

    Masses follow neither the radii nor the impedances, some grains are lost and their rows hold nonsense, some
    contacts must close before they bear force, and friction with walls is not that between grains.
    """
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(COLUMNS) * PITCH, np.arange(ROWS) * PITCH)
    position = np.column_stack([x.ravel(), y.ravel()]) + PITCH / 2
    n = len(position)
    position += rng.uniform(-3e-4, 3e-4, position.shape)
    grains = Grains(rng.choice([0.0078, 0.0080, 0.0082], n), rng.uniform(0.02, 0.06, n))
    present = np.ones(n, bool)
    present[list(LOST)] = False
    velocity, spin = rng.normal(0, 1e-5, (n, 2)), rng.normal(0, 1e-3, n)
    position[~present], velocity[~present], spin[~present] = np.nan, np.nan, np.nan
    motion = GrainMotion(position, velocity, spin, present)
    corner = np.array([[0.0, 0.0], [COLUMNS, 0.0], [COLUMNS, ROWS], [0.0, ROWS]]) * PITCH
    endpoints = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
    # Every wall moves tangentially and normally, and rotates. A disc in place of a lost grain is fixed to the plate.
    disc = np.array([[[4.5 * PITCH - 0.008, 2.5 * PITCH], [4.5 * PITCH + 0.008, 2.5 * PITCH]]])
    velocity_of_walls = np.concatenate([rng.normal(0, 3e-5, (4, 2, 2)), np.full((1, 2, 2), 2e-5)])
    walls = Walls(
        np.concatenate([endpoints, disc]), velocity_of_walls, np.array([np.nan, np.nan, 50.0, np.nan, np.nan]),
        np.array([STRAIGHT, STRAIGHT, STRAIGHT, STRAIGHT, OUT], np.int8), plate=np.array([-1, -1, -1, -1, 2], np.int32),
    )  # fmt: skip
    contacts = detect_contacts(grains, position, present, walls, 3e-4)
    closing = np.where(rng.random(contacts.count) < 0.3, rng.uniform(0, 3e-5, contacts.count), 0.0)
    material = Material(0.3, 0.15, 0.1, (0.7, -9.81))
    case = Case(grains, motion, walls, contacts, material, rng.uniform(500.0, 2000.0, n), closing)
    return _bounded(case, rng) if with_boundary else case


def _bounded(case: Case, rng: np.random.Generator) -> Case:
    boundary = np.isin(np.arange(case.grains.count), (17, 60, 85, 120))
    cell = Cell(np.array([[0.3, 0.02], [-0.1, 0.25]]), rng.normal(0, 3e-5, (2, 2)))
    image = np.where(case.contacts.with_wall[:, None], 0, rng.integers(-1, 2, (case.contacts.count, 2)))
    return replace(
        case, grains=replace(case.grains, boundary=boundary), walls=replace(case.walls, cell=cell),
        contacts=replace(case.contacts, shift=image @ cell.vectors),
    )  # fmt: skip


def make_guess(case: Case, seed: int = 3) -> Array:
    """Initial forces (c, 2) [N] of bearing, sliding and open contacts."""
    rng = np.random.default_rng(seed)
    fn = np.maximum(rng.normal(1.0, 1.0, case.contacts.count), 0.0)
    return np.column_stack([fn, rng.uniform(-0.15, 0.15, len(fn)) * fn])
