"""Loading paths of the simulated tests: a packing is prepared, then its frame moves from photograph to photograph."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from ...process.progress import Progress, no_progress
from ...solver.bodies.grains import Array
from ...solver.dem.dem_truth import DemFrame, DemSettings, DemTruth
from ...solver.dem.ring_cell import CIRCLE_NAMES, CIRCLE_SIDES, RingCell
from ...solver.dem.shear_cell import FrameSize, ShearCell, shear_photographs
from ...solver.dem.simulation import Simulation
from ..dense_packing import choose_radii, prepare_packing
from ..placement import cut_sides, place_in_picture, tilt_box
from ..ring_packing import prepare_ring
from .periodic_packing import prepare_periodic

MARGIN = 0.02  # [m] from the origin to the packing
SPAN = 1.25  # length of the bars at bottom and top over the initial width, where the right side moves
BOX_HEIGHT = 1.3  # height of the open box over that of the heap in it
HEAP_PRESSURE = 500.0  # [Pa] under which a heap is packed before its weight alone acts
GREATEST_PRESSURE = 3.0  # of isotropic loading, over the initial pressure
LOAD_AMPLITUDE, LOAD_PERIOD = 0.4, 8  # of oscillating loads: over the pressure, [photographs]
LOAD_RISE, LATE_FACTOR = 1.05, 2.0  # of stepped loads: of the plate's a photograph, of the side's in the second half
CORE_ROTATION = 0.02  # [rad] of the core per photograph
AMPLITUDE = 4  # of cyclic shear [steps]
RESTS = 8  # relaxations of a heap, at most
Cell = TypeVar("Cell", bound=Simulation)


@dataclass(frozen=True, slots=True)
class LoadingPath:
    """One simulation except for its seed and size."""

    motion: Callable[[Any, LoadingPath], Iterator[DemFrame]]  # of a ShearCell, or of a RingCell if `ring` is true
    step: float  # of the motion between photographs
    initial_shear: float = 0.0  # of simple shear, at the first photograph [°]
    frames: int = 12
    settings: DemSettings = field(default_factory=DemSettings)
    plates: tuple[str, ...] = ()  # walls under the settings' pressure, which the experiment file states
    measured: tuple[str, ...] = ()  # walls whose measured load the experiment file states
    sizes: Callable[[int, np.random.Generator], Array] = choose_radii
    loose: bool = False  # packed with friction
    open_top: bool = False  # a heap under its weight
    periodic: bool = False  # in simple shear, without walls
    ring: bool = False  # between two circles
    bed: bool = False  # of an apparatus of `bed_paths`


def simulate_loading(loading: LoadingPath, grains: int, seed: int, progress: Progress = no_progress) -> DemTruth:
    """Simulate the photographs of a loading path; the same arguments give the same bits.

    Parameters
    ----------
    loading : LoadingPath
    grains : int
    seed : int
    progress : Progress

    Raises
    ------
    UnbalancedError
        If the packing does not come to rest.
    """
    progress("simulate", 0, loading.frames)
    rng = np.random.default_rng(seed)
    if loading.periodic:
        return _simulate_periodic(loading, grains, rng, progress)
    cell = _prepare_heap(loading, grains, rng) if loading.open_top else _prepare(loading, grains, rng)
    frames = []
    for frame in loading.motion(cell, loading):
        frames.append(frame)
        progress("simulate", len(frames), loading.frames)
    if loading.ring:
        circles = DemTruth.of_frames(
            cell.grains.radius, frames, loading.settings, wall_names=CIRCLE_NAMES, side=CIRCLE_SIDES
        )
        return place_in_picture(circles, MARGIN)
    truth = DemTruth.of_frames(cell.grains.radius, frames, loading.settings)
    if loading.open_top:
        truth = truth.without_wall("top")
    if loading.motion is tilt_heap:
        truth = tilt_box(truth, np.deg2rad(loading.step * np.arange(loading.frames)))
    return place_in_picture(
        cut_sides(truth) if loading.motion in (shear, shear_under_loads, shear_cyclically) else truth, MARGIN
    )


def shear(cell: ShearCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Shear simply under the plate's pressure; step [°]."""
    return shear_photographs(cell, np.deg2rad(loading.initial_shear + loading.step * np.arange(loading.frames)))


def shear_cyclically(cell: ShearCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Shear to and fro by AMPLITUDE steps; step [°]."""
    k = np.arange(loading.frames)
    triangle = AMPLITUDE - np.abs((k % (2 * AMPLITUDE)) - AMPLITUDE)
    return shear_photographs(cell, np.deg2rad(loading.initial_shear + loading.step * triangle))


def _simulate_periodic(loading: LoadingPath, grains: int, rng: np.random.Generator, progress: Progress) -> DemTruth:
    """Shear a periodic cell simply under constant pressure; step, initial_shear [°]."""
    cell, frames = prepare_periodic(grains, rng, loading.settings), []
    cell.rest()
    for k in range(loading.frames):
        tangent = np.tan(np.deg2rad(loading.initial_shear + k * loading.step))
        if tangent != cell.shear:
            cell.shear_to(float(tangent))
        frames.append(cell.photograph(cell.rest()))
        progress("simulate", len(frames), loading.frames)
    return DemTruth.of_frames(cell.grains.radius, frames, loading.settings)


def compress_biaxially(cell: ShearCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Lower the plate at a given rate, the right side under constant pressure; step: axial strain."""
    pressure = loading.settings.pressure * loading.settings.length
    first = cell.height
    for k in range(loading.frames):
        cell.load(top=np.nan, side=pressure * cell.height)  # over the part of the bar that rods touch
        if k:
            cell.move_to(height=first * (1.0 - k * loading.step))
        yield cell.photograph(cell.rest())


def load_isotropically(cell: ShearCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Raise the loads on plate and right side, then lower them; step is not used."""
    length, peak = loading.settings.length, (loading.frames - 1) / 2.0
    for k in range(loading.frames):
        rise = 1.0 - abs(k - peak) / peak if peak else 0.0
        pressure = loading.settings.pressure * (1.0 + (GREATEST_PRESSURE - 1.0) * rise)
        _press(cell, pressure, pressure, length)
        yield cell.photograph(cell.rest())


def step_loads(cell: ShearCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Raise the load on the plate a little every photograph, and double that on the right side once; no step."""
    length, pressure = loading.settings.length, loading.settings.pressure
    for k in range(loading.frames):
        side = pressure * (LATE_FACTOR if k > loading.frames // 2 else 1.0)
        _press(cell, LOAD_RISE**k * pressure, side, length)
        yield cell.photograph(cell.rest())


def shear_under_loads(cell: ShearCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Shear simply while the loads on plate and right side oscillate in opposition; step [°]."""
    length, pressure = loading.settings.length, loading.settings.pressure
    for k in range(loading.frames):
        variation = LOAD_AMPLITUDE * np.sin(2.0 * np.pi * k / LOAD_PERIOD)
        top, side = pressure * (1.0 + variation), pressure * (1.0 - 0.5 * variation)
        _press(cell, top, side, length)
        cell.shear_to(float(np.deg2rad(loading.initial_shear + loading.step * k)))
        yield cell.photograph(cell.rest())


def _press(cell: ShearCell, top: float, side: float, length: float) -> None:
    """Load plate and right side of the cell by pressures [Pa] on the parts that the packing of rods fills."""
    cell.load(top=top * cell.width * length, side=side * cell.height * length)


def push_core(cell: RingCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Push and rotate the core through the packing, the ring under its pressure; step: over the ring's radius."""
    distance = loading.step * cell.ring
    for k in range(loading.frames):
        if k:
            cell.move_core((distance, 0.0), CORE_ROTATION)
        cell.press()
        yield cell.photograph(cell.rest())


def turn_core(cell: RingCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Turn the core in its place, the ring under its pressure: an annular shear cell; step: rotation [rad]."""
    for k in range(loading.frames):
        if k:
            cell.move_core((0.0, 0.0), loading.step)
        cell.press()
        yield cell.photograph(cell.rest())


def tilt_heap(cell: ShearCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Tilt a box with a free surface, counter-clockwise; step [°]. The photographs are those of the box at rest."""
    for k in range(loading.frames):
        cell.tilt(float(np.deg2rad(loading.step * k)))
        yield cell.photograph(cell.rest())


def push_heap(cell: ShearCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Push the right side against a heap with a free surface; step: over the initial width."""
    first = cell.width
    for k in range(loading.frames):
        if k:
            cell.move_to(width=first * (1.0 - k * loading.step))
        yield cell.photograph(cell.rest())


def shear_purely(cell: ShearCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Lower the plate and move the right side outward at constant area; step: strain of the height."""
    width, height = cell.width, cell.height
    for k in range(loading.frames):
        if k:
            stretch = (1.0 - loading.step) ** k
            cell.move_to(height=height * stretch, width=width / stretch)
        yield cell.photograph(cell.rest())


def _prepare(loading: LoadingPath, grains: int, rng: np.random.Generator) -> ShearCell | RingCell:
    """Return a packing at rest under the plate's pressure; the plate is then held where it carries no load later."""
    if loading.ring:
        return prepare_ring(grains, rng, loading.settings, sizes=loading.sizes)
    cell = prepare_packing(grains, rng, loading.settings, sizes=loading.sizes, loose=loading.loose)
    if loading.motion in (shear, shear_cyclically):
        return cell
    packed = ShearCell(
        cell.grains.radius,
        cell.position,
        FrameSize(cell.width, cell.height, SPAN * cell.width),
        loading.settings,
        axis=cell.axis,
    )
    packed.rest()
    if not (loading.plates or loading.measured):
        packed.load(top=np.nan)
    return packed


def _prepare_heap(loading: LoadingPath, grains: int, rng: np.random.Generator) -> ShearCell:
    """Pack rods under a light plate and remove it, so that their weight holds them."""
    light = replace(loading.settings, pressure=HEAP_PRESSURE, gravity=(0.0, 0.0))
    cell = prepare_packing(grains, rng, light, aspect=0.8, sizes=loading.sizes)
    heap = ShearCell(
        cell.grains.radius,
        cell.position,
        FrameSize(cell.width, BOX_HEIGHT * cell.height, SPAN * cell.width),
        loading.settings,
        axis=cell.axis,
    )
    return rested(heap)


def rested(cell: Cell) -> Cell:
    """Relax a packing under its weight, RESTS times at most, and return it."""
    for _ in range(RESTS):
        cell.rest()
        if cell.unbalance < cell.settings.rest:
            break
    return cell
