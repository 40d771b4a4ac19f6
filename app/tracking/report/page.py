"""A page that shows how well tracking went: what was detected, how it correlated, and the worst of it, close up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...experiment.photographs import Image
from ...experiment.units import Scale
from ...tracks import Tracks, TrackStatus, WallTracks
from .charts import line_chart
from .pictures import as_data, look_at, photograph_shown, residual_map, side_by_side

WORST = 12  # grains shown close up
LISTED = 200  # poses listed that need a look
DOUBTFUL = (TrackStatus.SUSPECT, TrackStatus.LOST)

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1d2430; max-width: 1080px; margin: 2.5em auto; padding: 0 1.2em }
h1 { font-size: 1.5em; margin-bottom: .2em } h2 { font-size: 1.15em; margin-top: 2.2em }
p, figcaption, .note { color: #4a5463 } figure { margin: 0 } img, svg { max-width: 100%; height: auto }
table { border-collapse: collapse; font-variant-numeric: tabular-nums }
td, th { padding: .15em .8em; text-align: right; border-bottom: 1px solid #e3e6ea }
th { font-weight: 600; color: #4a5463 }
.grains { display: grid; grid-template-columns: repeat(auto-fill, minmax(410px, 1fr)); gap: 1.2em }
.charts { display: grid; grid-template-columns: 1fr 1fr; gap: 1.5em }
pre { background: #f4f5f7; padding: .8em 1em; overflow: auto; max-height: 22em }
circle.grain { fill: none; stroke: #21b35b; stroke-width: 1.5 } circle.grain:hover { fill: #21b35b55 }
circle.unsure { stroke: #e8871e } line.wall { stroke: #2b7de9; stroke-width: 2 }
"""


@dataclass(frozen=True, slots=True)
class Tracked:
    """What a report is made from."""

    name: str
    tracks: Tracks
    walls: WallTracks | None
    first_frame: int  # of the experiment, that tracks begin with
    scale: Scale
    centre: Array  # (n, 2) [px] of the grains on photograph 0
    radius: Array  # (n,) [px]
    quality: Array  # (n,) share of the outline that was seen
    photograph: Callable[[int], Image]  # by number in the experiment

    def pose(self, frame: int) -> Array:
        """x, y [px], rotation [rad] of the picture (n, 3); NaN where lost."""
        point = self.scale.to_pixels(self.tracks.position[frame])
        return np.column_stack([point, self.scale.angle_to_world(self.tracks.rotation[frame])])


def tracking_report(tracked: Tracked) -> str:
    """The page, self-contained HTML."""
    reference = tracked.photograph(0)
    parts = [
        _summary(tracked),
        _detected(tracked, reference),
        _charts(tracked),
        _residuals(tracked, reference),
        _worst(tracked, reference),
        _to_be_looked_at(tracked),
    ]
    title = f"Tracking of {escape(tracked.name)}"
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f'<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head>\n'
        f"<body><h1>{title}</h1>\n" + "\n".join(parts) + "\n</body></html>\n"
    )


def _summary(tracked: Tracked) -> str:
    tracks = tracked.tracks
    count = {status: int((tracks.status == status).sum()) for status in TrackStatus}
    rows = "".join(
        f"<tr><th>{status.name.lower().replace('_', ' ')}</th><td>{count[status]}</td>"
        f"<td>{100 * count[status] / max(tracks.status.size, 1):.2f} %</td></tr>"
        for status in TrackStatus
        if count[status]
    )
    sigma = _percentile(tracks.sigma, 50.0)
    return (
        f"<p>{tracks.grain_count} grains in {tracks.frame_count} photographs; median ZNCC "
        f"{_percentile(tracks.zncc, 50.0):.4f}, median σ of a displacement {1e6 * sigma:.2f} µm "
        f"({sigma / tracked.scale.mean_size:.4f} px).</p><table><tr><th>status</th><th>poses</th><th></th></tr>{rows}"
        f"</table>{_renewed(tracks)}"
    )


def _renewed(tracks: Tracks) -> str:
    """Which grains are compared with a later photograph than the first."""
    if tracks.reference_frame is None or tracks.renewal_count == 0:
        return ""
    names = ", ".join(
        f"{tracks.id[row]} (from photograph {' and '.join(str(k) for k in np.unique(column) if k > 0)})"
        for row, column in enumerate(tracks.reference_frame.T)
        if (column > 0).any()
    )
    return (
        f"<p>{tracks.renewal_count} grains were damaged and got a new reference, whose own error counts in their σ: "
        f"{names}.</p>"
    )


def _detected(tracked: Tracked, reference: Image) -> str:
    picture, scale = photograph_shown(reference)
    height, width = picture.shape[:2]
    marks = []
    for k in range(len(tracked.centre)):
        x, y = (tracked.centre[k] + 0.5) * scale
        kind = "grain" if tracked.quality[k] > 0.0 else "grain unsure"
        told = f"{tracked.tracks.id[k]}: R = {tracked.radius[k]:.2f} px, outline seen {100 * tracked.quality[k]:.0f} %"
        marks.append(
            f'<circle class="{kind}" cx="{x:.2f}" cy="{y:.2f}" r="{tracked.radius[k] * scale:.2f}">'
            f"<title>{told}</title></circle>"
        )
    if tracked.walls is not None and tracked.first_frame == 0:
        for name, ends in zip(tracked.walls.name, tracked.scale.to_pixels(tracked.walls.endpoints[0]), strict=True):
            (x1, y1), (x2, y2) = (ends + 0.5) * scale
            marks.append(
                f'<line class="wall" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}">'
                f"<title>{escape(name)}</title></line>"
            )
    return (
        "<h2>What was detected</h2><p>Point at a grain for its number. Orange: its outline was not seen and it stays "
        "where it was told to be. <code>detections.csv</code> holds the table; edited, it can be given as "
        "<code>photographs.grains</code>.</p>"
        f'<figure><svg viewBox="0 0 {width} {height}" width="{width}"><image href="{as_data(picture)}" '
        f'width="{width}" height="{height}"/>{"".join(marks)}</svg></figure>'
    )


def _charts(tracked: Tracked) -> str:
    tracks = tracked.tracks
    frame = tracked.first_frame + np.arange(tracks.frame_count)

    def over_time(value: Array, percent: float) -> Array:
        return np.array([_percentile(row, percent) for row in value])

    zncc = line_chart(
        frame,
        {"median": over_time(tracks.zncc, 50.0), "worst 5 %": over_time(tracks.zncc, 5.0),
         "least": over_time(tracks.zncc, 0.0)},
        "ZNCC", "photograph",
    )  # fmt: skip
    sigma = line_chart(
        frame,
        {"median": 1e6 * over_time(tracks.sigma, 50.0), "worst 5 %": 1e6 * over_time(tracks.sigma, 95.0)},
        "σ of a displacement [µm]", "photograph",
    )  # fmt: skip
    return f'<h2>Correlation over time</h2><div class="charts">{zncc}{sigma}</div>'


def _residuals(tracked: Tracked, reference: Image) -> str:
    tracks = tracked.tracks
    chosen = _frames_to_show(tracks, tracked.first_frame)
    parts = []
    for frame in chosen:
        number = tracked.first_frame + frame
        picture, _ = residual_map(
            reference, tracked.photograph(number), tracked.centre, tracked.pose(frame), tracked.radius
        )
        parts.append(
            f'<figure><img src="{as_data(picture)}" alt="residual"><figcaption>Photograph {number}, median ZNCC '
            f"{_percentile(tracks.zncc[frame], 50.0):.4f}.</figcaption></figure>"
        )
    return (
        "<h2>Residual maps</h2><p>What is left of a photograph under each grain once the first one has been moved, "
        "turned and lit as it was found: red brighter, blue darker, full colour at half of the paint's standard "
        "deviation. Noise is even; a wrong pose, damage and shadows show as patterns. Grey: lost.</p>" + "".join(parts)
    )


def _worst(tracked: Tracked, reference: Image) -> str:
    tracks = tracked.tracks
    order = np.argsort(np.where(tracks.present & np.isfinite(tracks.zncc), tracks.zncc, np.inf), axis=None)
    shown: dict[int, int] = {}  # each grain once, at its worst
    for place in order:
        frame, row = (int(value) for value in np.unravel_index(int(place), tracks.zncc.shape))
        if not np.isfinite(tracks.zncc[frame, row]) or len(shown) == WORST:
            break
        if tracked.first_frame + frame > 0:
            shown.setdefault(row, frame)
    parts = []
    for row, frame in shown.items():
        number = tracked.first_frame + frame
        image = tracked.photograph(number)
        seen = look_at(reference, image, tracked.centre[row], tracked.pose(frame)[row], float(tracked.radius[row]))
        status = TrackStatus(tracks.status[frame, row]).name.lower().replace("_", " ")
        parts.append(
            f'<figure><img src="{as_data(side_by_side(seen))}" alt="grain {tracks.id[row]}"><figcaption>grain '
            f"{tracks.id[row]}, photograph {number}: ZNCC {tracks.zncc[frame, row]:.4f}, σ "
            f"{1e6 * tracks.sigma[frame, row]:.2f} µm, {status}{_told(tracks, frame, row)}</figcaption></figure>"
        )
    return (
        "<h2>The worst grains</h2><p>Each at its least ZNCC: on the first photograph, on that one (turned back), "
        f'and the residual.</p><div class="grains">{"".join(parts)}</div>'
    )


def _told(tracks: Tracks, frame: int, row: int) -> str:
    """What is known beyond ZNCC, σ and status."""
    told = ""
    if tracks.second_zncc is not None and np.isfinite(tracks.second_zncc[frame, row]):
        told += f", second best ZNCC {tracks.second_zncc[frame, row]:.4f}"
    if tracks.reference_frame is not None and tracks.reference_frame[frame, row] > 0:
        told += f", compared with photograph {tracks.reference_frame[frame, row]}"
    return told


def _to_be_looked_at(tracked: Tracked) -> str:
    tracks = tracked.tracks
    doubtful = np.argwhere(np.isin(tracks.status, DOUBTFUL))
    if len(doubtful) == 0:
        return "<h2>To be looked at</h2><p>No pose is lost or suspect.</p>"
    lines = ["frame,id,x,y,theta"]
    for frame, row in doubtful[:LISTED]:
        number = tracked.first_frame + int(frame)
        x, y, _ = tracked.pose(int(frame))[row]
        theta = tracks.rotation[frame, row]
        pose = f"{x:.2f},{y:.2f},{theta:.4f}" if np.isfinite(x) else "lost,lost,lost"
        lines.append(f"{number},{tracks.id[row]},{pose}")
    more = f" The first {LISTED} of {len(doubtful)}." if len(doubtful) > LISTED else ""
    return (
        "<h2>To be looked at</h2><p>Lost and suspect poses, as a table that <code>photographs.corrections</code> "
        "takes once x, y (pixels) and theta (radians, counter-clockwise; may stay empty) are mended, or "
        f"<code>lost</code> where the grain is not to be seen.{more}</p><pre>{escape(chr(10).join(lines))}</pre>"
    )


def _frames_to_show(tracks: Tracks, first: int) -> list[int]:
    """The last photograph, the one in the middle, and the one that correlates worst."""
    later: NDArray[np.int64] = np.arange(1 if first == 0 else 0, tracks.frame_count)
    if len(later) == 0:
        return []
    middle = np.array([_percentile(tracks.zncc[k], 5.0) for k in later])
    worst = later[int(np.nanargmin(middle))] if np.isfinite(middle).any() else later[-1]
    return sorted({int(later[len(later) // 2]), int(worst), int(later[-1])})


def _percentile(values: Array, percent: float) -> float:
    known = values[np.isfinite(values)]
    return float(np.percentile(known, percent)) if known.size else float("nan")
