"""Differential diagnosis: the input is compared with its rivals by what their forces leave unexplained.

Tests without forces come first, then the comparison of what resists the sliding, then rivals of the geometry, each
solved for a few photographs as a run would. The one whose evidence leads to expect clearly better forces
than the given input, and than all other causes, is named. Nothing is named that is not clearly better.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from ...process.counts import mean_of_known
from ...process.errors import UndeterminedError
from ...process.machine.linear_algebra import one_thread_each
from ...process.progress import Progress, no_progress
from ...results.finding import Finding
from ...results.results import Results
from ...solver.assessment.intervals.wall_sensors import contradicting
from ...solver.convex.friction_check import QUIET
from ...tracks import Tracks, WallTracks
from ..correction.correct_sequence import complete_walls, correct_sequence
from ..correction.tables.outliers import find_repeated, restore_exchanged_ids, without_poses
from ..correction.tables.rotations import correct_rotations
from ..correction.tables.wall_places import correct_wall_places
from ..correction.tables.wall_scatter import correct_wall_scatter
from ..correction.tables.wall_times import correct_wall_times
from ..correction.tables.walls_at_rest import correct_walls_at_rest
from ..inputs import Inputs
from .causes import finding, name_once
from .data_quality import measure_data_quality
from .direct_tests import (
    examine_inertia,
    examine_load,
    examine_order,
    examine_poses,
    examine_sizes,
    examine_wall_places,
    find_impossible_poses,
)
from .distortion import seeks_distortion, undistorted
from .resistance import examine_resistance
from .rivals import rivals_of
from .sections import examine_sections
from .smoothed_tracks import examine_smoothing
from .trial import TRIAL_PHOTOGRAPHS, Trial, remainder, select_window, solve_trial, trial_score

# Rise of arctanh r that a rival must reach over the given input, and over all other causes. On correct input, and where
# the model lacks physics that no rival has, the highest rise was 0.13 (seed 40, six scenarios).
CLEAR, AHEAD = 0.2, 0.1
COMPARED = 0.93  # expected r of some photographs of a solved test below which rivals are compared
UNEXPLAINED = 0.85  # expected r below which something is wrong although no cause is named
FEW_OUTLIERS = 0.003  # fraction of the poses that jump, below which they do not explain poor forces
GAP_SHOWN = 0.5  # of the mean gap that wrong radii of all hard rods cause: with less they are not wrong
LEAST_GRAINS = (
    100  # of a packing whose rivals are compared: the evidence of fewer varies by chance as much as by causes
)


@one_thread_each
def diagnose(
    inputs: Inputs,
    trial: Trial | None,
    progress: Progress = no_progress,
    *,
    first: int = 0,
    sliding: bool = True,
    undisturbed: bool = False,
) -> list[Finding]:
    """Find causes for what contradicts the forces.

    Parameters
    ----------
    inputs : Inputs
        Of the whole test, or of its first photographs.
    trial : Trial or None
        Trial solution of the given input; None: only tests that need no forces.
    progress : callable
        Called after every rival.
    first : int
        First of the photographs on which rivals are compared.
    sliding : bool
        Whether to examine what resists the sliding.
    undisturbed : bool
        Whether a run found neither a distortion of the camera nor jumping poses, so that neither is sought again.

    Returns
    -------
    list of Finding
        Empty where nothing contradicts the model.
    """
    restored, exchanged = restore_exchanged_ids(inputs.tracks)
    repeated = find_repeated(restored)
    restored = without_poses(restored, repeated)
    names = [finding("exchanged_ids", exchanged)] if exchanged else []
    if inputs.stretching is not None and (inputs.stretching.factor != 1.0).any():
        names.append(finding("stretched_picture", inputs.stretching.evidence, corrected=True))
    walls, failed = complete_walls(restored, inputs.walls)
    if len(failed) == restored.frame_count:
        return names
    turned, rotations = _examine_rotations(inputs, restored, walls)
    names += [each for each in rotations if each.corrected]
    inputs = replace(inputs, tracks=turned)
    if inputs.settings.boundary is not None:
        walls, moved = _examine_walls(turned, walls)
        names += [each for each in moved if each.corrected]
    sought = not undisturbed and seeks_distortion(inputs, walls, failed)
    tracks, walls, camera = undistorted(inputs, walls, failed, camera=sought)
    found = [each for each in rotations if not each.corrected]
    found += [*examine_order(tracks), *examine_smoothing(inputs.tracks)]
    moving = [replace(each, corrected=False) for each in _examine_walls(tracks, walls)[1]]
    placed, apart = correct_wall_places(tracks, walls)
    if apart and inputs.settings.boundary is not None:
        walls = placed
        names.append(finding("wall_misplaced", apart, corrected=True))
    elif apart:
        moving.append(finding("wall_misplaced", apart, corrected=False))
    found += moving or examine_wall_places(tracks, walls)
    found += examine_sizes(tracks, walls) or examine_sections(tracks)
    found += examine_inertia(tracks, walls, inputs.material) + examine_load(tracks, walls, inputs.material)
    impossible = np.zeros(tracks.status.shape, np.bool_) if undisturbed else find_impossible_poses(tracks, walls)
    poses = examine_poses(tracks, impossible, repeated)
    if not found and sliding and inputs.tracks.grain_count >= LEAST_GRAINS:
        found = _examine_sliding(inputs, first) or (_examine_sliding(inputs, 0) if first else [])
    if not (found or trial is None or inputs.tracks.grain_count < LEAST_GRAINS):
        # Gaps between hard rods show a stretching by themselves. Where they show none, such a rival moves the walls.
        shown = undisturbed or sought
        excluded = ("stretched_picture",) if shown and not (camera or trial.soft) else ()
        found = _compare_rivals(inputs, trial, progress, first, excluded)
    if poses and float(impossible.mean()) > FEW_OUTLIERS:  # so many explain it
        found = [each for each in found if each.cause != "not_explained"]
    if found:  # wrong radii look like a few jumps
        poses = [each for each in poses if each.cause != "outlier_tracks"]
    return name_once([*found, *names, *camera, *poses])


def _examine_rotations(inputs: Inputs, tracks: Tracks, walls: WallTracks) -> tuple[Tracks, list[Finding]]:
    """Return the tracks with the rotations that a run uses, and name what is wrong with the stated ones."""
    corrected, wrong = correct_rotations(tracks, walls)
    if inputs.settings.calibration is None:
        return tracks, [finding(each.cause, each.evidence, corrected=False) for each in wrong]
    return corrected, [finding(each.cause, each.evidence, corrected=each.corrected) for each in wrong]


def _examine_walls(tracks: Tracks, walls: WallTracks) -> tuple[WallTracks, list[Finding]]:
    """Return the walls as a run moves them, and name those that are late, stated at rest, or that scatter."""
    walls, late = correct_wall_times(tracks, walls)
    walls, resting = correct_walls_at_rest(tracks, walls)
    walls, scatter = correct_wall_scatter(tracks, walls)
    found = [finding("walls_shifted", late, corrected=True)] if late else []
    found += [finding("wall_at_rest", each.evidence, corrected=each.corrected) for each in resting]
    return walls, found + ([finding("wall_scatter", scatter, corrected=True)] if scatter else [])


def _compare_rivals(
    inputs: Inputs, trial: Trial, progress: Progress, first: int, excluded: Collection[str]
) -> list[Finding]:
    """Solve the rivals of the geometry, and name the clearly best one unless its cause is excluded.

    What an error of the opposite sense raises as well is none of it: calibration removes either, and much of the noise.
    """
    offset = math.nan if trial.soft else _mean_gap(inputs)
    rivals = [each for each in rivals_of(inputs) if not each.gap * offset < GAP_SHOWN * each.gap**2]
    gains: dict[tuple[str, float], float] = {}
    for done, rival in enumerate(rivals):
        progress("diagnosing", done, len(rivals))
        gains[rival.cause, rival.size] = trial_score(rival.change(inputs), first) - trial.score
    progress("diagnosing", len(rivals), len(rivals))
    rise: dict[str, tuple[float, str]] = {}
    for rival in rivals:
        gain = gains[rival.cause, rival.size] - max(gains.get((rival.cause, -rival.size), 0.0), 0.0)
        rise[rival.cause] = max(rise.get(rival.cause, (float("-inf"), "")), (gain, rival.words))
    best = _clearest_cause(rise)
    if best and best not in excluded:
        gain, words = rise[best]
        evidence = f"if {words}, what the forces leave unexplained falls to {remainder(gain)}"
        return [finding(best, evidence, corrected=False)]  # a run has removed what it could
    worst = trial.worst
    contradicted = bool(worst.words) and not worst.little_known
    return [finding("not_explained", worst.words)] if contradicted and trial.expected[0] < UNEXPLAINED else []


@one_thread_each
def diagnose_solved(
    inputs: Inputs, results: Results, progress: Progress = no_progress, *, undisturbed: bool = False
) -> list[Finding]:
    """Diagnose a solved test, on the photographs whose forces are expected to be worst.

    Parameters
    ----------
    inputs : Inputs
        That the results were inferred from.
    results : Results
    progress : callable
        Called after every rival.
    undisturbed : bool
        As of `diagnose`.

    Returns
    -------
    list of Finding
        Rivals are compared only where some photographs have an expected r below COMPARED. The first one, to which no
        motion leads, and which no trial judges, is no reason.
    """
    check = results.friction_check
    slides = check is None or not check.agrees or not check.given_gap < QUIET
    expected = np.array([frame.expected_correlation for frame in results.frames])
    window = min(TRIAL_PHOTOGRAPHS, len(expected))
    expected[0] = np.nan
    mean = np.array([mean_of_known(expected[k : k + window]) for k in range(len(expected) - window + 1)])
    if np.isfinite(mean).any() and np.nanmin(mean) < COMPARED:
        first = int(np.nanargmin(mean))
        trial = solve_trial(inputs, first=first)
        return diagnose(inputs, trial, progress, first=first, undisturbed=undisturbed)
    found = diagnose(inputs, None, sliding=slides, undisturbed=undisturbed)
    return [*found, *_examine_wall_forces(results)]


def _examine_wall_forces(results: Results) -> list[Finding]:
    """Compare forces that are expected to be right with those that sensors record on the walls."""
    ratio = results.wall_force_ratio()
    if not contradicting(ratio):
        return []
    known = [f"{name} {each:.2f}" for name, each in zip(results.walls.name, ratio, strict=True) if np.isfinite(each)]
    return [finding("wall_forces", f"inferred normal forces on walls over the recorded ones: {', '.join(known)}")]


def _examine_sliding(inputs: Inputs, first: int) -> list[Finding]:
    """What resists the sliding in the photographs from `first` on."""
    window, _ = select_window(inputs, first=first)
    window = replace(window, settings=replace(window.settings, resistance=False))  # the input as it is stated
    try:
        sequence = correct_sequence(window)
        # overlaps of soft grains carry their forces: errors of radii or of the camera look like other friction
        return [] if sequence.settings.soft else examine_resistance(sequence, used=inputs.settings.resistance)
    except (UndeterminedError, ValueError, FloatingPointError):  # these photographs do not show it
        return []


def _mean_gap(inputs: Inputs) -> float:
    """Mean gap of touching rods over their mean diameter, by the stated radii; NaN: unknown."""
    quality = measure_data_quality(inputs.tracks, inputs.walls)
    return math.nan if quality is None else quality.gap_offset / quality.diameter


def _clearest_cause(rise: dict[str, tuple[float, str]]) -> str:
    order: Sequence[str] = sorted(rise, key=lambda cause: rise[cause][0], reverse=True)
    if not order or rise[order[0]][0] < CLEAR:
        return ""
    clear = len(order) == 1 or rise[order[0]][0] - rise[order[1]][0] > AHEAD
    return order[0] if clear else ""
