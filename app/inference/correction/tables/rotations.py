"""Rotations of the wrong sense, in degrees, or zero for unknown: found by what rolling leads to expect, corrected."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....solver.bodies.disc_pairs import find_disc_pairs
from ....solver.bodies.grains import Array
from ....solver.bodies.strain import displacement_gradient
from ....solver.even_subset import even_subset
from ....solver.inferred.unknown_rotations import fill_unknown_rotations
from ....solver.statistics.agreement import pearson, ranks
from ....tracks import Tracks, WallTracks

# Causes, by their names in a diagnosis: the factor that corrects the rotations, and how a correction is described.
CORRECTIONS: Mapping[str, tuple[float, str]] = {
    "rotation_sign": (-1.0, "clockwise"),
    "rotation_in_degrees": (np.pi / 180.0, "in degrees"),
    "rotation_zero": (np.nan, "unknown"),
}
AGREES = 0.15  # rank correlation of stated and inferred rotations beyond which they are the same, or opposite …
SIGMAS = 5.0  # … and standard deviations of that of unrelated ones
DEGREES = 10.0  # ratio of stated to inferred rotations: degrees are 57 times radians …
DEGREES_OF_NOISE = 30.0  # … where noise hides the sense of the rotations: half of that
NEIGHBOURS = 0.05  # mean radii: greatest gap of neighbours whose sliding is compared
FAR_LESS = 0.2  # of the sliding by stated rotations, if they are in degrees
TURNS, FEWEST_TURNING = 0.3, 20  # least slope of the mean rotation over the packing's that counts; rods of a step
SPAN_SIGMAS = 15.0  # standard deviations of a position by which rods must move among each other between two photographs
ROTATING_POSES, FEWEST_STEPS = 6000, 4  # poses, and steps between photographs, whose rotations are compared


@dataclass(frozen=True, slots=True)
class WrongRotations:
    """What is wrong with the rotations."""

    cause: str  # one of CORRECTIONS
    evidence: str
    corrected: bool  # False: neighbours slide no less with corrected ones

    def describe(self) -> str:
        """Describe the correction; empty: none."""
        _, words = CORRECTIONS[self.cause]
        return f"rotations were taken to be {words}, since {self.evidence}" if self.corrected else ""


def correct_rotations(tracks: Tracks, walls: WallTracks) -> tuple[Tracks, tuple[WrongRotations, ...]]:
    """Correct rotations that are stated in degrees, of the wrong sense, or as zero although they are unknown.

    Returns
    -------
    Tracks
    tuple of WrongRotations
        Empty where rotations agree with rolling; two where degrees have the wrong sense.
    """
    found: tuple[WrongRotations, ...] = ()
    for _ in CORRECTIONS:
        wrong = _find_wrong(tracks, walls)
        if wrong is None:
            break
        found = (*found, wrong)
        if not wrong.corrected:
            break
        factor, _ = CORRECTIONS[wrong.cause]
        tracks = replace(tracks, rotation=factor * tracks.rotation)
    return tracks, found


def _find_wrong(tracks: Tracks, walls: WallTracks) -> WrongRotations | None:
    """Compare stated rotations with those that rolling among the neighbours leads to expect; None: nothing is wrong.

    Notes
    -----
    The rank correlation is that of Spearman over all rods and steps, about .3 to .5 for correct rotations. A step leads
    over so many photographs that the rods move among each other by 15 standard deviations of a position: noise hides
    the rotations of smaller ones (.14 over one photograph of the apparatus of corner discs, .29 over four).

    Where it decides nothing, as in a drum, whose rods turn together, the mean rotation of all rods is compared with the
    rotation of the packing, half the curl of the displacements: its slope was .5 to 1 in shear, in a drum 1.

    Rotations are in degrees only where the contacts slide by less than a fifth if they are. The rods of a crystal may
    turn like gears, alternately and without sliding, 30 times as much as the motion of their centres requires.
    """
    span = _span(tracks)
    stated = tracks.rotation[span:] - tracks.rotation[:-span]
    known = np.isfinite(stated)
    if not known.any():
        return None
    if not stated[known].any():
        return WrongRotations("rotation_zero", "no rod rotates in any photograph", corrected=True)
    apart = max((tracks.frame_count - 1) // span, 1)  # steps that do not overlap: their errors are independent
    steps = min(max(ROTATING_POSES // tracks.grain_count, FEWEST_STEPS), apart)
    chosen = even_subset(len(stated), steps)
    inferred = np.array([_rolled(tracks, walls, k, k + span) for k in chosen.tolist()])
    stated, known = stated[chosen], known[chosen] & np.isfinite(inferred)
    stated, inferred = stated[known], inferred[known]
    rank = pearson(ranks(stated), ranks(inferred)) if len(stated) > 1 and inferred.any() else 0.0
    rolling = float(np.median(np.abs(inferred))) if len(stated) else 0.0
    ratio = float(np.median(np.abs(stated))) / rolling if rolling > 0.0 else 0.0
    excess = f"rods rotate {ratio:.0f} times as much as rolling leads to expect"
    sliding = _Sliding.measure(tracks, chosen, span)
    if ratio > DEGREES and not sliding.ratio("rotation_in_degrees") < FAR_LESS:
        ratio = 1.0
    if abs(rank) >= max(AGREES, SIGMAS / np.sqrt(max(len(stated), 1))):
        against = f"the rank correlation with the rotations expected from rolling is {rank:.2f}"
        return _judge(sliding, rank, against, ratio, excess)
    slope, error = _slope_of_turning(tracks)
    if abs(slope) < max(TURNS, SIGMAS * error):
        unrelated = f"{excess}, without relation to it"
        return sliding.name("rotation_in_degrees", unrelated) if ratio > DEGREES_OF_NOISE else None
    words = f"rods rotate on average by {slope:.1f} times the rotation of the packing"
    return _judge(sliding, slope, words, slope, words)


@dataclass(frozen=True, slots=True)
class _Sliding:
    """Motion of neighbours along their surfaces, in several steps; q pairs."""

    along: Array  # (q,) [m] by their centres
    rolled: Array  # (q,) [m] by their rotations as stated, the amount that rolling without sliding would cancel

    @classmethod
    def measure(cls, tracks: Tracks, start: NDArray[np.intp], span: int) -> _Sliding:
        """Measure the pairs of neighbours in steps from some photographs, each over `span` photographs."""
        along: list[Array] = [np.empty(0)]
        turned: list[Array] = [np.empty(0)]
        for k in start.tolist():
            rotated = tracks.rotation[k + span] - tracks.rotation[k]
            rows = np.flatnonzero(tracks.present_in(k) & tracks.present_in(k + span) & np.isfinite(rotated))
            position, radius = tracks.position[k, rows], tracks.radius[rows]
            i, j = find_disc_pairs(position, radius, NEIGHBOURS * float(tracks.radius.mean())).T
            apart, moved = position[j] - position[i], tracks.position[k + span, rows] - position
            tangent = np.stack([-apart[:, 1], apart[:, 0]], axis=1) / np.linalg.norm(apart, axis=1)[:, None]
            along.append(np.einsum("ij,ij->i", moved[j] - moved[i], tangent))
            turned.append(radius[i] * rotated[rows][i] + radius[j] * rotated[rows][j])
        return cls(np.concatenate(along), np.concatenate(turned))

    def ratio(self, cause: str) -> float:
        """Median |u_t| with corrected rotations over that with the stated ones; infinite without neighbours."""
        if not len(self.along):
            return np.inf
        factor, _ = CORRECTIONS[cause]
        corrected, stated = (float(np.median(np.abs(self.along - each * self.rolled))) for each in (factor, 1.0))
        return corrected / stated if stated > 0.0 else np.inf

    def name(self, cause: str, evidence: str) -> WrongRotations:
        """Name what is wrong, which is corrected where neighbours then slide less."""
        return WrongRotations(cause, evidence, corrected=self.ratio(cause) < 1.0)


def _judge(sliding: _Sliding, sense: float, against: str, ratio: float, excess: str) -> WrongRotations | None:
    """Name rotations of the wrong sense, negative, or those that are too large by a ratio, with their evidence."""
    if sense < 0:
        return sliding.name("rotation_sign", against)
    return sliding.name("rotation_in_degrees", excess) if ratio > DEGREES else None


def _slope_of_turning(tracks: Tracks) -> tuple[float, float]:
    """Slope of the rods' mean rotation over that of the packing, and its standard error; (0, inf): nothing turns."""
    spin, mean, error = [], [], []
    for k in range(1, tracks.frame_count):
        rotated = tracks.rotation[k] - tracks.rotation[k - 1]
        both = tracks.present_in(k - 1) & tracks.present_in(k) & np.isfinite(rotated)
        if both.sum() < FEWEST_TURNING:
            continue
        gradient = displacement_gradient(tracks.position[k - 1], tracks.position[k] - tracks.position[k - 1], both)
        spin.append(0.5 * float(gradient[1, 0] - gradient[0, 1]))
        mean.append(float(rotated[both].mean()))
        error.append(float(rotated[both].std()) / np.sqrt(both.sum()))
    size = float(np.sum(np.square(spin)))
    if not size > 0.0:
        return 0.0, float("inf")
    slope, variance = np.dot(spin, mean) / size, np.dot(np.square(spin), np.square(error)) / size**2
    return float(slope), float(np.sqrt(variance))


def _span(tracks: Tracks) -> int:
    """Fewest photographs over which the rods move enough among each other; of too little motion, those of the most."""
    sigma, most = float(np.nanmedian(tracks.position_sigma)), tracks.frame_count - 1
    spans = np.unique(np.minimum(2 ** np.arange(most.bit_length() + 1), most)).tolist() if most > 0 else [1]
    moved: list[float] = []
    for span in spans:
        moved.append(_deformation(tracks, span))
        if moved[-1] >= SPAN_SIGMAS * sigma:
            return span
    return spans[int(np.argmax(moved))]


def _deformation(tracks: Tracks, span: int) -> float:
    """Median over the photographs of the rms displacement [m] of rods about their mean, over so many of them."""
    moved = tracks.position[span:] - tracks.position[:-span]
    found = [
        float(np.sqrt(np.mean((each - each.mean(axis=0)) ** 2)))
        for each in (step[np.isfinite(step).all(axis=1)] for step in moved)
        if len(each)
    ]
    return float(np.median(found)) if found else 0.0


def _rolled(tracks: Tracks, walls: WallTracks, k: int, later: int) -> Array:
    """Rotations (n,) [rad] from photograph k to a later one that rolling among the neighbours leads to expect."""
    part = slice(k, later + 1, later - k)
    filled = fill_unknown_rotations(
        tracks.radius, tracks.position[part], np.full_like(tracks.rotation[part], np.nan), tracks.present[part],
        walls.endpoints[part], side=walls.side, cell=None if walls.cell is None else walls.cell[part],
    )  # fmt: skip
    return filled[1] - filled[0]
