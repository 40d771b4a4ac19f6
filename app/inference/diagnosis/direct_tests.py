"""Tests of the input that need no forces: order and speed of the photographs, poses, sizes, walls, loads."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...process.counts import state_count
from ...results.finding import Finding
from ...solver.bodies.grains import Array, Grains
from ...solver.bodies.outer_grains import find_outer_grains
from ...solver.bodies.rods import RodMaterial
from ...solver.bodies.strain import displacement_gradient, inertial_time, shear_strain
from ...solver.contacts.contacts import detect_contacts
from ...tracks import Tracks, WallTracks
from ..correction.radii import NAMED, find_oversized_rods, find_wrong_sizes
from ..correction.tables.outliers import find_outliers, walls_in
from ..correction.tables.rods_at_walls import RodsAtWalls
from ..snapshots import grains_of
from .causes import finding

SHORTER = 0.75  # path through the photographs in another order over the given one, below which that order is right
UNEVEN = 0.4  # standard deviation of the steps over their mean from which on another order is looked for …
SORTED = 0.4  # … which must make the path shorter by so much
REPEATED = 0.1  # displacement of a step over the median step below which a photograph is repeated …
STILL = 1.5  # … or over that of noise alone
MOVES = 4.0  # noise that the median step must exceed for that
EVEN = 0.25  # standard deviation of all other steps over their mean up to which one rest is a photograph taken twice
SAME = 0.1  # displacement over that of noise, below which both are one photograph
OUTLYING = 0.95  # quantile of the displacements above which a rod may be an outlier …
OUTLYING_IN_TWO = 0.75  # … where the order is judged: each of two photographs has its own
IN_BOTH = 0.1  # fraction of the rods that two photographs must show to be compared
BEYOND_SIGMAS = 15.0  # standard deviations of a position by which rods may stand beyond a wall …
BEYOND = 0.1  # … and mean radii
USUAL, BEYOND_USUAL = 0.99, 1.5  # quantile of all overlaps, and times it that an outlier overlaps another body
MISSING = 0.03  # fraction of the poses that may be missing
MOSTLY_MISSING = 0.5  # fraction of the rods that a photograph shows, below which it is named
INERTIAL, OUT = 5e-3, 7.0  # inertial number that is reported; force out of balance over the mean force, for I = 1
SEVERAL = 6  # rods that stand beyond a wall at least: with fewer, their radii may be wrong


def examine_order(tracks: Tracks) -> list[Finding]:
    """Look for photographs that are swapped with the next one, or repeated."""
    f = tracks.frame_count
    if f < 4:
        return []
    step, usual_step = (
        np.array([_distance(tracks, k, k + 1, repeated=each) for k in range(f - 1)]) for each in (True, False)
    )
    if not np.isfinite(step).any():
        return []
    usual, noise = float(np.nanmedian(step)), float(np.sqrt(2.0) * np.nanmedian(tracks.position_sigma))
    found = []
    swapped = [k for k in range(1, f - 2) if _shorter_if_swapped(tracks, usual_step, k)]
    if swapped:
        pairs = ", ".join(f"{k} and {k + 1}" for k in swapped[:4]) + ("…" if len(swapped) > 4 else "")
        found.append(finding("photographs_swapped", f"the motion is shorter with photographs {pairs} swapped"))
    elif shorter := _shortened_by_sorting(tracks, usual_step):
        words = f"in another order the motion is {100.0 * shorter:.0f} % shorter, and its steps are more even"
        found.append(finding("photographs_swapped", words))
    repeated = np.flatnonzero(_nothing_moves(step, noise)) if usual > MOVES * noise else np.empty(0, np.int64)
    if len(repeated):
        words = ", ".join(f"{k + 1}" for k in repeated[:4].tolist())
        found.append(finding("photograph_repeated", f"nothing moves from the photograph before to photograph {words}"))
    return found


def _nothing_moves(step: Array, noise: float) -> NDArray[np.bool_]:
    """Which steps (f − 1,) [m] lead to the same photograph again: less than noise, or the only one in even motion.

    A packing at rest moves by its noise, too.
    """
    still = step < max(REPEATED * float(np.nanmedian(step)), STILL * noise)
    others = step[~still & np.isfinite(step)]
    if still.sum() == 1 and others.std() < EVEN * others.mean():
        return still
    return step < SAME * noise


def examine_poses(tracks: Tracks, impossible: NDArray[np.bool_], repeated: NDArray[np.bool_]) -> list[Finding]:
    """Look for rods that photographs lack, that jump for one photograph, or whose poses are repeated (f, n)."""
    found = []
    if repeated.any():
        listed = ", ".join(map(str, tracks.id[repeated.any(axis=0)][:NAMED]))
        poses, verb = state_count(int(repeated.sum()), "pose"), "repeats" if repeated.sum() == 1 else "repeat"
        words = f"{poses} {verb} the one before digit by digit while other rods move: rods {listed}"
        found.append(finding("outlier_tracks", words))
    if impossible.any():
        frames = np.flatnonzero(impossible.any(axis=1)).tolist()
        words = ", ".join(map(str, frames[:4])) + ("…" if len(frames) > 4 else "")
        count = int(impossible.sum())
        subject = "1 pose jumps against its" if count == 1 else f"{count} poses jump against their"
        where = "photograph" if len(frames) == 1 else "photographs"
        found.append(finding("outlier_tracks", f"{subject} neighbours and back, in {where} {words}"))
    seen = tracks.present.any(axis=0)
    missing = 1.0 - float(tracks.present[:, seen].mean()) if seen.any() else 0.0
    if MISSING < missing < 1.0:
        empty = np.flatnonzero(tracks.present[:, seen].mean(axis=1) < MOSTLY_MISSING)
        listed = ", ".join(map(str, empty[:NAMED]))
        where = f", most of those in photograph{'s' if len(empty) > 1 else ''} {listed}" if len(empty) else ""
        found.append(finding("missing_poses", f"{100.0 * missing:.0f} % of the poses are missing{where}"))
    return found


def examine_sizes(tracks: Tracks, walls: WallTracks | None = None) -> list[Finding]:
    """Look for rods, and for sizes of rods, whose radius is stated too large."""
    if rods := find_oversized_rods(tracks):
        listed = ", ".join(str(tracks.id[row]) for row in list(rods)[:NAMED]) + ("…" if len(rods) > NAMED else "")
        deepest = f"by up to {100.0 * max(rods.values()):.0f} % of the smaller radius"
        return [finding("oversized_rods", f"rods overlap their neighbours {deepest}, because of {listed}")]
    found = find_wrong_sizes(tracks, walls)
    if not found:
        return []
    radius, overlap = max(found.items(), key=lambda each: each[1])
    words = f"rods of radius {1e3 * radius:.3g} mm overlap by {100.0 * overlap:.1f} % of a diameter, others do not"
    return [finding("class_radii", words)]


def find_impossible_poses(tracks: Tracks, walls: WallTracks | None = None) -> NDArray[np.bool_]:
    """Outliers (f, n) that overlap another body by more than other poses do.

    Where radii are wrong all overlaps are large, and a rod that really jumps seems to penetrate others.
    """
    outlier = find_outliers(tracks, walls)
    if not outlier.any():
        return outlier
    grains, depth, usual = grains_of(tracks), np.zeros(outlier.shape), []
    for k in range(tracks.frame_count):
        present, wrong = np.isfinite(tracks.position[k, :, 0]), np.append(outlier[k], False)
        near = detect_contacts(grains, tracks.position[k], present, walls_in(walls, k), 0.0)
        i, j = near.i, np.minimum(near.j, tracks.grain_count)
        usual.append(-near.gap[~wrong[i] & ~wrong[j]])
        np.maximum.at(depth[k], i, -near.gap)
        np.maximum.at(depth[k], j[~near.with_wall], -near.gap[~near.with_wall])
    known = np.concatenate(usual)
    limit = float(np.quantile(known, USUAL)) if len(known) else 0.0
    return outlier & (depth > BEYOND_USUAL * limit)


def examine_inertia(tracks: Tracks, walls: WallTracks, material: RodMaterial) -> list[Finding]:
    """Look for motion so fast that rods are out of balance.

    Notes
    -----
    The inertial number I is the rate of shear, by the times of the photographs, times `inertial_time` of the mean mass
    and the pressure of the loaded walls. Simulated packings are out of balance by about 7 I of the mean force.
    """
    pressure = walls.usual_pressure(material.length)
    if not np.isfinite(pressure).any() or tracks.frame_count < 2:
        return []
    mass = float(Grains.of_rods(tracks.radius, density=material.density, length=material.length).mass.mean())
    scale = inertial_time(mass, float(np.nanmean(pressure)), material.length)
    rates = [_shear_rate(tracks, k) for k in range(1, tracks.frame_count)]
    known = [each for each in rates if np.isfinite(each)]
    number = float(np.median(known)) * scale if known else 0.0
    if number < INERTIAL:
        return []
    words = f"the inertial number is {number:.2g}, so that rods are out of balance by some {100 * OUT * number:.0f} %"
    return [finding("inertia", f"{words} of the mean force")]


def examine_wall_places(tracks: Tracks, walls: WallTracks) -> list[Finding]:
    """Look for straight walls that several rods stand beyond in every photograph."""
    allowed = max(BEYOND_SIGMAS * float(np.nanmedian(tracks.position_sigma)), BEYOND * float(tracks.radius.mean()))
    rods, found = RodsAtWalls.of(tracks), []
    for w in walls.straight:
        gap = np.array([rods.nearest_gap(k, walls, w, SEVERAL) for k in range(tracks.frame_count)])
        gap = gap[np.isfinite(gap)]
        if len(gap) and float(np.median(gap)) < -allowed:
            words = f"rods stand {1e3 * -float(np.median(gap)):.2g} mm beyond wall '{walls.name[w]}'"
            found.append(finding("wall_misplaced", words, corrected=False))
    return found


def _shear_rate(tracks: Tracks, k: int) -> float:
    """Rate of shear [1/s] of the step to photograph k; NaN with too few rods."""
    both, time = tracks.present_in(k - 1) & tracks.present_in(k), float(tracks.time[k] - tracks.time[k - 1])
    if int(both.sum()) < 4 or not time > 0.0:
        return np.nan
    gradient = displacement_gradient(tracks.position[k - 1], tracks.position[k] - tracks.position[k - 1], both)
    return shear_strain(0.5 * (gradient + gradient.T)) / time


def _distance(tracks: Tracks, k: int, other: int, *, repeated: bool = False) -> float:
    """Rms of most displacements [m] from one photograph to another; NaN where few rods are in both.

    Relative to the median of all rods, since what they have in common may be a displacement of the camera; not for the
    question whether a photograph is repeated.
    """
    both = tracks.present_in(k) & tracks.present_in(other)
    if not both.mean() > IN_BOTH:
        return np.nan
    moved = tracks.position[other, both] - tracks.position[k, both]
    square = np.mean((moved if repeated else moved - np.median(moved, axis=0)) ** 2, axis=1)
    most = square <= np.quantile(square, OUTLYING if repeated else OUTLYING_IN_TWO)
    return float(np.sqrt(np.mean(square[most])))


def _shorter_if_swapped(tracks: Tracks, step: Array, k: int) -> bool:
    given = float(step[k - 1] + step[k] + step[k + 1])
    swapped = _distance(tracks, k - 1, k + 1) + float(step[k]) + _distance(tracks, k, k + 2)
    return swapped < SHORTER * given


def _shortened_by_sorting(tracks: Tracks, step: Array) -> float:
    """Fraction by which the path through the photographs is shorter if each is followed by the nearest; 0: it is not.

    A loading that returns visits places again, but in even steps.
    """
    known = step[np.isfinite(step)]
    if len(known) < len(step) or not known.mean() > 0.0 or known.std() < UNEVEN * known.mean():
        return 0.0
    f = tracks.frame_count
    apart = np.array([[_distance(tracks, k, other) if k != other else np.inf for other in range(f)] for k in range(f)])
    if not np.isfinite(apart[~np.eye(f, dtype=np.bool_)]).all():
        return 0.0
    start = int(np.unravel_index(int(np.argmax(np.where(np.isfinite(apart), apart, -1.0))), apart.shape)[0])
    path, here, left = 0.0, start, set(range(f)) - {start}
    while left:
        nearest = min(left, key=lambda k: apart[here, k])
        path, here = path + float(apart[here, nearest]), nearest
        left.remove(nearest)
    shorter = 1.0 - path / float(known.sum())
    return shorter if shorter > SORTED else 0.0


def examine_load(tracks: Tracks, walls: WallTracks, material: RodMaterial) -> list[Finding]:
    """Look for a packing with one open side and no load: forces at a free surface can have no other cause than weight.

    Two open sides are those of a packing between two plates, whose motion may be imposed.
    """
    loaded = np.isfinite(walls.pressure).any() or (walls.load is not None and np.isfinite(walls.load).any())
    bounded = tracks.boundary is not None or walls.cell is not None
    if loaded or bounded or any(material.gravity) or not walls.count or np.isnan(walls.endpoints[0]).any():
        return []
    surface = find_outer_grains(tracks.radius, tracks.position[0], tracks.present[0], walls.at_rest(0))
    sides = surface.sides(~surface.inner)
    if len(sides) != 1:
        return []
    words = f"no wall bears a load, no weight is given, and the packing is open {sides[0].name}"
    return [finding("load_missing", words)]
