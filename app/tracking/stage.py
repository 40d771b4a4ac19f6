"""The tracking stage: an experiment's photographs in, tracks of its grains and walls out."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.wall_shapes import STRAIGHT, reach_of_wall

from ..atomic import replacing
from ..errors import InputError
from ..experiment.boundary import bound_tracks
from ..experiment.corrections import read_corrections
from ..experiment.experiment import Experiment, read_grain_guess, read_times
from ..experiment.photographs import FULL_SCALE, Image, Photographs
from ..experiment.reading.tables import read_table, write_table
from ..experiment.scaling import make_scale
from ..experiment.units import Scale
from ..experiment.walls import read_walls
from ..progress import Observer, Progress, silent, unheard
from ..results.checkpoint import Checkpoint
from ..tracks import Tracks, WallTracks
from . import DETECTIONS, PICTURES
from .detection.channels import count_discs, is_coloured
from .detection.detect import Detection, DetectionSettings, detect_grains, refine_grains
from .detection.strangers import describe_channels, describe_strangers
from .follow import Execution, FollowedWalls, ReferenceGrains, Series, follow_photographs, follow_walls
from .registration.manual_poses import ManualPoses
from .report.page import Tracked
from .settings import TrackingSettings
from .walls.bar_depth import visible_depth

# A bar's body beside its face is looked at over no more than this many mean radii of the grains.
BAR_DEPTH = 3.0

Columns = dict[str, NDArray[Any]]

WALLS = "tracked_walls.csv"


def untold(sentence: str) -> None:
    """Keep a sentence for the user to oneself."""


def track_photographs(
    experiment: Experiment,
    stop: int,
    keep: Callable[[str], Checkpoint],
    progress: Progress,
    observer: Observer,
    *,
    grains: ReferenceGrains | None = None,
    tell: Callable[[str], None] = untold,
) -> tuple[Tracks, WallTracks | None, dict[str, Columns]]:
    """Tracks of the grains and walls of the frames 0 … stop − 1, and tables by file name, for the user to edit.

    grains: of the first photograph, where they are found already. keep: gives the checkpoint of a stage by its name;
    observer: hears what a photograph could not be followed for; tell: gets sentences for the user.
    Raises InputError where nothing is found.
    """
    section, tuning = experiment.config.photographs, experiment.config.tracking
    assert section is not None
    workers = tuning.workers or _cores()
    photographs = experiment.photographs()
    count = len(photographs)
    first = photographs[0]
    scale = make_scale(section, photographs.shape[0])
    walls = read_walls(experiment, count)
    if grains is None:
        progress("detection", 0, 1)
        grains = _detect(experiment, first, scale, walls, tell)
        progress("detection", 1, 1)
    if grains.detection.count == 0:
        raise InputError(photographs.files[0], "", "no grains were found; give them with photographs.grains")
    tables = {DETECTIONS: _detections_table(grains)}
    unfound: dict[int, str] = {}
    series = Series(photographs, read_times(experiment, count)[:stop], scale)
    if walls is not None:
        walls = walls.frames(0, stop)
        if np.isnan(walls.endpoints).any():
            straight = np.flatnonzero(walls.sides == STRAIGHT)
            bars = walls.select(straight)
            followed = follow_walls(
                series, bars, _bar_depth(experiment, first, bars, scale, float(grains.radius.mean())),
                Execution(workers, keep("walls"), progress, observer),
                source=experiment.folder / ((experiment.config.walls and experiment.config.walls.file) or ""),
            )  # fmt: skip
            endpoints, sigma = walls.endpoints.copy(), np.full(walls.endpoints.shape[:2], np.nan)
            endpoints[:, straight] = followed.walls.endpoints
            sigma[:, straight] = np.sqrt((followed.sigma**2).mean(axis=2))
            walls = replace(walls, endpoints=endpoints, sigma=sigma)
            unfound = _name_unfound(walls, photographs)
            tables[WALLS] = _walls_table(followed)
    tracks = follow_photographs(
        series, grains, Execution(workers, keep("tracking"), progress, observer, keep(PICTURES)),
        TrackingSettings(section.follow, search_window=tuning.search_window),
        _manual_poses(experiment, grains.id, scale, count),
    )  # fmt: skip
    reasons = ("; ".join(filter(None, (said, unfound.get(k)))) for k, said in enumerate(tracks.failed_reason or ()))
    return replace(tracks, failed_reason=tuple(reasons)), walls, tables


def track_first(
    experiment: Experiment, count: int, progress: Progress = silent, tell: Callable[[str], None] = untold
) -> tuple[Tracks, WallTracks | None]:
    """Tracks of the first photographs, at most `count`, of which nothing is kept. Raises InputError."""
    stop = min(count, len(experiment.photographs()))
    with TemporaryDirectory() as folder:
        tracks, walls, _ = track_photographs(
            experiment, stop, lambda stage: Checkpoint(Path(folder) / stage, ""), progress, unheard, tell=tell
        )
    return bound_tracks(experiment, tracks, walls), walls


def find_reference(experiment: Experiment) -> ReferenceGrains:
    """The grains of the first photograph, as `track_photographs` finds them."""
    section, photographs = experiment.config.photographs, experiment.photographs()
    assert section is not None
    scale = make_scale(section, photographs.shape[0])
    return _detect(experiment, photographs[0], scale, read_walls(experiment, len(photographs)), untold)


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


def _detect(
    experiment: Experiment, first: Image, scale: Scale, walls: WallTracks | None, tell: Callable[[str], None]
) -> ReferenceGrains:
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
    if section.follow == "outline":
        # Dark discs on a light ground are as good.
        dark = detect_grains(np.float32(FULL_SCALE) - first, settings)
        detection = max(detection, dark, key=lambda found: float(found.quality @ found.radius))
    centres = np.stack([detection.x, detection.y], axis=1)
    within = _inside(scale.to_world(centres), walls) if walls is not None else None
    for sentence in [*_about_channels(experiment, settings), *describe_strangers(detection, within, first.shape)]:
        tell(sentence)
    if within is not None:
        detection = _some(detection, within)
        centres = centres[within]
    if len(classes):
        radius = detection.radius * scale.mean_size
    else:
        radius = detection.radius * scale.size_at(centres)
    return ReferenceGrains(np.arange(detection.count), detection, radius)


def _cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _about_channels(experiment: Experiment, settings: DetectionSettings) -> list[str]:
    """Whether discs of a colour photograph stand out better in another channel."""
    section = experiment.config.photographs
    assert section is not None
    channels = experiment.photographs().in_channels(0)
    if not is_coloured(channels):
        return []
    return describe_channels(count_discs(channels, settings), section.channel)


def _inside(position: Array, walls: WallTracks) -> NDArray[np.bool_]:
    """Which circles (n,) lie between the walls of frame 0: screws and wheels of the apparatus are round, too.

    Walls that would leave next to nothing are told the wrong way round; that is said later, with all grains there.
    """
    depth, _ = reach_of_wall(walls.endpoints[0], walls.sides, position[:, None])
    within = np.asarray((depth > 0.0).all(axis=1))
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


def _name_unfound(walls: WallTracks, photographs: Photographs) -> dict[int, str]:
    """The frames in which walls were not found, and what to do about it."""
    unfound: dict[int, list[str]] = {}
    for k, w in np.argwhere(np.isnan(walls.endpoints).any(axis=(2, 3))).tolist():
        unfound.setdefault(k, []).append(repr(walls.name[w]))
    return {
        k: f"wall {', '.join(names)} is not found in {photographs.files[k].name}: give its position in that frame"
        for k, names in unfound.items()
    }


def _walls_table(followed: FollowedWalls) -> Columns:
    f, w = followed.zncc.shape
    ends = followed.walls.endpoints.reshape(f * w, 4)
    columns: Columns = {
        "frame": np.repeat(np.arange(f), w),
        "wall": np.tile(np.array(followed.walls.name), f),
        **{name: ends[:, k] for k, name in enumerate(("x1", "y1", "x2", "y2"))},
        "sigma1": followed.sigma[..., 0].ravel(),
        "sigma2": followed.sigma[..., 1].ravel(),
        "zncc": followed.zncc.ravel(),
        "patches": followed.patches.ravel(),
    }
    found = np.isfinite(ends).all(axis=1)
    return {name: values[found] for name, values in columns.items()}
