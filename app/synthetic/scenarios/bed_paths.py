"""Loading paths of other apparatus: direct shear box, footing and intruder in a bed, drum, membrane."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...process.progress import Progress, no_progress
from ...solver.bodies.wall_shapes import Sides
from ...solver.dem.box_cell import BOX_NAMES, BoxCell, BoxSize, Tool
from ...solver.dem.dem_truth import WALL_NAMES, DemFrame, DemTruth
from ...solver.dem.membrane_cell import MembraneCell
from ...solver.dem.ring_cell import CIRCLE_NAMES, CIRCLE_SIDES, RingCell
from ...solver.dem.shear_cell import FrameSize
from ..dense_packing import prepare_packing
from ..placement import place_in_picture, tilt_box
from ..ring_packing import prepare_drum
from .loading_paths import BOX_HEIGHT, HEAP_PRESSURE, MARGIN, SPAN, LoadingPath, rested

BOX_ASPECT, BED_ASPECT = 0.7, 0.6  # height over width
MOBILISED = 8  # steps of the motion before the first photograph
FOOT_WIDTH = 0.25  # of a footing, over the width of the bed
INTRUDER_RADII = 3.0  # radius of an intruder over the greatest of a rod
FIRST_TILT = 6.0  # [°] of a drum before the first photograph


def simulate_bed(loading: LoadingPath, grains: int, seed: int, progress: Progress = no_progress) -> DemTruth:
    """Simulate the photographs of a loading path of this module; parameters and errors as of `simulate_loading`."""
    progress("simulate", 0, loading.frames)
    apparatus = APPARATUS[loading.motion]
    cell = apparatus.prepare(loading, grains, np.random.default_rng(seed))
    frames = []
    for frame in loading.motion(cell, loading):
        frames.append(frame)
        progress("simulate", len(frames), loading.frames)
    side: Sides = CIRCLE_SIDES if loading.motion is turn_drum else cell.sides
    truth = DemTruth.of_frames(cell.grains.radius, frames, loading.settings, wall_names=apparatus.names, side=side)
    for name in apparatus.absent:
        truth = truth.without_wall(name)
    if loading.motion is turn_drum:
        truth = tilt_box(truth, np.deg2rad(FIRST_TILT + loading.step * np.arange(loading.frames)))
    return place_in_picture(truth, MARGIN)


def slide_box(cell: BoxCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Slide the upper half of a shear box over the lower one, the plate under its pressure; step: over the width."""
    step = loading.step * cell.width
    cell.move(slide=MOBILISED * step)
    for k in range(loading.frames):
        if k:
            cell.move(slide=step)
        yield cell.photograph(cell.rest())


def press_footing(cell: BoxCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Press a bar into the surface of a bed; step: over the width of the bed."""
    return _move_tool(cell, loading, (0.0, -loading.step * cell.width))


def push_intruder(cell: BoxCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Push a disc sideways through a bed; step: over the width of the bed."""
    return _move_tool(cell, loading, (loading.step * cell.width, 0.0))


def _move_tool(cell: BoxCell, loading: LoadingPath, step: tuple[float, float]) -> Iterator[DemFrame]:
    cell.move(tool=(MOBILISED * step[0], MOBILISED * step[1]))
    for k in range(loading.frames):
        if k:
            cell.move(tool=step)
        yield cell.photograph(cell.rest())


def turn_drum(cell: RingCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Turn a drum with a bed in it, whose surface tilts until it flows; step [°].

    The simulation tilts gravity instead; the photographs are turned back afterwards.
    """
    for k in range(loading.frames):
        cell.tilt(float(np.deg2rad(FIRST_TILT + loading.step * k)))
        yield cell.photograph(cell.rest())


def compress_in_membrane(cell: MembraneCell, loading: LoadingPath) -> Iterator[DemFrame]:
    """Lower the plate on a packing beside a membrane; step: axial strain."""
    first = cell.height
    for k in range(MOBILISED, MOBILISED + loading.frames):
        cell.move_to(height=first * (1.0 - k * loading.step))
        yield cell.photograph(cell.rest())


def _prepare_membrane(loading: LoadingPath, grains: int, rng: np.random.Generator) -> MembraneCell:
    """Return a packing at rest under the pressure of the membrane on its right side."""
    packed = prepare_packing(grains, rng, loading.settings, sizes=loading.sizes)
    size = FrameSize(packed.width, packed.height, SPAN * packed.width)
    return rested(MembraneCell(packed.grains.radius, packed.position, size, loading.settings))


def _prepare_box(loading: LoadingPath, grains: int, rng: np.random.Generator) -> BoxCell:
    """Return a packing at rest under the plate's pressure, in a box that is split at half its height."""
    packed = prepare_packing(grains, rng, loading.settings, aspect=BOX_ASPECT, sizes=loading.sizes)
    size = BoxSize(packed.width, packed.height, 0.5 * packed.height)
    return rested(BoxCell(packed.grains.radius, packed.position, size, loading.settings))


def _prepare_footing(loading: LoadingPath, grains: int, rng: np.random.Generator) -> BoxCell:
    """Return a bed under its weight, with a bar on its surface."""
    bed = _prepare_bed(loading, grains, rng)
    radius, position, middle = bed.grains.radius, bed.position, 0.5 * bed.width
    width = FOOT_WIDTH * bed.width
    under = np.abs(position[:, 0] - middle) < 0.5 * width
    surface = float((position[:, 1] + radius)[under].max())
    size = BoxSize(bed.width, BOX_HEIGHT * bed.height)
    return rested(BoxCell(radius, position, size, loading.settings, tool=Tool(middle, surface, width=width)))


def _prepare_intruder(loading: LoadingPath, grains: int, rng: np.random.Generator) -> BoxCell:
    """Return a bed under its weight around a disc, whose place is cleared of rods."""
    bed = _prepare_bed(loading, grains, rng)
    radius, position = bed.grains.radius, bed.position
    disc = INTRUDER_RADII * float(radius.max())
    centre = np.array([0.4 * bed.width, 0.45 * float((position[:, 1] + radius).max())])
    beside = np.hypot(*(position - centre).T) >= disc + radius
    size = BoxSize(bed.width, BOX_HEIGHT * bed.height)
    return rested(
        BoxCell(radius[beside], position[beside], size, loading.settings, tool=Tool(*centre.tolist(), radius=disc))
    )


def _prepare_bed(loading: LoadingPath, grains: int, rng: np.random.Generator) -> BoxCell:
    """Pack rods under a light plate and remove it, so that their weight holds them."""
    light = replace(loading.settings, pressure=HEAP_PRESSURE, gravity=(0.0, 0.0))
    packed = prepare_packing(grains, rng, light, aspect=BED_ASPECT, sizes=loading.sizes)
    size = BoxSize(packed.width, BOX_HEIGHT * packed.height)
    return rested(BoxCell(packed.grains.radius, packed.position, size, loading.settings))


def _prepare_drum(loading: LoadingPath, grains: int, rng: np.random.Generator) -> RingCell:
    return prepare_drum(grains, rng, loading.settings, sizes=loading.sizes)


class _Apparatus(NamedTuple):
    prepare: Callable[[LoadingPath, int, np.random.Generator], Any]  # a Simulation
    names: tuple[str, ...]  # of the walls
    absent: tuple[str, ...]  # of those that it has not


_HALVES = ("top", "upper-right", "upper-left")
APPARATUS: dict[Callable[[Any, LoadingPath], Iterator[DemFrame]], _Apparatus] = {
    slide_box: _Apparatus(_prepare_box, BOX_NAMES, ("tool",)),
    press_footing: _Apparatus(_prepare_footing, (*BOX_NAMES[:-1], "footing"), _HALVES),
    push_intruder: _Apparatus(_prepare_intruder, (*BOX_NAMES[:-1], "intruder"), _HALVES),
    compress_in_membrane: _Apparatus(_prepare_membrane, WALL_NAMES, ("right",)),
    turn_drum: _Apparatus(_prepare_drum, CIRCLE_NAMES, ("core",)),
}
