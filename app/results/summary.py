"""What a person reads at the end of a run: the same facts as JSON and as a table on the terminal."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from solver.sequence.frame_forces import FrameStatus
from solver.statistics.agreement import Agreement

from ..atomic import write_atomically
from ..tracks import TrackStatus
from .calibration_summary import calibration_facts, calibration_lines
from .results import Results
from .truth import accuracy

STATUS_STYLE = {
    FrameStatus.SETTLED: "green",
    FrameStatus.SETTLING: "yellow",
    FrameStatus.REARRANGING: "magenta",
    FrameStatus.SUSPECT: "red",
    FrameStatus.RESET: "cyan",
    FrameStatus.FAILED: "bold red",
}
MOST_ROWS = 40  # frames shown in the terminal's table; more are thinned evenly


def summarize(results: Results, agreement: Sequence[Agreement] | None, seconds: dict[str, float]) -> dict[str, Any]:
    """Gather the summary; JSON values only."""
    frames, tracks = results.frames, results.tracks
    status = Counter(frame.status.name.lower() for frame in frames)
    settled = [frame.frame for frame in frames if frame.status is FrameStatus.SETTLED]
    lost = (tracks.status == TrackStatus.LOST) | (tracks.status == TrackStatus.OUT_OF_FRAME)
    trust = np.array([frame.trust for frame in frames])
    worst = max(frames, key=lambda frame: frame.unbalance)
    summary: dict[str, Any] = {
        "name": results.name,
        "frame_count": len(frames),
        "grain_count": results.grains.count,
        "loaded_walls": [
            name for name, load in zip(results.walls.name, results.walls.pressure, strict=True) if np.isfinite(load)
        ],
        "wall_count": results.walls.count,
        "contact_count": [frame.contacts.count for frame in frames],
        "status": [frame.status.name.lower() for frame in frames],
        "status_count": dict(status),
        "settled_after": settled[0] if settled else None,
        "reasons": [frame.reason for frame in frames],
        "radius_curve": _radius_curve(results),
        "resets": [frame.frame for frame in frames if frame.status is FrameStatus.RESET],
        "rearrangements": [frame.frame for frame in frames if frame.status is FrameStatus.REARRANGING],
        "suspects": [frame.frame for frame in frames if frame.status is FrameStatus.SUSPECT],
        "lost_grains": int(lost.any(axis=0).sum()),
        "lost_poses": int(lost.sum()),
        "suspect_poses": int((tracks.status == TrackStatus.SUSPECT).sum()),
        "position_sigma": _plain(tracks.position_sigma.tolist()),
        "worst_unbalance": _plain([worst.unbalance])[0],
        "worst_unbalance_frame": worst.frame,
        "natural_map": _plain([frame.natural_map for frame in frames]),
        "correction": _plain([frame.correction for frame in frames]),
        "trust": _plain(trust.tolist()),
        "friction_angle_degrees": _plain([float(np.rad2deg(s.friction_angle)) for s in results.statistics]),
        "coordination_number": _plain([s.coordination_number for s in results.statistics]),
        "mean_fn": _plain([s.mean_fn for s in results.statistics]),
        "friction": _friction(results),
        "wall_force_error": _wall_force_error(results),
        "calibration": results.calibration.verdict if results.calibration is not None else None,
        "corrections": calibration_facts(results.calibration, results.walls.name) if results.calibration else None,
        "radius_change": results.radius_tuning.found if results.radius_tuning is not None else None,
        "timings": {stage: round(value, 3) for stage, value in seconds.items()},
    }
    if agreement is not None:
        summary["accuracy"] = accuracy(agreement)
    return summary


def save_summary(file: Path, summary: dict[str, Any]) -> None:
    text = json.dumps(_finite(summary), indent=1, ensure_ascii=False, allow_nan=False)
    write_atomically(file, (text + "\n").encode())


def print_summary(console: Console, summary: dict[str, Any]) -> None:
    """Print the frames as a table, and below it how far they may be trusted."""
    console.print(_frame_table(summary))
    for line in trust_lines(summary):
        console.print(line, highlight=False)


def trust_lines(summary: dict[str, Any]) -> list[str]:
    """The verdict in a few sentences."""
    count = summary["status_count"]
    settled, total = count.get("settled", 0), summary["frame_count"]
    after = summary["settled_after"]
    lines = [
        f"[bold]{summary['grain_count']} grains, {total} frames.[/] "
        + (f"Settled from frame {after}; {settled} of {total} frames are settled." if settled else "No frame settled.")
    ]
    events = [
        f"{label} at frame{'s' if len(summary[key]) > 1 else ''} {_listed(summary[key])}"
        for key, label in (("resets", "reset"), ("rearrangements", "rearrangement"), ("suspects", "suspect"))
        if summary[key]
    ]
    if events:
        lines.append("Events: " + "; ".join(events) + ".")
    lost = f"{summary['lost_poses']} poses of {summary['lost_grains']} grains lost" if summary["lost_poses"] else ""
    doubtful = f"{summary['suspect_poses']} poses suspect" if summary["suspect_poses"] else ""
    tracked = ", ".join(part for part in (lost, doubtful) if part) or "every grain has a pose in every frame"
    worst = _cell(summary["worst_unbalance"], ".3f")
    lines.append(
        f"Worst grain unbalance {worst} of the mean force (frame {summary['worst_unbalance_frame']}); {tracked}."
    )
    trusted = [t for t, s in zip(summary["trust"], summary["status"], strict=True) if s == "settled" and t is not None]
    if trusted:
        lines.append(
            f"Trust (expected correlation with the true forces, given these inputs): {min(trusted):.2f} to "
            f"{max(trusted):.2f} over settled frames."
        )
    if not summary["loaded_walls"]:
        lines.append(
            "[bold]No wall carries a given pressure:[/] forces are known up to a scale, which differs between frames."
        )
    friction = summary["friction"]
    if friction is not None and friction["enclosed"]:
        verdict = "agrees with" if friction["agrees"] else "[bold red]contradicts[/]"
        measured, low, high = (_cell(friction[key], ".2f") for key in ("measured", "low", "high"))
        lines.append(
            f"Friction from the motion: {measured} ({low} to {high}), which {verdict} the given {friction['given']:g}."
        )
    if summary["wall_force_error"]:
        told = ", ".join(f"{name} {100 * error:.0f} %" for name, error in summary["wall_force_error"].items())
        lines.append(f"Inferred against recorded wall forces, rms difference over settled frames: {told}.")
    if summary["corrections"] is not None:
        lines += calibration_lines(summary["corrections"])
    if summary["radius_change"] is not None:
        lines.append(_curve_line(summary["radius_curve"]))
        lines.append(
            f"All radii changed by {summary['radius_change'] * 1e6:+.1f} µm for the wanted coordination number."
        )
    if "accuracy" in summary:
        first = min(5, total - 1)
        late = [value for value in summary["accuracy"]["r_fn"][first:] if value is not None]
        late_t = [value for value in summary["accuracy"]["r_ft"][first:] if value is not None]
        if late and late_t:
            lines.append(
                f"[bold]Against the truth, from frame {first} on: r(f_n) {np.mean(late):.3f} (least {min(late):.3f}), "
                f"r(f_t) {np.mean(late_t):.3f}.[/]"
            )
    return lines


def _frame_table(summary: dict[str, Any]) -> Table:
    table = Table(title=summary["name"], box=None, header_style="bold", pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("frame", justify="right")
    table.add_column("status")
    for heading in ("contacts", "z", "φ/°", "⟨f_n⟩/N", "residual", "ε", "trust"):
        table.add_column(heading, justify="right", no_wrap=True)
    truth = summary.get("accuracy")
    if truth:
        table.add_column("r(f_n)", justify="right", no_wrap=True)
        table.add_column("r(f_t)", justify="right", no_wrap=True)
    total = summary["frame_count"]
    shown = np.unique(np.linspace(0, total - 1, min(total, MOST_ROWS)).round().astype(int))
    for k in shown:
        status = summary["status"][k]
        cells = [
            str(k),
            f"[{STATUS_STYLE[FrameStatus[status.upper()]]}]{status}[/]",
            str(summary["contact_count"][k]),
            _cell(summary["coordination_number"][k], ".2f"),
            _cell(summary["friction_angle_degrees"][k], ".1f"),
            _cell(summary["mean_fn"][k], ".3g"),
            _cell(summary["natural_map"][k], ".0e"),
            _cell(summary["correction"][k], ".3f"),
            _cell(summary["trust"][k], ".2f"),
        ]
        if truth:
            cells += [_cell(truth["r_fn"][k], ".3f"), _cell(truth["r_ft"][k], ".3f")]
        table.add_row(*cells)
    return table


def _cell(value: float | None, form: str) -> str:
    return "–" if value is None else format(value, form)


def _radius_curve(results: Results) -> dict[str, list[float]] | None:
    """The curve z(δR) that a wanted coordination number was looked up on; δR in metres."""
    tuning = results.radius_tuning
    if tuning is None:
        return None
    return {"change": tuning.change.tolist(), "coordination_number": tuning.coordination_number.tolist()}


def _curve_line(curve: dict[str, list[float]]) -> str:
    """The curve in one line, thinned to nine points."""
    shown = np.linspace(0, len(curve["change"]) - 1, 9).round().astype(int)
    points = (f"{curve['change'][k] * 1e6:+.0f}: {curve['coordination_number'][k]:.2f}" for k in shown)
    return "Coordination number without rattlers against the change of all radii [µm]: " + ", ".join(points) + "."


def _wall_force_error(results: Results) -> dict[str, float]:
    """rms |F inferred − F recorded| / rms |F recorded| of every wall with a sensor, over settled frames."""
    recorded = results.walls.force
    settled = [frame.frame for frame in results.frames if frame.status is FrameStatus.SETTLED]
    if recorded is None or not settled:
        return {}
    inferred = np.stack([results.statistics[k].wall_force for k in settled])
    difference, size = inferred - recorded[settled], recorded[settled]
    error = {}
    for w, name in enumerate(results.walls.name):
        known = np.isfinite(size[:, w]).all(axis=1)
        if known.any() and np.any(size[known, w]):
            ratio = np.sum(difference[known, w] ** 2) / np.sum(size[known, w] ** 2)
            error[name] = float(np.sqrt(ratio))
    return error


def _friction(results: Results) -> dict[str, Any] | None:
    check = results.friction_check
    if check is None:
        return None
    return {
        "given": check.given,
        "measured": _plain([check.measured])[0],
        "low": _plain([check.low])[0],
        "high": _plain([check.high])[0],
        "frames": [check.first, check.last],
        "enclosed": check.enclosed,
        "agrees": check.agrees if check.enclosed else None,  # None: nothing can be said
    }


def _listed(frames: list[int]) -> str:
    return ", ".join(str(k) for k in frames[:8]) + (f" and {len(frames) - 8} more" if len(frames) > 8 else "")


def _finite(value: Any) -> Any:
    """The same with None for numbers that are not known: JSON has no NaN."""
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _plain(values: list[float]) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]
