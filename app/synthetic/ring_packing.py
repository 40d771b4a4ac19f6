"""Dense packings of rods between two circles: the initial state of a synthetic experiment in a drum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..solver.bodies.grains import Array
from ..solver.dem.dem_truth import DemSettings, UnbalancedError
from ..solver.dem.ring_cell import RingCell
from .dense_packing import (
    JITTER,
    LOADING_DRAG,
    LOADING_ROUNDS,
    LOADING_STEPS,
    PREPARED,
    SOFT_DRAG,
    SOFT_STEPS,
    SOFTENING,
    SOLID_FRACTION,
    choose_radii,
)

CORE_RATIO = 0.22  # radius of the core over the ring's
SETTLING_DRAG = 8.0  # [1/s], of rods that fall
LOOSENESS = 1.06  # initial radius of the ring over the dense one


def prepare_ring(
    count: int,
    rng: np.random.Generator,
    settings: DemSettings,
    *,
    sizes: Callable[[int, np.random.Generator], Array] = choose_radii,
) -> RingCell:
    """Compress rods without friction between ring and core, as `prepare_packing` does in a box.

    Returns
    -------
    RingCell
        The cell at rest, with friction.

    Raises
    ------
    UnbalancedError
        If the packing does not come to rest.
    """
    radius = sizes(count, rng)
    area = np.pi * float(np.sum(radius**2)) / SOLID_FRACTION
    ring = float(np.sqrt(area / (np.pi * (1.0 - CORE_RATIO**2))))
    core, wide = CORE_RATIO * ring, LOOSENESS * ring
    position = _scatter(count, rng, core, wide)
    frictionless = replace(settings, friction=0.0, wall_friction=0.0)
    soft = replace(frictionless, normal_stiffness=SOFTENING * settings.normal_stiffness, pressure=float("nan"))
    cell = RingCell(radius, position, ring=wide, core=core, settings=soft, drag=SOFT_DRAG)
    cell.run(np.zeros(SOFT_STEPS))
    cell = RingCell(radius, cell.position, ring=wide, core=core, settings=frictionless, drag=LOADING_DRAG)
    _let_rest(cell)
    return RingCell(radius, cell.position, ring=cell.ring, core=core, settings=settings)


def prepare_drum(
    count: int,
    rng: np.random.Generator,
    settings: DemSettings,
    *,
    sizes: Callable[[int, np.random.Generator], Array] = choose_radii,
) -> RingCell:
    """Let rods settle in a drum, half of which they fill, first without friction.

    Returns
    -------
    RingCell
        The drum at rest, with friction; the core lies outside.

    Raises
    ------
    UnbalancedError
        If the bed does not come to rest.
    """
    radius = sizes(count, rng)
    ring = float(np.sqrt(2.0 * np.sum(radius**2) / SOLID_FRACTION))
    outside = {"ring": ring, "core": 0.1 * ring, "core_place": (0.0, 3.0 * ring)}
    frictionless = replace(settings, friction=0.0, wall_friction=0.0)
    soft = replace(frictionless, normal_stiffness=SOFTENING * settings.normal_stiffness, gravity=(0.0, 0.0))
    position = _scatter(count, rng, 0.0, ring - float(radius.max()))
    cell = RingCell(radius, position, settings=soft, drag=SOFT_DRAG, **outside)
    cell.run(np.zeros(SOFT_STEPS))
    cell = RingCell(radius, cell.position, settings=frictionless, drag=SETTLING_DRAG, **outside)
    _let_rest(cell)
    return RingCell(radius, cell.position, settings=settings, **outside)


def _let_rest(cell: RingCell) -> None:
    """Run until grains and ring are in equilibrium. Raises UnbalancedError."""
    for _ in range(LOADING_ROUNDS):
        cell.run(np.zeros(LOADING_STEPS))
        if cell.unbalance < PREPARED and cell.plate_unbalance < PREPARED:
            return
    count = cell.grains.count
    raise UnbalancedError(f"the packing of {count} rods did not come to rest: unbalance {cell.unbalance:.2g}")


def _scatter(count: int, rng: np.random.Generator, core: float, ring: float) -> Array:
    """Return positions (n, 2) [m], uniform between two circles: a jittered golden-angle spiral."""
    fraction = (np.arange(count) + 0.5) / count
    distance = np.sqrt(core**2 + fraction * (ring**2 - core**2))
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    cell = np.sqrt(np.pi * (ring**2 - core**2) / count)
    position = distance[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return position + 0.3 * JITTER * cell * rng.uniform(-1.0, 1.0, (count, 2))
