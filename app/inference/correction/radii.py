"""Individual errors of radii, estimated from all frames together before the centres are calibrated.

An error of a radius and one of a centre look alike in the gaps of a grain, but not with the balance of forces. Walls,
scale and the common error of the radii are calibrated first, because a displaced wall looks like wrong radii along it.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.rods import RodMaterial
from ...solver.bodies.wall_shapes import beside_wall, distance_from_walls
from ...solver.boundary.exchanged_sizes import find_exchanged_sizes
from ...solver.boundary.size_classes import find_size_classes
from ...solver.calibration.calibrate import Calibration
from ...solver.contacts.contacts import detect_contacts
from ...solver.even_subset import even_subset
from ...solver.part_settings import CalibrationSettings
from ...solver.posterior.radius_posterior import RadiusPosterior, estimate_radii, has_radius_errors, share_errors
from ...tracks import Tracks, WallTracks
from ..snapshots import grains_of, measure_sequence, pack_seen
from .calibration import calibrate_tracks, radius_classes
from .tables.outliers import walls_in

NAMED = 8  # rods that a sentence lists
SEED = 0  # of the draws: the same input gives the same bits
# Mean overlap of the pairs of one size over that of another, below which a radius is wrong: .45 at least in simulated
# soft packings of three sizes, .02 where one of three radii is 2 % too large.
UNEQUAL = 0.25
SEEN = 0.002  # mean overlap over a diameter, below which it does not matter
DEEP = 0.15  # overlap over the smaller radius beyond which a radius is wrong, whatever the stiffness
READ, MOST = 6, 0.3  # photographs that are read; fraction of the rods beyond which all lengths are wrong
# Standard error of the fraction of readings' deviations that is error, above which readings of hard grains are kept:
# with .22, r of a sheared packing without walls fell from .85 to .82.
UNCERTAIN = 0.1
FEWEST = 30  # overlaps of a size in all photographs, with which it counts


def correct_exchanged_sizes(tracks: Tracks, walls: WallTracks) -> tuple[Tracks, str]:
    """Give rods that are stated to be of another size the size with which they touch their neighbours and walls.

    Returns
    -------
    Tracks
    str
        A sentence on the correction; empty: none.
    """
    classes = radius_classes(tracks.radius) if tracks.grain_count else None
    if classes is None:
        return tracks, ""
    read = _frames_read(tracks)
    position = np.where(tracks.present[read, :, None], tracks.position[read], np.nan)
    place, ends, side = position[:, :, None], walls.endpoints[read, None], walls.sides
    margin = np.broadcast_to(tracks.radius[:, None], (tracks.grain_count, walls.count))
    beside = beside_wall(ends, side, place, margin)
    from_walls = np.where(beside, distance_from_walls(ends, side, place), np.nan)
    radius = find_exchanged_sizes(position, tracks.radius, classes, from_walls, tracks.boundary)
    changed = np.flatnonzero(radius != tracks.radius)
    if not len(changed):
        return tracks, ""
    names = ", ".join(str(tracks.id[row]) for row in changed[:NAMED]) + ("…" if len(changed) > NAMED else "")
    rods = "1 rod touches" if len(changed) == 1 else f"{len(changed)} rods touch"
    sentence = f"{rods} the others only with another of the stated sizes, which is used: {names}"
    return replace(tracks, radius=radius), sentence


def use_size_classes(tracks: Tracks, *, soft: bool) -> tuple[Tracks, str]:
    """Replace readings of the radii by nominal sizes, as far as touching pairs show that the deviations are errors.

    Overlaps of soft grains are forces: their mean stays that of the readings. Surfaces of touching hard grains meet.
    Calibration finds errors of single radii of these, too, but not apart from those of centres and from gaps of pairs
    that do not touch.

    Parameters
    ----------
    tracks : Tracks
    soft : bool
        Whether grains are soft.

    Returns
    -------
    Tracks
    str
        A sentence on the correction; empty: none.
    """
    found = find_size_classes(tracks.position, tracks.radius, tracks.boundary) if tracks.grain_count else None
    if found is None or (not soft and found.error_fraction_sd > UNCERTAIN):
        return tracks, ""
    shared = 0.0 if soft else found.class_error[found.size_class]
    return replace(tracks, radius=found.radius + shared), found.describe()


def calibrate_with_radii(
    material: RodMaterial,
    settings: CalibrationSettings,
    tracks: Tracks,
    walls: WallTracks,
    typical_overlap: float,
    failed: Collection[int] = (),
) -> tuple[Tracks, WallTracks, Calibration | None]:
    """Calibrate tracks and walls, estimating the radii first where their errors vary more than those of centres.

    Parameters as of `calibrate_tracks`, which is all that is done to exact radii.
    """
    calibrated = calibrate_tracks(settings, tracks, walls, typical_overlap, failed)
    first = calibrated[2]
    if first is None or not has_radius_errors(*pack_seen(material, tracks, walls, failed)):
        return calibrated
    shared = _correct_shared(first, tracks, walls)
    found = estimate_radii(*pack_seen(material, *shared, failed), np.random.default_rng(SEED))
    classes = radius_classes(tracks.radius)
    if classes is not None:
        found = share_errors(found, classes)
    better = replace(tracks, radius=tracks.radius + found.correction)
    remaining = float(np.sqrt(np.mean(found.correction_sd**2)))
    tracks, walls, then = calibrate_tracks(settings, better, walls, typical_overlap, failed, remaining)
    assert then is not None
    if tracks.centre_sigma is None or not then.applied:
        tracks = replace(tracks, centre_sigma=np.full(tracks.grain_count, remaining))  # of either kind a gap has two
    return tracks, walls, _joined(first, found, then)


def _correct_shared(found: Calibration, tracks: Tracks, walls: WallTracks) -> tuple[Tracks, WallTracks]:
    """Correct the errors that all grains share; their own centres and radii stay as given."""
    shared = replace(
        found, offset=np.zeros_like(found.offset), radius=found.shared_radius(tracks.radius)
    )  # fmt: skip
    better = shared.correct(measure_sequence(tracks, walls))
    return replace(tracks, radius=better.radius, position=better.position), replace(walls, endpoints=better.endpoints)


def _joined(first: Calibration, found: RadiusPosterior, then: Calibration) -> Calibration:
    """Combine both calibrations and the radii into one."""
    size = 1e6 * float(np.sqrt(np.mean(found.correction**2)))
    verdict = f"applied: the given radii are wrong by {size:.0f} µm rms, as gaps and balance of all photographs show"
    return replace(
        then,
        radius=then.radius + found.correction,
        radius_sd=found.correction_sd,
        before=first.before,
        applied=True,
        verdict=verdict + (f"; then {then.verdict.removeprefix('applied: ')}" if then.applied else ""),
    )


def find_wrong_sizes(tracks: Tracks, walls: WallTracks | None, failed: Collection[int] = ()) -> dict[float, float]:
    """Find sizes of grains whose radius is stated too large.

    Soft grains of all sizes overlap, larger ones more, because they bear larger forces; where hard grains of some sizes
    overlap and those of others do not, the stated radii of these sizes are wrong.

    Parameters
    ----------
    tracks : Tracks
    walls : WallTracks or None
    failed : collection of int
        Photographs that are not read.

    Returns
    -------
    dict of float to float
        Stated radius [m] of every such size, and the mean overlap of its pairs over twice the radius.

    Notes
    -----
    With d_c the mean overlap of the pairs of size c, these are sizes with d_c > max(min d / UNEQUAL, SEEN · 2 r_c).
    """
    sizes = radius_classes(tracks.radius)
    if sizes is None:
        return {}
    grains, depth, of_size = grains_of(tracks), [], []
    for k in sorted(set(range(tracks.frame_count)) - set(failed)):
        present = np.isfinite(tracks.position[k, :, 0])
        near = detect_contacts(grains, tracks.position[k], present, walls_in(walls, k), 0.0)
        near = near.select(~near.with_wall)
        alike = sizes[near.i] == sizes[near.j]
        depth.append(-near.gap[alike])
        of_size.append(sizes[near.i[alike]])
    size = np.concatenate(of_size) if of_size else np.empty(0, np.int64)
    count = np.bincount(size, minlength=int(sizes.max()) + 1)
    known = np.flatnonzero(count >= FEWEST)
    if len(known) < 2:
        return {}
    mean = np.bincount(size, weights=np.concatenate(depth), minlength=len(count))[known] / count[known]
    radius = [float(tracks.radius[sizes == each].mean()) for each in known.tolist()]
    overlap = {r: d / (2.0 * r) for r, d in zip(radius, mean.tolist(), strict=True)}
    return {r: each for r, each in overlap.items() if each > SEEN and mean.min() < UNEQUAL * 2.0 * r * each}


def _frames_read(tracks: Tracks) -> NDArray[np.int64]:
    """Choose at most READ photographs, evenly spaced."""
    count = tracks.frame_count
    return even_subset(count, READ)


def find_oversized_rods(tracks: Tracks) -> dict[int, float]:
    """Find rods that lie inside their neighbours, as where a row of the table of radii is that of another rod.

    Returns
    -------
    dict of int to float
        Row of every such rod, and its greatest overlap over the smaller radius; empty where they are more than MOST.

    Notes
    -----
    Pairs count whose overlap is more than DEEP of the smaller radius in more than half of the photographs that are read
    and show both, which are half of all: no rod is so soft, and a disc that is found now and then may be none. Of their
    rods that with the most such pairs is wrong, then of the rest.
    """
    grains = grains_of(tracks)
    read = _frames_read(tracks)
    deep: dict[tuple[int, int], list[float]] = {}
    for k in read.tolist():
        near = detect_contacts(grains, tracks.position[k], tracks.present_in(k), walls_in(None, k), 0.0)
        depth = -near.gap / np.minimum(tracks.radius[near.i], tracks.radius[near.j])
        for row in np.flatnonzero(depth > DEEP).tolist():
            deep.setdefault((int(near.i[row]), int(near.j[row])), []).append(float(depth[row]))
    seen = tracks.present[read]
    together = {pair: int(seen[:, pair].all(axis=1).sum()) for pair in deep}
    pairs = {
        pair: max(each)
        for pair, each in deep.items()
        if len(each) > 0.5 * together[pair] and together[pair] >= 0.5 * len(read)
    }
    found: dict[int, float] = {}
    while pairs:
        count = np.bincount(np.array(list(pairs)).ravel(), minlength=tracks.grain_count)
        worst = int(np.lexsort([tracks.radius, count])[-1])  # of as many pairs the larger rod
        found[worst] = max(depth for pair, depth in pairs.items() if worst in pair)
        pairs = {pair: depth for pair, depth in pairs.items() if worst not in pair}
    return found if len(found) <= MOST * tracks.grain_count else {}
