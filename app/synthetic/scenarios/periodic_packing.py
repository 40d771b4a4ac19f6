"""Rods packed in a periodic cell: the initial state of experiments without walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...solver.dem.dem_truth import DemSettings, UnbalancedError
from ...solver.dem.periodic_cell import PeriodicCell
from ..dense_packing import JITTER, LOOSENESS, PREPARED, SOFTENING, SOLID_FRACTION, choose_radii

SOFT_STEPS, SOFT_DRAG = 4000, 50.0  # –, [1/s]
LOADING_STEPS, LOADING_DRAG = 5000, 20.0  # between two checks of the balance, [1/s]
LOADING_ROUNDS = 40


def prepare_periodic(count: int, rng: np.random.Generator, settings: DemSettings) -> PeriodicCell:
    """Compress rods without friction in a square periodic cell to the settings' pressure.

    Returns
    -------
    PeriodicCell
        The cell at rest, with friction.

    Raises
    ------
    UnbalancedError
        If the packing does not come to rest.
    """
    radius = choose_radii(count, rng)
    side = float(np.sqrt(LOOSENESS * np.pi * np.sum(radius**2) / SOLID_FRACTION))
    columns = max(1, round(np.sqrt(count)))
    rows = -(-count // columns)
    site = np.stack(np.divmod(np.arange(count), columns)[::-1], axis=1)
    position = (site + 0.5 + rng.uniform(-JITTER, JITTER, (count, 2))) * (side / np.array([columns, rows]))

    frictionless = replace(settings, friction=0.0)
    soft = replace(frictionless, normal_stiffness=SOFTENING * settings.normal_stiffness)
    pushed = PeriodicCell(radius, position, side * np.eye(2), settings=soft, drag=SOFT_DRAG)
    pushed.run(np.zeros(SOFT_STEPS))
    packed = PeriodicCell(radius, pushed.position, pushed.vectors, settings=frictionless, drag=LOADING_DRAG)
    for _ in range(LOADING_ROUNDS):
        packed.run(np.zeros(LOADING_STEPS))
        if packed.unbalance < PREPARED and abs(packed.pressure / settings.pressure - 1.0) < PREPARED:
            return PeriodicCell(radius, packed.position, packed.vectors, settings=settings)
    raise UnbalancedError(f"the packing of {count} rods did not come to rest: unbalance {packed.unbalance:.2g}")
