"""The tracking stage: an experiment's photographs in, tracks of its grains and walls out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ..atomic import replacing
from ..errors import InputError
from ..experiment.corrections import read_corrections
from ..experiment.experiment import Experiment, read_grain_guess, read_times, read_walls
from ..experiment.photographs import Image
from ..experiment.scaling import make_scale
from ..experiment.tables import read_table, write_table
from ..experiment.units import Scale
from ..progress import Progress
from ..results.checkpoint import Checkpoint
from ..tracks import Tracks, WallTracks
from .detection.detect import Detection, DetectionSettings, detect_grains, refine_grains
from .follow import Execution, FollowedWalls, ReferenceGrains, Series, follow_photographs, follow_walls
from .registration.manual_poses import ManualPoses
from .report.page import Tracked
from .settings import TrackingSettings
from .walls.bar_depth import visible_depth

# A bar's body beside its face is looked at over no more than this many mean radii of the grains.
BAR_DEPTH = 3.0

Columns = dict[str, NDArray[Any]]

DETECTIONS, WALLS = "detections.csv", "tracked_walls.csv"


def track_photographs(
    experiment: Experiment, stop: int, checkpoint: Path, fingerprint: str, progress: Progress
) -> tuple[Tracks, WallTracks | None, dict[str, Columns]]:
    """Tracks of the grains and walls of the frames 0 … stop − 1, and tables by file name, for the user to edit.

    checkpoint: folder for finished frames of this fingerprint. Raises InputError where nothing is found.
    """
    section, tuning = experiment.config.photographs, experiment.config.tracking
    assert section is not None
    photographs = experiment.photographs()
    count = len(photographs)
    first = photographs[0]
    scale = make_scale(section, photographs.shape[0])
    walls = read_walls(experiment, count)
    progress("detection", 0, 1)
    grains = _detect(experiment, first, scale, walls)
    progress("detection", 1, 1)
    if grains.detection.count == 0:
        raise InputError(photographs.files[0], "", "no grains were found; give them with photographs.grains")
    tables = {DETECTIONS: _detections_table(grains)}
    series = Series(photographs, read_times(experiment, count)[:stop], scale)
    if walls is not None:
        walls = walls.frames(0, stop)
        if np.isnan(walls.endpoints).any():
            followed = follow_walls(
                series, walls, _bar_depth(experiment, first, walls, scale, float(grains.radius.mean())),
                Execution(tuning.workers, Checkpoint(checkpoint / "walls", fingerprint), progress),
                source=experiment.folder / (experiment.config.walls.file if experiment.config.walls else ""),
            )  # fmt: skip
            walls = replace(followed.walls, sigma=np.sqrt((followed.sigma**2).mean(axis=2)))
            tables[WALLS] = _walls_table(followed)
    tracks = follow_photographs(
        series, grains, Execution(tuning.workers, Checkpoint(checkpoint / "tracking", fingerprint), progress),
        TrackingSettings(search_window=tuning.search_window), _manual_poses(experiment, grains.id, scale, count),
    )  # fmt: skip
    return tracks, walls, tables


def write_found_tables(folder: Path, tables: dict[str, Columns]) -> None:
    """Write what the stage found beside the results."""
    for name, columns in tables.items():
        with replacing(folder / name) as part:
            write_table(part, {key: values.tolist() for key, values in columns.items()})


def gather_report(
    experiment: Experiment, folder: Path, tracks: Tracks, walls: WallTracks | None, first_frame: int
) -> Tracked:
    """What a report needs of finished tracks; folder: where `write_found_tables` left the grains of photograph 0."""
    assert experiment.config.photographs is not None
    photographs = experiment.photographs()
    table = read_table(folder / DETECTIONS, ("id", "x", "y", "radius", "quality"))
    row = {int(name): k for k, name in enumerate(table.integers("id"))}
    for name in tracks.id:
        if int(name) not in row:
            raise InputError(table.file, f"id = {name}", "is missing: the table was edited; track again without it")
    order = [row[int(name)] for name in tracks.id]
    centre = np.stack([table.numbers("x"), table.numbers("y")], axis=1)[order]
    return Tracked(
        experiment.name, tracks, walls, first_frame, make_scale(experiment.config.photographs, photographs.shape[0]),
        centre, table.numbers("radius")[order], table.numbers("quality")[order], photographs.__getitem__,
    )  # fmt: skip


def _detect(experiment: Experiment, first: Image, scale: Scale, walls: WallTracks | None) -> ReferenceGrains:
    """The grains that are told, else those that are found."""
    section, tuning = experiment.config.photographs, experiment.config.tracking
    assert section is not None
    guess = read_grain_guess(experiment)
    if guess is not None:
        detection = refine_grains(first, guess.x, guess.y, guess.radius)
        centres = np.stack([detection.x, detection.y], axis=1)
        # Its own radius is what the user measured on this photograph, so the lens bent it too.
        return ReferenceGrains(guess.id, detection, detection.radius * scale.size_at(centres))
    classes = np.array(section.radii)
    try:
        settings = DetectionSettings(tuple(classes / scale.mean_size), tuning.radius_range)
    except ValueError as error:
        raise InputError(experiment.file, f"key photographs.radii = {list(section.radii)}", str(error)) from None
    detection = detect_grains(first, settings)
    centres = np.stack([detection.x, detection.y], axis=1)
    if walls is not None:
        within = _inside(scale.to_world(centres), walls)
        detection = _some(detection, within)
        centres = centres[within]
    if len(classes):
        radius = detection.radius * scale.mean_size
    else:
        radius = detection.radius * scale.size_at(centres)
    return ReferenceGrains(np.arange(detection.count), detection, radius)


def _inside(position: Array, walls: WallTracks) -> NDArray[np.bool_]:
    """Which circles (n,) lie between the walls of frame 0: screws and wheels of the apparatus are round, too.

    Walls that would leave next to nothing are told the wrong way round; that is said later, with all grains there.
    """
    start, end = walls.endpoints[0, :, 0], walls.endpoints[0, :, 1]
    outward = np.stack([(end - start)[:, 1], -(end - start)[:, 0]], axis=1)
    within = (np.einsum("nwk,wk->nw", position[:, None] - start, outward) < 0.0).all(axis=1)
    return within if within.mean() > 0.2 else np.ones_like(within)


def _some(detection: Detection, rows: NDArray[np.bool_]) -> Detection:
    return Detection(
        detection.x[rows], detection.y[rows], detection.radius[rows], detection.sigma[rows], detection.quality[rows]
    )


def _bar_depth(experiment: Experiment, first: Image, walls: WallTracks, scale: Scale, radius: float) -> Array:
    given = experiment.config.walls.thickness if experiment.config.walls is not None else None
    if given is not None:
        return np.full(walls.count, given)
    return visible_depth(first, walls.endpoints[0], scale, BAR_DEPTH * radius)


def _manual_poses(experiment: Experiment, ids: NDArray[np.int64], scale: Scale, count: int) -> dict[int, ManualPoses]:
    """Poses told by hand, by frame, as the tracker takes them."""
    told = read_corrections(experiment, ids, count)
    if told is None:
        return {}
    pose = np.stack([told.x, told.y, scale.angle_to_world(told.theta)], axis=1)
    at = {int(name): k for k, name in enumerate(ids)}
    row = np.array([at[int(name)] for name in told.id], dtype=np.intp)
    return {
        int(frame): ManualPoses(row[told.frame == frame], pose[told.frame == frame]) for frame in np.unique(told.frame)
    }


def _detections_table(grains: ReferenceGrains) -> Columns:
    detection = grains.detection
    return {
        "id": grains.id,
        "x": np.round(detection.x, 4),
        "y": np.round(detection.y, 4),
        "radius": np.round(detection.radius, 4),
        "sigma": np.round(detection.sigma, 4),
        "quality": np.round(detection.quality, 3),
    }


def _walls_table(followed: FollowedWalls) -> Columns:
    f, w = followed.zncc.shape
    ends = followed.walls.endpoints.reshape(f * w, 4)
    return {
        "frame": np.repeat(np.arange(f), w),
        "wall": np.tile(np.array(followed.walls.name), f),
        **{name: ends[:, k] for k, name in enumerate(("x1", "y1", "x2", "y2"))},
        "sigma1": followed.sigma[..., 0].ravel(),
        "sigma2": followed.sigma[..., 1].ravel(),
        "zncc": followed.zncc.ravel(),
        "patches": followed.patches.ravel(),
    }
