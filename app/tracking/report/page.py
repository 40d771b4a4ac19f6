"""The tracking report: detected grains, correlation over time, residual maps, and the worst grains in close-up.

This module collects the content of the page; the template beside it defines its layout.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...experiment.pictures.image import Image
from ...experiment.units import Scale
from ...process.frame_range import FrameRange
from ...solver.bodies.grains import Array
from ...solver.bodies.wall_shapes import STRAIGHT
from ...tracks import Tracks, TrackStatus, WallTracks
from .charts import Labels, line_chart, stacked_chart
from .residual_pictures import (
    FULL_COLOUR,
    RAMP,
    as_data,
    compare_patches,
    display_photograph,
    residual_map,
    side_by_side,
)

TEMPLATE = Path(__file__).with_name("page.html")

WORST = 12  # grains shown in close-up
LISTED = 200  # lost and suspect poses that are listed
AMBIGUOUS = (TrackStatus.SUSPECT, TrackStatus.LOST)

Facts = dict[str, Any]  # values by their names in the template


@dataclass(frozen=True, slots=True)
class TrackingReportData:
    """Input of a tracking report."""

    name: str
    tracks: Tracks
    walls: WallTracks | None
    frames: FrameRange  # photographs of the experiment that the tracks cover
    scale: Scale
    centre: Array  # (n, 2) [px] of the grains on photograph 0
    radius: Array  # (n,) [px]
    quality: Array  # (n,) fraction of the outline that was detected
    photograph: Callable[[int], Image]  # by number in the experiment

    def pose(self, frame: int) -> Array:
        """Return x, y [px], rotation [rad] of the picture (n, 3); NaN where lost."""
        point = self.scale.to_pixels(self.tracks.position[frame])
        return np.column_stack([point, self.scale.angle_to_world(self.tracks.rotation[frame])])


def tracking_report(tracked: TrackingReportData) -> str:
    """Render the page as self-contained HTML."""
    # Imported here, because runs without a report must not wait for it.
    from jinja2 import Environment, StrictUndefined

    reference = tracked.photograph(0)
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        **_summary(tracked),
        **_detected(tracked, reference),
        charts=_charts(tracked),
        maps=_residual_maps(tracked, reference),
        ramp=[f"rgb({red}, {green}, {blue})" for blue, green, red in RAMP],
        full_colour=FULL_COLOUR,
        worst=_worst(tracked, reference),
        **_ambiguous(tracked),
    )


def _summary(tracked: TrackingReportData) -> Facts:
    tracks = tracked.tracks
    count = {_status_words(status): int((tracks.status == status).sum()) for status in TrackStatus}
    return {
        "name": tracked.name,
        "grain_count": tracks.grain_count,
        "frame_count": tracks.frame_count,
        "zncc": _percentile(tracks.zncc, 50.0),
        "sigma": _percentile(tracks.sigma, 50.0),
        "pixel_size": tracked.scale.mean_size,
        "counts": {words: number for words, number in count.items() if number},
        "pose_count": max(tracks.status.size, 1),
        "renewal_count": tracks.renewal_count,
        "renewed": _renewed_grains(tracks),
    }


def _renewed_grains(tracks: Tracks) -> list[str]:
    """Names of the grains whose reference is a later photograph than the first."""
    if tracks.reference_frame is None:
        return []
    return [
        f"{tracks.id[row]} (from photograph {' and '.join(str(k) for k in np.unique(column) if k > 0)})"
        for row, column in enumerate(tracks.reference_frame.T)
        if (column > 0).any()
    ]


def _detected(tracked: TrackingReportData, reference: Image) -> Facts:
    picture, scale = display_photograph(reference)
    height, width = picture.shape[:2]
    place = (tracked.centre + 0.5) * scale
    grains = [
        {"id": name, "x": x, "y": y, "shown_radius": radius * scale, "radius": radius, "quality": quality}
        for name, (x, y), radius, quality in zip(tracked.tracks.id, place, tracked.radius, tracked.quality, strict=True)
    ]
    walls = []
    if tracked.walls is not None and tracked.frames.start == 0:
        bars = tracked.walls.select(np.flatnonzero(tracked.walls.sides == STRAIGHT))  # circles were not looked for
        for name, ends in zip(bars.name, tracked.scale.to_pixels(bars.endpoints[0]), strict=True):
            (x1, y1), (x2, y2) = (ends + 0.5) * scale
            walls.append({"name": name, "x1": x1, "y1": y1, "x2": x2, "y2": y2})
    photograph = {"data": as_data(picture), "width": width, "height": height}
    return {"photograph": photograph, "detected": grains, "walls": walls}


def _charts(tracked: TrackingReportData) -> list[str]:
    tracks = tracked.tracks
    # The first photograph correlates perfectly with itself, which would compress the scale.
    begin = 1 if tracked.frames.start == 0 and tracks.frame_count > 1 else 0
    frame = tracked.frames.start + tracked.frames.step * np.arange(begin, tracks.frame_count)
    zncc, sigma, status = tracks.zncc[begin:], 1e6 * tracks.sigma[begin:], tracks.status[begin:]

    def over_time(value: Array, percent: float) -> Array:
        return np.array([_percentile(row, percent) for row in value])

    correlation = {
        "median": over_time(zncc, 50.0),
        "worst 5 %": over_time(zncc, 5.0),
        "least": over_time(zncc, 0.0),
    }
    precision = {"median": over_time(sigma, 50.0), "worst 5 %": over_time(sigma, 95.0)}
    charts = [
        line_chart(frame, correlation, Labels("Correlation with the first photograph", "photograph", "ZNCC")),
        line_chart(frame, precision, Labels("Standard deviation of a displacement", "photograph", "σ [µm]")),
    ]
    unusual = {_status_words(kind): (status == kind).sum(axis=1) for kind in TrackStatus if kind is not TrackStatus.OK}
    unusual = {words: count for words, count in unusual.items() if count.any()}
    if unusual:
        charts.append(stacked_chart(frame, unusual, Labels("Grains not found where predicted", "photograph", "grains")))
    return charts


def _residual_maps(tracked: TrackingReportData, reference: Image) -> list[Facts]:
    maps = []
    for frame in _frames_to_show(tracked.tracks, tracked.frames.start):
        number = tracked.frames.number(frame)
        picture, _ = residual_map(
            reference, tracked.photograph(number), tracked.centre, tracked.pose(frame), tracked.radius
        )
        zncc = _percentile(tracked.tracks.zncc[frame], 50.0)
        maps.append({"photograph": number, "zncc": zncc, "data": as_data(picture)})
    return maps


def _worst(tracked: TrackingReportData, reference: Image) -> list[Facts]:
    tracks = tracked.tracks
    order = np.argsort(np.where(tracks.present & np.isfinite(tracks.zncc), tracks.zncc, np.inf), axis=None)
    shown: dict[int, int] = {}  # each grain once, at its worst
    for place in order:
        frame, row = (int(value) for value in np.unravel_index(int(place), tracks.zncc.shape))
        if not np.isfinite(tracks.zncc[frame, row]) or len(shown) == WORST:
            break
        if tracked.frames.number(frame) > 0:
            shown.setdefault(row, frame)
    grains = []
    for row, frame in shown.items():
        number = tracked.frames.number(frame)
        image = tracked.photograph(number)
        pose, radius = tracked.pose(frame)[row], float(tracked.radius[row])
        comparison = compare_patches(reference, image, tracked.centre[row], pose, radius)
        data, facts = as_data(side_by_side(comparison)), _facts_of_pose(tracks, frame, row)
        grains.append({"id": tracks.id[row], "photograph": number, "data": data, "facts": facts})
    return grains


def _facts_of_pose(tracks: Tracks, frame: int, row: int) -> list[str]:
    facts = [
        f"ZNCC {tracks.zncc[frame, row]:.4f}",
        f"σ {1e6 * tracks.sigma[frame, row]:.2f} µm",
        _status_words(TrackStatus(tracks.status[frame, row])),
    ]
    if tracks.second_zncc is not None and np.isfinite(tracks.second_zncc[frame, row]):
        facts.append(f"second best ZNCC {tracks.second_zncc[frame, row]:.4f}")
    if tracks.reference_frame is not None and tracks.reference_frame[frame, row] > 0:
        facts.append(f"compared with photograph {tracks.reference_frame[frame, row]}")
    return facts


def _ambiguous(tracked: TrackingReportData) -> Facts:
    """Lost and suspect poses as the rows of a table of corrections."""
    tracks = tracked.tracks
    found = np.argwhere(np.isin(tracks.status, AMBIGUOUS))
    lines = []
    for frame, row in found[:LISTED]:
        number = tracked.frames.number(int(frame))
        x, y, _ = tracked.pose(int(frame))[row]
        theta = tracks.rotation[frame, row]
        pose = f"{x:.2f},{y:.2f},{theta:.4f}" if np.isfinite(x) else "lost,lost,lost"
        lines.append(f"{number},{tracks.id[row]},{pose}")
    return {"ambiguous": lines, "ambiguous_count": len(found)}


def _frames_to_show(tracks: Tracks, first: int) -> list[int]:
    """The last photograph, the one in the middle, and the one that correlates worst."""
    later: NDArray[np.int64] = np.arange(1 if first == 0 else 0, tracks.frame_count)
    if len(later) == 0:
        return []
    middle = np.array([_percentile(tracks.zncc[k], 5.0) for k in later])
    worst = later[int(np.nanargmin(middle))] if np.isfinite(middle).any() else later[-1]
    return sorted({int(later[len(later) // 2]), int(worst), int(later[-1])})


def _status_words(status: TrackStatus) -> str:
    return status.name.lower().replace("_", " ")


def _percentile(values: Array, percent: float) -> float:
    known = values[np.isfinite(values)]
    return float(np.percentile(known, percent)) if known.size else float("nan")
