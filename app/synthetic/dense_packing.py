"""Dense packings of rods in a rectangular frame: the initial state of a synthetic experiment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..solver.bodies.grains import Array
from ..solver.dem.dem_truth import DemSettings, UnbalancedError
from ..solver.dem.shear_cell import FrameSize, ShearCell

RADIUS_CLASSES = (0.007, 0.008, 0.011)  # [m], rods of 14, 16 and 22 mm
CLASS_FRACTIONS = (0.40, 0.41, 0.19)  # by number: 1172 rods then fill 0.5 × 0.6 m
WIDE_RADII = (0.004, 0.020)  # [m], least and greatest
TWO_RADII = (0.007, 0.0098)  # [m], 1 : 1.4, which prevents crystals
SOLID_FRACTION = 0.845  # of a dense frictionless packing in two dimensions
LOOSENESS = 1.1  # initial height over the dense one
JITTER = 0.3  # of a lattice cell, either way
SOFTENING = 1e-3  # factor of the springs' stiffness while overlaps are removed
SOFT_STEPS, SOFT_DRAG = 4000, 50.0  # –, [1/s]
LOADING_STEPS, LOADING_DRAG = 5000, 20.0  # between two checks of the balance, [1/s]
LOADING_ROUNDS, ROUNDS_OF = (
    40,
    2000,
)  # at most, for this many rods; beyond, proportional to the rows of rods
USUAL_STIFFNESS = 2e7  # [N/m]
PREPARED = 1e-3  # force residual of grains and plate at which a packing is at rest


def choose_radii(count: int, rng: np.random.Generator) -> Array:
    """Draw count radii (n,) [m] in the fixed fractions, in random order."""
    fractions = np.cumsum(CLASS_FRACTIONS)
    classes = np.searchsorted(fractions, (np.arange(count) + 0.5) / count)
    return rng.permutation(np.array(RADIUS_CLASSES)[np.minimum(classes, len(RADIUS_CLASSES) - 1)])


def choose_wide_radii(count: int, rng: np.random.Generator) -> Array:
    """Draw count radii (n,) [m] between WIDE_RADII, with equal area per size."""
    small, large = WIDE_RADII
    return 1.0 / rng.uniform(1.0 / large, 1.0 / small, count)


def choose_two_radii(count: int, rng: np.random.Generator) -> Array:
    """Draw count radii (n,) [m], half of them of each of TWO_RADII, in random order."""
    return rng.permutation(np.array(TWO_RADII)[np.arange(count) % 2])


def prepare_packing(
    count: int,
    rng: np.random.Generator,
    settings: DemSettings,
    *,
    aspect: float = 1.2,
    sizes: Callable[[int, np.random.Generator], Array] = choose_radii,
    loose: bool = False,
    corner_radius: float = 0.0,
) -> ShearCell:
    """Compress rods under the settings' pressure.

    The rods start on a jittered lattice, soft springs remove the overlaps, then the plate is loaded; a drag force, used
    in the preparation only, dissipates the energy.

    Parameters
    ----------
    count : int
    rng : numpy.random.Generator
    settings : DemSettings
    aspect : float
        Height over width.
    sizes : callable
        Draws the radii (n,) [m].
    loose : bool
        Compress with friction, so that fewer contacts bear; default: without.
    corner_radius : float
        Of discs where the bars meet [m]; 0: none.

    Returns
    -------
    ShearCell
        The cell at rest, with friction.

    Raises
    ------
    UnbalancedError
        If the packing does not come to rest.
    """
    radius = sizes(count, rng)
    discs = np.pi * corner_radius**2  # [m²] of the frame that four of them cover
    width = float(np.sqrt((np.pi * np.sum(radius**2) / SOLID_FRACTION + discs) / aspect))
    height = LOOSENESS * aspect * width
    columns = max(1, round(np.sqrt(count * width / height)))
    rows = -(-count // columns)
    cell_size = np.array([width / columns, height / rows])
    site = np.stack(np.divmod(np.arange(count), columns)[::-1], axis=1)
    position = (site + 0.5 + rng.uniform(-JITTER, JITTER, (count, 2))) * cell_size

    frictionless = replace(settings, friction=0.0, wall_friction=0.0)
    soft = replace(frictionless, normal_stiffness=SOFTENING * settings.normal_stiffness, pressure=float("nan"))

    def place(
        settings: DemSettings, at: Array, height: float, drag: float = 0.0, axis: Array | None = None
    ) -> ShearCell:
        frame = FrameSize(width, height, corner_radius=corner_radius)
        return ShearCell(radius, at, frame, settings, drag=drag, axis=axis)

    cell = place(soft, position, height, SOFT_DRAG)
    cell.run(np.zeros(SOFT_STEPS))
    loading = settings if loose else frictionless
    cell = place(loading, cell.position, height, LOADING_DRAG, cell.axis)
    stiffness = max(settings.normal_stiffness / USUAL_STIFFNESS, 1.0)  # a step is shorter by its root
    for _ in range(round(LOADING_ROUNDS * (stiffness * max(count / ROUNDS_OF, 1.0)) ** 0.5)):
        cell.run(np.zeros(LOADING_STEPS))
        if cell.unbalance < PREPARED and cell.plate_unbalance < PREPARED:
            return place(settings, cell.position, cell.height, axis=cell.axis)
    raise UnbalancedError(f"the packing of {count} rods did not come to rest: unbalance {cell.unbalance:.2g}")
