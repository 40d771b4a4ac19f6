"""Whether tracks, radii and walls can belong together: mistaken units, origins and directions are refused early."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from solver.bodies.grains import Array
from solver.bodies.wall_shapes import IN, OUT, STRAIGHT, reach_of_wall

from ..errors import InputError
from ..tracks import Tracks, WallTracks
from .boundary import free_surfaces
from .experiment import Experiment

NEIGHBOURS = 8  # of a grain, among which is the one it is closest to in radii
SPACING = (0.93, 1.15)  # of neighbours over their radii, median: packed rods touch, whatever the noise
GREATEST_RADIUS = 0.5  # [m] of a rod
GREATEST_SHARE = 2.0  # of the packing's diagonal: no radius is larger
NEAR = 0.05  # radii from a wall's line: a rod as near as that may bear on it
BEYOND = 0.5  # radii past a wall's end
LIKE = 0.15  # relative difference up to which a spacing looks like a certain mistake
STRENGTH = 1e8  # [Pa] of the mean stress: contacts of rods then bear several times that, and metals yield
OPEN = 1e-6  # [rad] two parallel walls face each other within this
PLACE_OF_PACKING = {
    STRAIGHT: "to the left of the line from (x1, y1) to (x2, y2)",
    IN: "inside the circle (its side is in)",
    OUT: "outside the circle (its side is out)",
}
SPACIOUS = 1.0  # widths of the packing between it and a wall, from which on they do not belong together


def check_packing(experiment: Experiment, tracks: Tracks, walls: WallTracks) -> list[str]:
    """What is doubtful about rods, walls and loads, in sentences. Raises InputError where they cannot be right."""
    check_inside(experiment, tracks, walls)
    check_radii(experiment, tracks)
    sides = open_sides(walls) if walls.cell is None and tracks.boundary is None else []
    return [
        *rods_beyond_ends(tracks, walls),
        *doubtful_loads(experiment, tracks, walls),
        *sides,
        *free_surfaces(experiment, tracks, walls),
    ]


def check_radii(experiment: Experiment, tracks: Tracks) -> None:
    """Packed rods touch: their nearest neighbours must lie about the sum of two radii away.

    Diameters given as radii, another unit or another scale leave nothing to compute forces from.
    """
    section = experiment.config.tracks
    file = experiment.file if section is None else experiment.folder / section.grains
    key = "key photographs.pixel_size or photographs.radii" if section is None else "column radius"
    middle = float(np.median(tracks.radius))
    if middle > GREATEST_RADIUS:
        guess = "; they look like millimetres" if middle < 1e3 * GREATEST_RADIUS else ""
        raise InputError(file, key, f"makes the median radius {middle:g} m: lengths are in metres{guess}")
    if section is not None and section.precision > middle:
        raise InputError(
            experiment.file, f"key tracks.precision = {section.precision:g}",
            f"is more than the rods' radius, {middle:g} m: it is the standard deviation of a position, in metres",
        )  # fmt: skip
    here, largest = tracks.position[0][tracks.present[0]], int(np.argmax(tracks.radius))
    across = float(np.hypot(*np.ptp(here, axis=0))) if len(here) > 2 else np.inf
    if tracks.radius[largest] > max(GREATEST_SHARE * across, middle):
        raise InputError(
            file, key, f"makes grain {tracks.id[largest]} larger than the packing: its radius is "
            f"{tracks.radius[largest]:g} m, and all centres lie within {across:.3g} m",
        )  # fmt: skip
    spacing = neighbour_spacing(tracks.position[0][tracks.present[0]], tracks.radius[tracks.present[0]])
    if len(spacing) and not SPACING[0] <= (found := float(np.median(spacing))) <= SPACING[1]:
        state = "overlap" if found < 1.0 else "stand apart"
        raise InputError(
            file, key, f"does not fit the positions: neighbours {state}, their distance is {found:.2f} times "
            f"the sum of their radii (median of frame 0); radii, not diameters, in metres{_cause_of_spacing(found)}",
        )  # fmt: skip


def _cause_of_spacing(found: float) -> str:
    """What neighbours at so many times the sum of their radii look like."""
    causes = (
        (0.5, "radii look like diameters"),
        (2.0, "radii look like halved ones, or positions like those of every other grain"),
        (1e3, "coordinates look like millimetres"),
        (1e-3, "radii look like millimetres"),
    )
    return next((f": {cause}" for factor, cause in causes if abs(found / factor - 1.0) < LIKE), "")


def doubtful_loads(experiment: Experiment, tracks: Tracks, walls: WallTracks) -> list[str]:
    """A sentence for every pressure or load that is possible but hardly meant: next to none, or beyond what rods bear.

    Next to none: less than a tenth of what the rods' own weight would press with, if they lay upon one another.
    """
    material, sentences = experiment.config.material, []
    here = tracks.present[0]
    width = float(np.ptp(tracks.position[0, here, 0])) if here.any() else 0.0
    if width <= 0.0:
        return []
    weight = material.density * 9.81 * float(np.sum(np.pi * tracks.radius[here] ** 2)) / width  # [Pa], per length
    usual = walls.usual_pressure(material.length)
    for name, pressure in [(walls.name[w], usual[w]) for w in np.flatnonzero(walls.loaded & np.isnan(walls.pressure))]:
        if pressure < 0.1 * weight or pressure > STRENGTH:
            kind = (
                "little beside what the rods would weigh upon one another"
                if pressure < weight
                else "more than rods bear"
            )
            sentences.append(f"the load on wall {name!r} makes {pressure:.3g} Pa on average, {kind}: is it in newtons?")
    for name, pressure in zip(walls.name, walls.pressure, strict=True):
        if pressure < 0.1 * weight:
            sentences.append(
                f"walls.{name}.pressure = {pressure:g} Pa is little beside the {weight:.2g} Pa that the rods would "
                f"weigh upon one another: did you mean {pressure:g}e3 Pa?"
            )
        elif pressure > STRENGTH:
            sentences.append(
                f"walls.{name}.pressure = {pressure:g} Pa is beyond what rods bear without yielding: did you mean "
                f"{pressure / 1e3:g} Pa?"
            )
    return sentences


def open_sides(walls: WallTracks) -> list[str]:
    """A sentence where the walls of frame 0, taken as endless lines, leave a direction open."""
    if walls.count == 0 or (walls.sides == IN).any():
        return []
    straight = np.flatnonzero(walls.sides == STRAIGHT)
    if not len(straight):
        return ["The boundary is open: nothing is around the rods but what else presses on them."]
    along = walls.endpoints[0, straight, 1] - walls.endpoints[0, straight, 0]
    inward = np.arctan2(along[:, 0], -along[:, 1])
    order = np.argsort(inward)
    turn = np.diff(np.concatenate([inward[order], inward[order[:1]] + 2.0 * np.pi]))
    wide = int(np.argmax(turn))
    if turn[wide] < np.pi - OPEN:
        return []
    a, b = (walls.name[straight[order[k % len(order)]]] for k in (wide, wide + 1))
    where = f"between wall {a!r} and wall {b!r}" if a != b else f"opposite wall {a!r}"
    return [f"The boundary is open {where}: nothing keeps the rods in there but what else presses on them."]


def rods_beyond_ends(tracks: Tracks, walls: WallTracks) -> list[str]:
    """A sentence for every wall on whose line rods bear beyond its ends: walls are taken as endless lines.

    Such a wall was perhaps measured too short, which does no harm; or these rods bear on nothing, and forces are wrong.
    """
    start = walls.endpoints[:, :, 0]
    along = walls.endpoints[:, :, 1] - start
    length = np.linalg.norm(along, axis=-1)  # (f, w)
    unit = along / length[..., None]
    sentences = []
    for w, name in ((w, walls.name[w]) for w in np.flatnonzero(walls.sides == STRAIGHT)):
        place = tracks.position - start[:, None, w]
        ahead = np.einsum("fnk,fk->fn", place, unit[:, w])
        inside = place[..., 1] * unit[:, None, w, 0] - place[..., 0] * unit[:, None, w, 1]
        near = np.abs(inside - tracks.radius) < NEAR * tracks.radius  # NaN of lost grains compares false
        past = np.maximum(-ahead, ahead - length[:, None, w]) > BEYOND * tracks.radius
        rods = int((near & past).any(axis=0).sum())
        if rods:
            sentences.append(
                f"{rods} rod{'s' if rods > 1 else ''} may bear on the line of wall {name!r} beyond its end, and will "
                "be taken to: the wall goes on along them, unless calibration.walls_continue is false"
            )
    return sentences


def neighbour_spacing(position: Array, radius: Array) -> Array:
    """Least distance over the sum of radii to another grain (n,); position (n, 2) and radius (n,) [m]."""
    count = min(NEIGHBOURS + 1, len(radius))
    if count < 2:
        return np.empty(0)
    distance, other = (np.asarray(found) for found in KDTree(position).query(position, count))
    return (distance[:, 1:] / (radius[:, None] + radius[other[:, 1:]])).min(axis=1)


def check_inside(experiment: Experiment, tracks: Tracks, walls: WallTracks) -> None:
    """No centre may lie beyond a wall by more than the grain's radius: a mistaken unit, origin or direction."""
    section = experiment.config.walls
    if section is None:
        return
    for w, name in enumerate(walls.name):
        beyond = -reach_of_wall(walls.endpoints[:, None, w], walls.sides[w : w + 1], tracks.position)[0]
        outside = np.argwhere(beyond > tracks.radius)  # NaN of lost grains compares false
        if len(outside):
            k, row = (int(v) for v in outside[0])
            table = section.file if walls.sides[w] == STRAIGHT else section.arcs
            raise InputError(
                experiment.folder / (table or ""),
                f"frame {k}, wall {name!r}",
                f"grain {tracks.id[row]} lies {float(beyond[k, row]) * 1e3:.4g} mm beyond it; "
                f"the packing must lie {PLACE_OF_PACKING[int(walls.sides[w])]}, all in metres"
                f"{_cause_of_walls(experiment, tracks, walls)}",
            )


def _cause_of_walls(experiment: Experiment, tracks: Tracks, walls: WallTracks) -> str:
    """What would put the grains of frame 0 between its walls."""
    ends, side = walls.endpoints[0], walls.sides
    photographs = experiment.config.photographs
    pixel = photographs.pixel_size if photographs is not None else None
    place = tracks.position[0][tracks.present[0]]
    guesses = [
        ("walls look reversed", ends[:, ::-1], -side),
        ("walls look y-down", _upside_down(ends, place), side),
        ("walls look y-down", _upside_down(ends, place)[:, ::-1], side),
        ("walls look like millimetres", 1e-3 * ends, side),
    ]
    if isinstance(pixel, float):
        guesses.append(("walls look like pixels", pixel * ends, side))
        guesses.append(("walls look like pixels", _upside_down(pixel * ends, place), side))
    radius = tracks.radius[tracks.present[0]]
    if _all_inside(1e-3 * place, radius, ends, side):
        return ": coordinates look like millimetres"
    return next((f": {cause}" for cause, *guess in guesses if _all_inside(place, radius, *guess)), "")


def _upside_down(ends: Array, place: Array) -> Array:
    """The ends (w, 2, 2) with y counted the other way, about the middle of the packing (n, 2)."""
    flipped = ends.copy()
    middle = 0.5 * (place[:, 1].min() + place[:, 1].max()) + 0.5 * (ends[..., 1].min() + ends[..., 1].max())
    flipped[..., 1] = middle - flipped[..., 1]
    return flipped


def _all_inside(place: Array, radius: Array, ends: Array, side: NDArray[np.int8]) -> bool:
    """Whether no centre (n, 2) lies beyond a wall (w, 2, 2) by more than its radius (n,), nor far from all of them."""
    beyond = -reach_of_wall(ends, side, place[:, None])[0]
    near = beyond.max(axis=0) > -SPACIOUS * np.ptp(place, axis=0).max()
    return bool((beyond <= radius[:, None]).all() and near.all())
