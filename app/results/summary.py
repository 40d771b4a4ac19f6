"""The summary of a run, as plain values and as JSON."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..process.atomic import write_atomically
from ..solver.assessment.intervals.statistic_intervals import CONSTANT
from ..solver.bodies.packing import fraction_on_free_grains
from ..solver.frame_forces import ERROR_PARTS, FrameForces, FrameStatus
from ..solver.statistics.agreement import Agreement
from ..solver.statistics.frame_statistics import FrameStatistics
from ..tracks import TrackStatus, WallTracks
from .calibration_summary import calibration_facts, camera_facts
from .results import Results, setting
from .truth import accuracy

ABOVE = 0.5  # outward normal along the vertical, from which on a wall is above the packing
ADDED = 0.1  # of the weight


class _Frame(NamedTuple):
    """Values of a frame for the summary: frames are read one after the other, and only once."""

    frame: int
    status: FrameStatus
    reason: str
    failed_reason: str
    contact_count: int
    trust: float
    expected_correlation: float
    scale_sd: float
    trust_penalties: str
    unbalance: float
    natural_map: float
    correction: float
    fn_deviation: float
    relative_error: float
    error_budget: list[float] | None

    @classmethod
    def of(cls, forces: FrameForces) -> _Frame:
        return cls(
            forces.frame, forces.status, forces.reason, forces.failed_reason, forces.contacts.count, forces.trust,
            forces.expected_correlation, forces.scale_sd, forces.trust_penalties, forces.unbalance,
            forces.natural_map, forces.correction, _median_deviation(forces), forces.relative_error,
            None if forces.error_budget is None else forces.error_budget.tolist(),
        )  # fmt: skip


class _Statistics(NamedTuple):
    """Values of a frame's statistics for the summary."""

    friction_angle: float
    coordination_number: float
    mean_fn: float
    deviations: Float[np.ndarray, " d"]  # of DEVIATION
    wall_force: Float[np.ndarray, "w 2"]  # [N]

    @classmethod
    def of(cls, statistics: FrameStatistics) -> _Statistics:
        deviations = np.array([getattr(statistics, f"{name}_sd") for name in CONSTANT])
        return cls(
            statistics.friction_angle, statistics.coordination_number, statistics.mean_fn, deviations,
            statistics.wall_force,
        )  # fmt: skip


def summarize(results: Results, agreement: Sequence[Agreement] | None, seconds: dict[str, float]) -> dict[str, Any]:
    """Return the summary of a run as JSON values.

    Parameters
    ----------
    results
        The results of the run.
    agreement
        Agreement with the truth per frame; None without a truth.
    seconds
        Duration of each stage [s].
    """
    frames, tracks = [_Frame.of(each) for each in results.frames], results.tracks
    statistics = [_Statistics.of(each) for each in results.statistics]
    status = Counter(frame.status.name.lower() for frame in frames)
    settled = [frame.frame for frame in frames if frame.status is FrameStatus.SETTLED]
    lost, cut = tracks.lost, tracks.out_of_frame
    trust = np.array([frame.trust for frame in frames])
    solved = [frame for frame in frames if frame.status is not FrameStatus.FAILED]
    worst = max(solved or frames, key=lambda frame: frame.unbalance)
    weight = results.weight.sum(axis=0)
    summary: dict[str, Any] = {
        "name": results.name,
        "frame_count": len(frames),
        "grain_count": results.grains.count,
        "loaded_walls": [name for name, loaded in zip(results.walls.name, results.walls.loaded, strict=True) if loaded],
        "wall_count": results.walls.count,
        "contact_count": [frame.contact_count for frame in frames],
        "status": [frame.status.name.lower() for frame in frames],
        "status_count": dict(status),
        "settled_after": settled[0] if settled else None,
        "reasons": [frame.reason for frame in frames],
        "radius_curve": _radius_curve(results),
        "resets": [frame.frame for frame in frames if frame.status is FrameStatus.RESET],
        "rearrangements": [frame.frame for frame in frames if frame.status is FrameStatus.REARRANGING],
        "suspects": [frame.frame for frame in frames if frame.status is FrameStatus.SUSPECT],
        "failures": {frame.frame: frame.failed_reason for frame in frames if frame.status is FrameStatus.FAILED},
        "lost_grains": int(lost.any(axis=0).sum()),
        "inferred_grains": int(tracks.inferred.sum()) if tracks.inferred is not None else 0,
        "lost_poses": int(lost.sum()),
        "cut_grains": int(cut.any(axis=0).sum()),
        "cut_poses": int(cut.sum()),
        "suspect_poses": int((tracks.status == TrackStatus.SUSPECT).sum()),
        "position_sigma": _plain(tracks.position_sigma.tolist()),
        "worst_unbalance": _plain([worst.unbalance])[0],
        "worst_unbalance_frame": worst.frame,
        "natural_map": _plain([frame.natural_map for frame in frames]),
        "correction": _plain([frame.correction for frame in frames]),
        "trust": _plain(trust.tolist()),
        "expected_correlation": _plain([frame.expected_correlation for frame in frames]),
        "scale_sd": _plain([frame.scale_sd for frame in frames]),
        "trust_penalties": [frame.trust_penalties for frame in frames],
        "friction_angle_degrees": _plain([float(np.rad2deg(each.friction_angle)) for each in statistics]),
        "coordination_number": _plain([each.coordination_number for each in statistics]),
        "force_unit": results.force_unit,
        "mean_fn": _plain([each.mean_fn for each in statistics]),
        "deviations": {
            name: _plain([float(each.deviations[n]) for each in statistics]) for n, name in enumerate(CONSTANT)
        },
        "error_budget": _error_budget(frames),
        "fn_deviation": _plain([frame.fn_deviation for frame in frames]),
        "loads": _loads(results),
        "weight": float(np.linalg.norm(weight)) if weight.any() else None,
        "walls_above": press_from_above(results.walls, np.array([each.wall_force for each in statistics]), weight),
        "diagnosis": [each.as_plain() for each in results.diagnosis],
        "friction": _friction(results),
        "base_friction": results.base_friction,
        "wall_force_error": _wall_force_error(results, settled),
        "calibration": results.calibration.verdict if results.calibration is not None else None,
        "boundary": results.boundary.describe(results.walls.name) if results.boundary is not None else [],
        "corrections": calibration_facts(results.calibration, results.walls.name) if results.calibration else None,
        "camera": None if results.lens is None else camera_facts(results.lens),
        "radius_change": results.radius_tuning.found if results.radius_tuning is not None else None,
        "timings": {stage: round(value, 3) for stage, value in seconds.items()},
    }
    if agreement is not None:
        summary["accuracy"] = accuracy(agreement)
    return summary


def _error_budget(frames: Sequence[_Frame]) -> dict[str, Any] | None:
    """Return the error fraction of each source and the relative error by frame; None where not computed."""
    fractions = [frame.error_budget for frame in frames]
    if not any(fractions):
        return None
    unknown = [float("nan")] * len(ERROR_PARTS)
    columns = zip(*(each or unknown for each in fractions), strict=True)
    return {
        "share": {name: _plain(list(column)) for name, column in zip(ERROR_PARTS, columns, strict=True)},
        "relative_error": _plain([frame.relative_error for frame in frames]),
    }


def _median_deviation(frame: FrameForces) -> float:
    """Return the median standard deviation of f_n over the mean f_n of bearing contacts; NaN without any."""
    bearing = frame.fn > 0
    return float(np.median(frame.fn_sd[bearing]) / frame.fn[bearing].mean()) if bearing.any() else float("nan")


def save_summary(file: Path, summary: dict[str, Any]) -> None:
    """Write the summary as JSON."""
    text = json.dumps(_finite(summary), indent=1, ensure_ascii=False, allow_nan=False)
    write_atomically(file, (text + "\n").encode())


def _radius_curve(results: Results) -> dict[str, list[float]] | None:
    """Return the curve z(δR) on which the requested coordination number was found; δR in metres."""
    tuning = results.radius_tuning
    if tuning is None:
        return None
    return {"change": tuning.change.tolist(), "coordination_number": tuning.coordination_number.tolist()}


def _wall_force_error(results: Results, settled: list[int]) -> dict[str, float]:
    """Return rms |F inferred − F recorded| / rms |F recorded| of every wall with a sensor, over settled frames."""
    recorded = results.walls.force
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
        "sliding": _plain([check.sliding])[0],
        "walls": _plain([check.wall_measured, check.wall_low, check.wall_high]),
        "agrees": check.agrees if check.enclosed else None,  # None: undetermined
    }


def _loads(results: Results) -> list[dict[str, Any]]:
    """Return the load on every plate [N] with what it follows from; measured ones as mean and range."""
    walls, length, found = results.walls, setting(results.configuration, "material", "length"), []
    first = walls.at_rest(0)
    width = first.face
    free = fraction_on_free_grains(results.grains, first, results.tracks.position[0], results.tracks.present[0])
    for w, name in enumerate(walls.name):
        measured = np.empty(0) if walls.load is None else walls.load[:, w][np.isfinite(walls.load[:, w])]
        pressure = float(walls.pressure[w])
        known: dict[str, Any] = {"wall": name, "width": float(width[w]), "length": length, "pressure": None}
        known["fraction_on_free_rods"] = float(free[w])
        if len(measured):
            limits = [float(measured.min()), float(measured.max())]
            found.append(known | {"force": float(measured.mean()), "range": limits})
        elif np.isfinite(pressure) and length is not None:
            found.append(known | {"pressure": pressure, "force": pressure * float(width[w]) * length})
    return found


def press_from_above(
    walls: WallTracks, force: Float[np.ndarray, "f w 2"], weight: Float[np.ndarray, "2"]
) -> dict[str, float]:
    """Return, by name of a wall above the packing without a given load, its median force down over the weight [N].

    The weight alone does not set the scale of the forces where such a wall adds any force to it. Walls that add less
    than ADDED are left out. force [N]: of the packing on the walls.
    """
    size = float(np.linalg.norm(weight))
    if not size > 0.0 or walls.count == 0:
        return {}
    up = -weight / size
    first = walls.at_rest(0)
    above = (first.outward @ up > ABOVE) & ~first.curved & ~walls.loaded
    lifted = force @ up
    solved = lifted[np.isfinite(lifted).all(axis=1)]
    if len(solved) == 0:
        return {}
    pressed = np.median(solved, axis=0) / size
    return {walls.name[w]: float(pressed[w]) for w in np.flatnonzero(above & (pressed > ADDED))}


def _finite(value: Any) -> Any:
    """Replace unknown numbers by None, because JSON has no NaN."""
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _plain(values: list[float]) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]
