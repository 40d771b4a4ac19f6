"""How the truths of worlds are simulated: a packing is prepared, then its frame moves from photograph to photograph."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from solver.bodies.grains import Array
from solver.dem.ring import CIRCLE_NAMES, CIRCLE_SIDES, RingCell
from solver.dem.simulation import DemFrame, DemSettings, DemTruth, ShearCell, shear_photographs

from ...progress import Progress, silent
from ..dense_packing import choose_radii, prepare_packing
from ..placement import cut_sides, place_in_picture
from ..ring_packing import prepare_ring
from .periodic_packing import prepare_periodic

MARGIN = 0.02  # [m] from the origin to the packing
SPAN = 1.25  # length of the bars at bottom and top over the first width, where the right side moves
HEADROOM = 1.3  # height of the open box over that of the heap in it
HEAP_PRESSURE = 500.0  # [Pa] under which a heap is packed before its weight takes over
GREATEST_PRESSURE = 3.0  # of isotropic loading, over the first
SWING, SWING_FRAMES = 0.4, 8  # of loads that rise and fall: share of the pressure, photographs of a whole swing
CORE_TURN = 0.02  # [rad] by which the core turns while it is pushed on
RESTS = 8  # pauses that a heap is given to come to rest


@dataclass(frozen=True, slots=True)
class Course:
    """One simulation but for its seed and size."""

    motion: Callable[[Any, Course], Iterator[DemFrame]]  # of a ShearCell, or of a RingCell where `ring` says so
    step: float  # of the motion between photographs
    before: float = 0.0  # of simple shear: gone through before the first photograph [°]
    frames: int = 12
    settings: DemSettings = field(default_factory=DemSettings)
    plates: tuple[str, ...] = ()  # walls that carry the settings' pressure, and are told to
    measured: tuple[str, ...] = ()  # walls whose load is told as sensors measured it
    sizes: Callable[[int, np.random.Generator], Array] = choose_radii
    loose: bool = False  # packed with friction
    open_top: bool = False  # a heap under its weight
    periodic: bool = False  # in simple shear, without walls
    ring: bool = False  # between two circles


def simulate_course(course: Course, grains: int, seed: int, progress: Progress = silent) -> DemTruth:
    """Simulate the photographs of a course; the same arguments give the same bits.

    Raises UnbalancedError when the packing does not come to rest.
    """
    progress("simulate", 0, course.frames)
    rng = np.random.default_rng(seed)
    if course.periodic:
        return _simulate_periodic(course, grains, rng, progress)
    cell = _prepare_heap(course, grains, rng) if course.open_top else _prepare(course, grains, rng)
    frames = []
    for frame in course.motion(cell, course):
        frames.append(frame)
        progress("simulate", len(frames), course.frames)
    if course.ring:
        circles = DemTruth.of_frames(
            cell.grains.radius, frames, course.settings, wall_names=CIRCLE_NAMES, side=CIRCLE_SIDES
        )
        return place_in_picture(circles, MARGIN)
    truth = DemTruth.of_frames(cell.grains.radius, frames, course.settings)
    if course.open_top:
        truth = truth.without_wall("top")
    return place_in_picture(cut_sides(truth) if course.motion in (shear, shear_under_loads) else truth, MARGIN)


def shear(cell: ShearCell, course: Course) -> Iterator[DemFrame]:
    """Simple shear under the plate's pressure; step [°]."""
    return shear_photographs(cell, np.deg2rad(course.before + course.step * np.arange(course.frames)))


def _simulate_periodic(course: Course, grains: int, rng: np.random.Generator, progress: Progress) -> DemTruth:
    """Simple shear of a periodic cell under constant pressure; step, before [°]."""
    cell, frames = prepare_periodic(grains, rng, course.settings), []
    cell.rest()
    for k in range(course.frames):
        wanted = np.tan(np.deg2rad(course.before + k * course.step))
        if wanted != cell.shear:
            cell.shear_to(float(wanted))
        frames.append(cell.photograph(cell.rest()))
        progress("simulate", len(frames), course.frames)
    return DemTruth.of_frames(cell.grains.radius, frames, course.settings)


def compress_biaxially(cell: ShearCell, course: Course) -> Iterator[DemFrame]:
    """The plate goes down at a given rate, the right side gives way under constant pressure; step: axial strain."""
    pressure = course.settings.pressure * course.settings.length
    cell.load(top=np.nan, side=pressure * cell.side_length)
    first = cell.height
    for k in range(course.frames):
        if k:
            cell.move_to(height=first * (1.0 - k * course.step))
        yield cell.photograph(cell.rest())


def load_isotropically(cell: ShearCell, course: Course) -> Iterator[DemFrame]:
    """Plate and right side are loaded more and more, then less and less again; step: of nothing."""
    length, turn = course.settings.length, (course.frames - 1) / 2.0
    for k in range(course.frames):
        rise = 1.0 - abs(k - turn) / turn if turn else 0.0
        pressure = course.settings.pressure * (1.0 + (GREATEST_PRESSURE - 1.0) * rise)
        cell.load(top=pressure * cell.width * length, side=pressure * cell.height * length)
        yield cell.photograph(cell.rest())


def shear_under_loads(cell: ShearCell, course: Course) -> Iterator[DemFrame]:
    """Simple shear while the loads on plate and right side rise and fall against each other; step [°]."""
    length, pressure = course.settings.length, course.settings.pressure
    for k in range(course.frames):
        swing = SWING * np.sin(2.0 * np.pi * k / SWING_FRAMES)
        top, side = pressure * (1.0 + swing), pressure * (1.0 - 0.5 * swing)
        cell.load(top=top * cell.width * length, side=side * cell.height * length)
        cell.shear_to(float(np.deg2rad(course.before + course.step * k)))
        yield cell.photograph(cell.rest())


def push_core(cell: RingCell, course: Course) -> Iterator[DemFrame]:
    """The core is pushed and turned through the packing, the ring under its pressure; step: over the ring's radius."""
    way = course.step * cell.ring
    for k in range(course.frames):
        if k:
            cell.move_core((way, 0.0), CORE_TURN)
        cell.press()
        yield cell.photograph(cell.rest())


def push_heap(cell: ShearCell, course: Course) -> Iterator[DemFrame]:
    """The right side is pushed against a heap with a free surface; step: over the first width."""
    first = cell.width
    for k in range(course.frames):
        if k:
            cell.move_to(width=first * (1.0 - k * course.step))
        yield cell.photograph(cell.rest())


def shear_purely(cell: ShearCell, course: Course) -> Iterator[DemFrame]:
    """The plate goes down and the right side out, the area being kept; step: strain of the height."""
    width, height = cell.width, cell.height
    for k in range(course.frames):
        if k:
            stretch = (1.0 - course.step) ** k
            cell.move_to(height=height * stretch, width=width / stretch)
        yield cell.photograph(cell.rest())


def _prepare(course: Course, grains: int, rng: np.random.Generator) -> ShearCell:
    """A packing at rest under the plate's pressure; where no plate carries any later, it is held from now on."""
    if course.ring:
        return prepare_ring(grains, rng, course.settings, sizes=course.sizes)
    cell = prepare_packing(grains, rng, course.settings, sizes=course.sizes, loose=course.loose)
    if course.motion is shear:
        return cell
    packed = ShearCell(
        cell.grains.radius, cell.position, width=cell.width, height=cell.height, settings=course.settings,
        span=SPAN * cell.width,
    )  # fmt: skip
    packed.rest()
    if not (course.plates or course.measured):
        packed.load(top=np.nan)
    return packed


def _prepare_heap(course: Course, grains: int, rng: np.random.Generator) -> ShearCell:
    """Rods packed under a light plate; the plate taken away, their weight holds them."""
    light = replace(course.settings, pressure=HEAP_PRESSURE, gravity=(0.0, 0.0))
    cell = prepare_packing(grains, rng, light, aspect=0.8, sizes=course.sizes)
    heap = ShearCell(
        cell.grains.radius, cell.position, width=cell.width, height=HEADROOM * cell.height, settings=course.settings,
        span=SPAN * cell.width,
    )  # fmt: skip
    for _ in range(RESTS):
        heap.rest()
        if heap.unbalance < course.settings.rest:
            break
    return heap
