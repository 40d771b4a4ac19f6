"""The tracking stage: from an experiment's photographs to tracks of its grains and walls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..experiment.boundary import apply_boundary
from ..experiment.corrections import read_corrections
from ..experiment.experiment import Experiment, read_grain_guess, read_times
from ..experiment.photographs import Photographs
from ..experiment.pictures.image import FULL_SCALE, Image
from ..experiment.reading.tables import read_table, write_table
from ..experiment.scaling import make_scale
from ..experiment.units import Scale
from ..experiment.walls import read_walls
from ..process.atomic import replacing
from ..process.errors import InputError
from ..process.frame_range import FrameRange
from ..process.progress import Progress, no_progress
from ..results.checkpoint import Checkpoint
from ..solver.bodies.grains import Array
from ..solver.bodies.wall_shapes import OUT, STRAIGHT, bounding_distance
from ..solver.parallel import available_cores
from ..tracks import Tracks, WallTracks
from . import DETECTIONS, PICTURES
from .corner_discs import CORNERS, follow_corners
from .detection.channels import count_clear, count_discs, is_coloured
from .detection.detect import Detection, DetectionSettings
from .detection.false_detections import describe_channels, describe_false_detections
from .detection.rim_quality import refine_given
from .follow import Execution, ReferenceGrains, Series, follow_photographs, follow_walls
from .fringes import measure_fringes
from .missed_rods import detect_rods
from .outline.missing_discs import add_missing_discs
from .registration.manual_poses import ManualPoses
from .report.page import TrackingReportData
from .settings import TrackingSettings
from .walls.bar_depth import MAX_BAR_DEPTH, visible_depth
from .walls.texture_or_edge import BarMotion

Columns = dict[str, NDArray[Any]]

WALLS = "tracked_walls.csv"
FEWEST_WITHIN = 0.5  # fraction of the circles between the walls below which these are wrong


def discard_message(message: str) -> None:
    """Discard a message for the user."""


def track_photographs(
    experiment: Experiment,
    stop: int,
    keep: Callable[[str], Checkpoint],
    progress: Progress,
    *,
    grains: ReferenceGrains | None = None,
    notify: Callable[[str], None] = discard_message,
) -> tuple[Tracks, WallTracks | None, dict[str, Columns]]:
    """Track the grains and walls of the frames 0 … stop − 1.

    Parameters
    ----------
    experiment : Experiment
        The experiment with photographs.
    stop : int
        Number of frames.
    keep : callable
        Returns the checkpoint of a stage, by its name.
    progress : callable
        Called with the progress.
    grains : ReferenceGrains, optional
        The grains of the first photograph, where they are known already.
    notify : callable
        Called with messages for the user.

    Returns
    -------
    tracks : Tracks
    walls : WallTracks or None
    tables : dict
        Tables of the detected grains and tracked walls by file name, for the user to edit.

    Raises
    ------
    InputError
        If no grains are found.
    """
    section, tuning = experiment.config.photographs, experiment.config.tracking
    assert section is not None
    workers = tuning.workers or available_cores()
    photographs = experiment.photographs()
    count = len(photographs)
    first = photographs[0]
    scale = make_scale(section, photographs.shape[0])
    walls = read_walls(experiment, count)
    if grains is None:
        progress("detection", 0, 1)
        grains = _detect(experiment, first, scale, walls, notify)
        progress("detection", 1, 1)
    if grains.detection.count == 0:
        raise InputError(photographs.files[0], "", f"no grains were found{_sought(section.radii, scale)}")
    tables = {DETECTIONS: _detections_table(grains)}
    missing_walls: dict[int, str] = {}
    series = Series(photographs, read_times(experiment, count)[:stop], scale)
    if walls is not None:
        walls = walls.frames(0, stop)
        discs = np.flatnonzero(np.isnan(walls.endpoints).any(axis=(0, 2, 3)) & (walls.sides == OUT))
        if len(discs):
            walls, tables[CORNERS] = follow_corners(
                experiment, series, walls, Execution(workers, keep("corners"), progress)
            )  # fmt: skip
        file = experiment.config.walls.file if experiment.config.walls is not None else None
        # Bars without a table of their own run through the discs' centres.
        if file is not None and np.isnan(walls.endpoints[:, walls.sides == STRAIGHT]).any():
            straight = np.flatnonzero(walls.sides == STRAIGHT)
            bars = walls.select(straight)
            followed = follow_walls(
                series, bars, _bar_depth(experiment, first, bars, scale, float(grains.radius.mean())),
                Execution(workers, keep("walls"), progress),
                source=experiment.folder / file,
            )  # fmt: skip
            endpoints = walls.endpoints.copy()
            sigma = np.full(walls.endpoints.shape[:2], np.nan) if walls.sigma is None else walls.sigma.copy()
            endpoints[:, straight] = followed.endpoints
            sigma[:, straight] = np.sqrt((followed.sigma**2).mean(axis=2))
            walls = replace(walls, endpoints=endpoints, sigma=sigma)
            tables[WALLS] = _walls_table(bars.name, followed)
        missing_walls = _missing_walls_by_frame(walls, photographs)
    tracks = follow_photographs(
        series, grains, Execution(workers, keep("tracking"), progress, keep(PICTURES)),
        TrackingSettings(section.follow, search_window=tuning.search_window),
        _manual_poses(experiment, grains.id, scale, count),
    )  # fmt: skip
    failed = enumerate(tracks.failed_reason or ())
    reasons = tuple("; ".join(filter(None, (reason, missing_walls.get(k)))) for k, reason in failed)
    tracks = replace(tracks, failed_reason=reasons)
    polarised = experiment.fringe_photographs()
    if polarised is not None:
        tracks = replace(tracks, fringes=measure_fringes(polarised, tracks, scale, progress))
    return tracks, walls, tables


def track_first(
    experiment: Experiment,
    count: int,
    progress: Progress = no_progress,
    notify: Callable[[str], None] = discard_message,
) -> tuple[Tracks, WallTracks | None]:
    """Track the first photographs, at most `count`, without storing anything; raises InputError."""
    stop = min(count, len(experiment.photographs()))
    with TemporaryDirectory() as folder:
        tracks, walls, _ = track_photographs(
            experiment,
            stop,
            lambda stage: Checkpoint(Path(folder) / stage, ""),
            progress,
            notify=notify,
        )
    return apply_boundary(experiment, tracks, walls), walls


def find_reference(experiment: Experiment) -> ReferenceGrains:
    """Return the grains of the first photograph, as `track_photographs` finds them."""
    section, photographs = experiment.config.photographs, experiment.photographs()
    assert section is not None
    scale = make_scale(section, photographs.shape[0])
    return _detect(experiment, photographs[0], scale, read_walls(experiment, len(photographs)), discard_message)


def write_found_tables(folder: Path, tables: dict[str, Columns]) -> None:
    """Write the tables of the stage beside the results."""
    for name, columns in tables.items():
        with replacing(folder / name) as part:
            write_table(part, {key: values.tolist() for key, values in columns.items()})


def gather_report(
    experiment: Experiment, folder: Path, tracks: Tracks, walls: WallTracks | None, frames: FrameRange
) -> TrackingReportData:
    """Collect the data of a tracking report; folder: where `write_found_tables` wrote the grains of photograph 0."""
    assert experiment.config.photographs is not None
    photographs = experiment.photographs()
    table = read_table(folder / DETECTIONS, ("id", "x", "y", "radius", "quality"))
    row = {int(name): k for k, name in enumerate(table.integers("id"))}
    for name in tracks.id:
        if int(name) not in row:
            raise InputError(table.file, f"id = {name}", "is missing: the table was edited; track again without it")
    order = [row[int(name)] for name in tracks.id]
    centre = np.stack([table.numbers("x"), table.numbers("y")], axis=1)[order]
    return TrackingReportData(
        experiment.name, tracks, walls, frames, make_scale(experiment.config.photographs, photographs.shape[0]),
        centre, table.numbers("radius")[order], table.numbers("quality")[order], photographs.__getitem__,
    )  # fmt: skip


def _detect(
    experiment: Experiment, first: Image, scale: Scale, walls: WallTracks | None, notify: Callable[[str], None]
) -> ReferenceGrains:
    """The given grains, else the detected ones."""
    section, tuning = experiment.config.photographs, experiment.config.tracking
    assert section is not None
    guess = read_grain_guess(experiment)
    if guess is not None:
        detection = refine_given(first, guess.x, guess.y, guess.radius)
        if section.follow == "outline":  # dark discs are given as well
            dark = refine_given(np.float32(FULL_SCALE) - first, guess.x, guess.y, guess.radius)
            detection = max(detection, dark, key=lambda found: found.seen_area)
        centres = np.stack([detection.x, detection.y], axis=1)
        # The user measured the radius on this photograph, so it contains the lens distortion.
        return ReferenceGrains(guess.id, detection, detection.radius * scale.size_at(centres))
    classes = np.array(section.radii)
    try:
        settings = DetectionSettings(tuple(classes / scale.mean_size), tuning.radius_range)
    except ValueError as error:
        raise InputError(experiment.file, f"key photographs.radii = {list(section.radii)}", str(error)) from None
    detection = detect_rods(first, settings)
    if section.follow == "outline":
        # Dark discs on a light background are detected as well.
        dark = detect_rods(np.float32(FULL_SCALE) - first, settings)
        detection = max(detection, dark, key=lambda found: found.seen_area)
        detection = add_missing_discs(first, detection)
    centres = np.stack([detection.x, detection.y], axis=1)
    within = _inside_walls(scale.to_world(centres), walls) if walls is not None else None
    if within is not None and len(within) and within.mean() < FEWEST_WITHIN:
        within = None  # the walls are wrong, not the circles: the check of the packing names the mistake
    messages = [
        *_channel_messages(experiment, settings, detection),
        *describe_false_detections(detection, within, first.shape),
    ]
    for message in messages:
        notify(message)
    if within is not None:
        detection = detection.select(within)
        centres = centres[within]
    if len(classes):
        radius = detection.radius * scale.mean_size
    else:
        radius = detection.radius * scale.size_at(centres)
    return ReferenceGrains(np.arange(detection.count), detection, radius)


def _sought(radii: Sequence[float], scale: Scale) -> str:
    """Name the radii that were sought, as they are in the photograph, and what to do."""
    pixels = ", ".join(f"{radius / scale.mean_size:.3g}" for radius in radii)
    cure = "give them with photographs.grains"
    if not radii:
        return f"; {cure}"
    return f" of the radii photographs.radii, {pixels} px at this pixel_size: correct one of both, or {cure}"


def _channel_messages(experiment: Experiment, settings: DetectionSettings, detection: Detection) -> list[str]:
    """Message if more discs of a colour photograph are detected in another channel."""
    section = experiment.config.photographs
    assert section is not None
    channels = experiment.photographs().in_channels(0)
    if not is_coloured(channels):
        return []
    return describe_channels(count_discs(channels, settings), section.channel, count_clear(detection))


def _inside_walls(position: Array, walls: WallTracks) -> NDArray[np.bool_]:
    """Which circles (n,) lie between the walls of frame 0: screws and wheels of the apparatus are round as well.

    Walls that would exclude nearly all grains have the wrong direction; a later check reports that, with all grains.
    """
    depth, _ = bounding_distance(walls.endpoints[0], walls.sides, position)
    within = np.asarray((depth > 0.0).all(axis=1))
    return within if within.sum() > 0.2 * len(within) else np.ones_like(within)


def _bar_depth(experiment: Experiment, first: Image, walls: WallTracks, scale: Scale, radius: float) -> Array:
    given = experiment.config.walls.thickness if experiment.config.walls is not None else None
    if given is not None:
        return np.full(walls.count, given)
    return visible_depth(first, walls.endpoints[0], scale, MAX_BAR_DEPTH * radius)


def _manual_poses(experiment: Experiment, ids: NDArray[np.int64], scale: Scale, count: int) -> dict[int, ManualPoses]:
    """Poses given by hand, by frame, in the tracker's units."""
    corrections = read_corrections(experiment, ids, count)
    if corrections is None:
        return {}
    pose = np.stack([corrections.x, corrections.y, scale.angle_to_world(corrections.theta)], axis=1)
    row_of = {int(name): k for k, name in enumerate(ids)}
    row = np.array([row_of[int(name)] for name in corrections.id], dtype=np.intp)
    frame = corrections.frame
    return {int(k): ManualPoses(row[frame == k], pose[frame == k]) for k in np.unique(frame)}


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


def _missing_walls_by_frame(walls: WallTracks, photographs: Photographs) -> dict[int, str]:
    """Messages for the frames in which walls were not found."""
    missing_walls: dict[int, list[str]] = {}
    for k, w in np.argwhere(np.isnan(walls.endpoints).any(axis=(2, 3))).tolist():
        missing_walls.setdefault(k, []).append(repr(walls.name[w]))
    return {
        k: f"wall {', '.join(names)} is not found in {photographs.files[k].name}: give its position in that frame"
        for k, names in missing_walls.items()
    }


def _walls_table(names: Sequence[str], followed: BarMotion) -> Columns:
    f, w = followed.zncc.shape
    ends = followed.endpoints.reshape(f * w, 4)
    columns: Columns = {
        "frame": np.repeat(np.arange(f), w),
        "wall": np.tile(np.array(names), f),
        **{name: ends[:, k] for k, name in enumerate(("x1", "y1", "x2", "y2"))},
        "sigma1": followed.sigma[..., 0].ravel(),
        "sigma2": followed.sigma[..., 1].ravel(),
        "zncc": followed.zncc.ravel(),
        "patches": followed.patches.ravel(),
        "edge": np.round(followed.edge, 3).ravel(),
    }
    found = np.isfinite(ends).all(axis=1)
    return {name: values[found] for name, values in columns.items()}
