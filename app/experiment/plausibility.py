"""Check that tracks, radii, walls and loads fit together: wrong units, origins and directions are refused early."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, KDTree

from ..process.counts import state_count
from ..process.errors import InputError
from ..solver.bodies.grains import Array
from ..solver.bodies.rods import EARTH_GRAVITY
from ..solver.bodies.wall_shapes import (
    IN,
    OUT,
    STRAIGHT,
    beside_wall,
    bounding_distance,
    outward_normals,
    wall_distance,
)
from ..solver.boundary.continuation import bearing_past_ends
from ..solver.calibration.gaps import MeasuredSequence
from ..tracks import Tracks, WallTracks
from .boundary import free_surfaces
from .config.corrections import DIGITS, GREATEST_RADIUS, SOLID_DENSITIES, look_like_millimetres
from .config.tuning_sections import MaterialSection
from .experiment import Experiment

NEIGHBOURS = 8  # nearest centres of a grain, which include the one closest in units of radii
SPACING = (0.93, 1.15)  # of neighbours over their radii, median: packed rods touch, whatever the noise
GREATEST_FRACTION = 2.0  # of the packing's diagonal: no radius is larger
MISTAKE_TOLERANCE = 0.15  # relative difference between a spacing and that of a known mistake, at most
HEAVIEST_IN_G_PER_CM3 = 1e-3 * SOLID_DENSITIES[1]
STRENGTH = 1e8  # [Pa] mean stress: contacts of rods then carry several times that, and metals yield
OPEN = 1e-5  # [rad] two parallel walls face each other within this
FACING_DECIMALS = 6  # of the angles of walls [rad] that face the same way
SIDE_OF_PACKING = {
    STRAIGHT: "to the left of the line from (x1, y1) to (x2, y2)",
    IN: "inside the circle (its side is in)",
    OUT: "outside the circle (its side is out)",
}
CUT = 0.5  # radii between a rod's centre and the line of a wall that cuts through it, at most
SOLID_FRACTION, RIM_POINTS, FEWEST_ENCLOSING = 0.8, 12, 5  # of a dense packing; of a rod's outline; rods with an area
MAX_DISTANCE = 1.0  # widths of the packing between it and a wall, at most


@dataclass(frozen=True, slots=True)
class PackingSources:
    """Where the parts of a packing are given: files and keys of an experiment, or arguments in Python."""

    radii: tuple[Path | str, str]  # file or argument, and the column or key in it
    precision: tuple[Path | str, str] | None  # of given tracks; None: tracked from photographs
    walls: Mapping[int, Path | str]  # by the side of a wall
    pixel_size: float | None = None  # [m] of the photographs; None: none, or not yet known

    @classmethod
    def of(cls, experiment: Experiment) -> PackingSources:
        """Return the files and keys of an experiment."""
        config, folder, file = experiment.config, experiment.folder, experiment.file
        radii = file, "key photographs.pixel_size or photographs.radii"
        precision, walls = None, {}
        if config.tracks is not None:
            radii = folder / config.tracks.grains, "column radius"
            precision = file, f"key tracks.precision = {config.tracks.precision:g}"
        if config.walls is not None:
            straight, round_ = (config.walls.file or config.walls.corners, config.walls.arcs or config.walls.corners)
            walls = {STRAIGHT: folder / (straight or ""), IN: folder / (round_ or ""), OUT: folder / (round_ or "")}
        pixel = None if config.photographs is None else config.photographs.pixel_size
        return cls(radii, precision, walls, pixel if isinstance(pixel, float) else None)


def check_packing(experiment: Experiment, tracks: Tracks, walls: WallTracks) -> list[str]:
    """Return warnings about rods, walls and loads. Raises InputError where they cannot be right."""
    sources = PackingSources.of(experiment)
    check_inside(sources, tracks, walls)
    check_radii(sources, tracks)
    bounded_by_walls = walls.cell is None and tracks.boundary is None
    return [
        *implausible_density(experiment.config.material.density),
        *(open_sides(walls, experiment.config.material.gravity) if bounded_by_walls else []),
        *implausible_walls(experiment, tracks, walls),
    ]


def implausible_walls(experiment: Experiment, tracks: Tracks, walls: WallTracks, *, enclosed: bool = True) -> list[str]:
    """Describe rods beyond the ends of walls, loads that cannot be right, and sides where no rod touches a wall.

    enclosed: False: a side without any wall is reported elsewhere, and none is sought.
    """
    return [
        *rods_beyond_ends(tracks, walls),
        *implausible_loads(experiment.config.material, tracks, walls),
        *(free_surfaces(experiment, tracks, walls) if enclosed else []),
    ]


def check_radii(sources: PackingSources, tracks: Tracks, *, packed: bool = True) -> None:
    """Raise InputError where nearest neighbours are not about the sum of two radii apart, since packed rods touch.

    Typical causes are diameters given as radii, a wrong unit or a wrong scale. packed: False: grains need not touch.
    """
    file, key = sources.radii
    middle = float(np.median(tracks.radius))
    if middle > GREATEST_RADIUS:
        guess = "; they look like millimetres" if look_like_millimetres(middle) else ""
        raise InputError(file, key, f"makes the median radius {middle:g} m: lengths are in metres{guess}")
    if sources.precision is not None and np.nanmin(tracks.sigma) > middle:
        raise InputError(
            *sources.precision,
            f"is more than the rods' radius, {middle:g} m: one of them is in another unit",
        )  # fmt: skip
    here, largest = tracks.position[0][tracks.present[0]], int(np.argmax(tracks.radius))
    across = float(np.hypot(*np.ptp(here, axis=0))) if len(here) > 2 else np.inf
    if tracks.radius[largest] > max(GREATEST_FRACTION * across, middle):
        raise InputError(
            file, key, f"makes grain {tracks.id[largest]} larger than the packing: its radius is "
            f"{tracks.radius[largest]:g} m, and all centres lie within {across:.3g} m",
        )  # fmt: skip
    spacing = neighbour_spacing(tracks.position[0][tracks.present[0]], tracks.radius[tracks.present[0]])
    if packed and len(spacing) and not SPACING[0] <= (found := float(np.median(spacing))) <= SPACING[1]:
        state = "overlap" if found < 1.0 else "stand apart"
        raise InputError(
            file, key, f"does not fit the positions: neighbours {state}, their distance is {found:.2f} times the "
            "sum of their radii (median of frame 0); radii, not diameters, in the unit of the positions"
            f"{_cause_of_spacing(found)}",
        )  # fmt: skip


def _cause_of_spacing(found: float) -> str:
    """Return the mistake that a spacing of neighbours, over the sum of their radii, suggests."""
    causes = (
        (0.5, "radii look like diameters"),
        (2.0, "radii look halved, or every other grain is missing"),
        (1e3, "coordinates look like millimetres"),
        (1e-3, "radii look like millimetres"),
    )
    return next((f": {cause}" for factor, cause in causes if abs(found / factor - 1.0) < MISTAKE_TOLERANCE), "")


def implausible_density(density: float) -> list[str]:
    """Return a warning where a density [kg/m³] is the number of a heavy metal in g/cm³; foams alone are so light."""
    if density > HEAVIEST_IN_G_PER_CM3:
        return []
    return [
        f"material.density = {density:g} kg/m³ is that of the lightest foams: if it is in g/cm³, write density = "
        f"{1e3 * density:.{DIGITS}g}"
    ]


def _touched_fraction(tracks: Tracks, walls: WallTracks, w: int) -> float:
    """Fraction of the length of wall w beside which grains of the first photograph are, as of a high wall of a bed."""
    bar = walls.endpoints[0, w, 1] - walls.endpoints[0, w, 0]
    length = float(np.hypot(*bar))
    if walls.sides[w] != STRAIGHT or not length > 0.0:
        return 1.0
    along = tracks.position[0, tracks.present[0]] @ (bar / length)
    return min(float(np.ptp(along) + 2.0 * tracks.radius.mean()) / length, 1.0)


def implausible_loads(material: MaterialSection, tracks: Tracks, walls: WallTracks) -> list[str]:
    """Return a warning for every pressure or load that is possible but implausible: very small, or above STRENGTH.

    A very small load is less than a tenth of the pressure of the rods' own weight, if they lay upon one another.
    """
    sentences = []
    here = tracks.present[0]
    width = float(np.ptp(tracks.position[0, here, 0])) if here.any() else 0.0
    if width <= 0.0:
        return []
    area = float(np.sum(np.pi * tracks.radius[here] ** 2))
    weight = material.density * EARTH_GRAVITY * area / width  # [Pa], per length
    usual = walls.usual_pressure(material.length)
    for w in np.flatnonzero(walls.loaded & np.isnan(walls.pressure)).tolist():
        name, pressure = walls.name[w], float(usual[w]) / _touched_fraction(tracks, walls, w)
        if pressure < 0.1 * weight or pressure > STRENGTH:
            kind = "little beside the pressure of the rods' own weight" if pressure < weight else "more than rods carry"
            sentences.append(f"the load on wall {name!r} makes {pressure:.3g} Pa on average, {kind}: is it in newtons?")
    for name, pressure in zip(walls.name, walls.pressure, strict=True):
        if pressure < 0.1 * weight:
            sentences.append(
                f"walls.{name}.pressure = {pressure:g} Pa is little beside the {weight:.2g} Pa of the rods' own "
                f"weight: did you mean {pressure:g}e3 Pa?"
            )
        elif pressure > STRENGTH:
            sentences.append(
                f"walls.{name}.pressure = {pressure:g} Pa is more than rods carry without yielding: did you mean "
                f"{pressure / 1e3:g} Pa?"
            )
    return sentences


def rods_cut_by_walls(tracks: Tracks, walls: WallTracks) -> dict[str, int]:
    """Return the number of rods of frame 0 that each straight wall cuts through, by the names of such walls.

    A wall cuts through a rod whose centre is within half a radius of its line, between its ends.
    """
    place, radius = tracks.position[0], tracks.radius
    found = {}
    for w in walls.straight:
        ends = np.broadcast_to(walls.endpoints[0, w], (len(place), 2, 2))
        distance = np.abs(wall_distance(ends, None, place)[0])
        cut = (distance < CUT * radius) & beside_wall(ends, None, place, np.zeros(len(place)))
        if cut.any():
            found[walls.name[w]] = int(cut.sum())
    return found


def expected_rods(tracks: Tracks) -> int:
    """Return about how many rods fill the area that those of frame 0 enclose, from their own sizes.

    Notes
    -----
    0.8 A / ⟨π R²⟩, with A the area of the convex hull of the rods; 0.8 is the solid fraction of a dense packing.
    """
    here = tracks.present[0]
    if np.count_nonzero(here) < FEWEST_ENCLOSING:
        return int(here.sum())
    area = enclosed_area(tracks.position[0, here], tracks.radius[here])
    return round(SOLID_FRACTION * area / float(np.mean(np.pi * tracks.radius[here] ** 2)))


def enclosed_area(position: Array, radius: Array) -> float:
    """Return the area of the convex hull of circles, from centres (n, 2) and radii (n,) in one unit of length."""
    return float(ConvexHull(rim_points(position, radius, RIM_POINTS)).volume)  # an area in the plane


def rim_points(position: Array, radius: Array, count: int) -> Array:
    """Return so many points on the rim of every circle (n count, 2), from centres (n, 2) and radii (n,) in one unit."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    rim = radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return (position[:, None] + rim).reshape(-1, 2)


def open_sides(walls: WallTracks, gravity: Sequence[float]) -> list[str]:
    """Return a warning where the walls of frame 0, taken as infinite lines, leave a direction open.

    Weight holds the rods as a wall above them would. Of walls that face the same way the outermost is named.
    """
    if walls.count == 0 or (walls.sides == IN).any():
        return []
    straight = np.flatnonzero(walls.sides == STRAIGHT)
    if not len(straight):
        return ["The boundary is open: no wall surrounds the rods."]
    ends = walls.endpoints[0, straight]
    inward = -outward_normals(ends)
    inmost_first = np.argsort(-(inward * ends.mean(axis=1)).sum(axis=1))
    by_angle = {_angle(*inward[w].tolist()): walls.name[straight[w]] for w in inmost_first}
    if any(gravity):
        by_angle.setdefault(_angle(*gravity), "")
    order = sorted(by_angle)
    angle = np.diff([*order, order[0] + 2.0 * np.pi])
    wide = int(np.argmax(angle))
    if angle[wide] < np.pi - OPEN:
        return []
    a, b = (by_angle[order[k % len(order)]] for k in (wide, wide + 1))
    where = f"between wall {a!r} and wall {b!r}" if a != b else f"opposite wall {a!r}"
    return [f"The boundary is open {where}: no wall confines the rods there."]


def _angle(x: float, y: float) -> float:
    """Return the angle of a direction [rad], rounded: what faces the same way has the same."""
    return round(math.atan2(y, x), FACING_DECIMALS)


def rods_beyond_ends(tracks: Tracks, walls: WallTracks) -> list[str]:
    """Return a warning for every wall whose line rods touch beyond its ends: walls are taken as infinite lines.

    Either the wall was measured too short, which does no harm, or these rods touch no wall and their forces are wrong.
    """
    nothing = np.zeros(tracks.position.shape[:2])
    sequence = MeasuredSequence(
        tracks.radius, tracks.position, nothing, tracks.present, walls.endpoints, nothing, walls.side,
        boundary=tracks.boundary,
    )  # fmt: skip
    sentences = []
    for w, rods in enumerate(bearing_past_ends(sequence).sum(axis=0).tolist()):
        if rods:
            sentences.append(
                f"{state_count(rods, 'rod')} may touch the line of wall {walls.name[w]!r} beyond its end: the "
                "wall is continued along them, unless calibration.walls_continue is false"
            )
    return sentences


def neighbour_spacing(position: Array, radius: Array) -> Array:
    """Return the smallest distance to another grain over the sum of their radii (n,).

    Parameters
    ----------
    position
        Centres (n, 2) [m].
    radius
        Radii (n,) [m].

    Notes
    -----
    min_j |x_j − x_i| / (R_i + R_j) over the NEIGHBOURS nearest centres j.
    """
    count = min(NEIGHBOURS + 1, len(radius))
    if count < 2:
        return np.empty(0)
    distance, other = (np.asarray(found) for found in KDTree(position).query(position, count))
    return (distance[:, 1:] / (radius[:, None] + radius[other[:, 1:]])).min(axis=1)


def check_inside(sources: PackingSources, tracks: Tracks, walls: WallTracks) -> None:
    """Raise InputError where a centre lies beyond a wall by more than its radius: a wrong unit, origin or direction.

    Rods of the boundary may lie anywhere, as those of a chain that is pulled out of an opening.
    """
    if walls.count == 0:
        return
    free = True if tracks.boundary is None else ~tracks.boundary
    margin = np.where(free, tracks.radius, np.inf)[:, None]
    found: dict[int, tuple[int, int, float]] = {}  # of every wall the first frame and row, and how far beyond [m]
    for k in range(tracks.frame_count):  # one by one: the distances from all walls in all frames take much memory
        beyond = -bounding_distance(walls.endpoints[k], walls.sides, tracks.position[k])[0]
        for row, w in np.argwhere(beyond > margin).tolist():  # NaN of lost grains compares false
            found.setdefault(w, (k, row, float(beyond[row, w])))
    if not found:
        return
    w = min(found)
    k, row, far = found[w]
    raise InputError(
        sources.walls[int(walls.sides[w])],
        f"frame {k}, wall {walls.name[w]!r}",
        f"grain {tracks.id[row]} lies {far * 1e3:.4g} mm beyond it; "
        f"the packing must lie {SIDE_OF_PACKING[int(walls.sides[w])]}, all in metres"
        f"{_cause_of_walls(sources.pixel_size, tracks, walls)}",
    )


def _cause_of_walls(pixel: float | None, tracks: Tracks, walls: WallTracks) -> str:
    """Return the mistake whose correction puts the grains of frame 0 between the walls; empty where they are."""
    ends, side = walls.endpoints[0], walls.sides
    place = tracks.position[0][tracks.present[0]]
    guesses = [
        ("walls look reversed", ends[:, ::-1], -side),
        ("walls look y-down", _upside_down(ends, place), side),
        ("walls look y-down", _upside_down(ends, place)[:, ::-1], side),
        ("walls look like millimetres", 1e-3 * ends, side),
    ]
    if pixel is not None:
        guesses.append(("walls look like pixels", pixel * ends, side))
        guesses.append(("walls look like pixels", _upside_down(pixel * ends, place), side))
    radius = tracks.radius[tracks.present[0]]
    if _all_inside(place, radius, ends, side):  # a single place of a later frame is wrong
        return ""
    if _all_inside(1e-3 * place, radius, ends, side):
        return ": coordinates look like millimetres"
    return next((f": {cause}" for cause, *guess in guesses if _all_inside(place, radius, *guess)), "")


def _upside_down(ends: Array, place: Array) -> Array:
    """Return the ends (w, 2, 2) with y reversed about the middle of the packing (n, 2)."""
    flipped = ends.copy()
    middle = 0.5 * (place[:, 1].min() + place[:, 1].max()) + 0.5 * (ends[..., 1].min() + ends[..., 1].max())
    flipped[..., 1] = middle - flipped[..., 1]
    return flipped


def _all_inside(place: Array, radius: Array, ends: Array, side: NDArray[np.int8]) -> bool:
    """Whether no centre (n, 2) lies beyond a wall (w, 2, 2) by more than its radius (n,), and no wall is far away."""
    beyond = -wall_distance(ends, side, place[:, None])[0]
    near = beyond.max(axis=0) > -MAX_DISTANCE * np.ptp(place, axis=0).max()
    return bool((beyond <= radius[:, None]).all() and near.all())
