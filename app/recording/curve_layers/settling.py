"""Writes the reliability of a frame: status lanes, trust, settling, start residuals, counts of contacts and flags."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ...solver.bodies.grains import Array
from ...solver.frame_forces import ERROR_PARTS, FrameForces, FrameStatus
from ...tracks import Tracks, TrackStatus
from ..look import entities
from ..look.clock import Clock
from ..look.colours import BOUNDARY, INFERRED, INK, LOST, NEW_CONTACT, SERIES, Rgba
from ..look.printable_text import printable
from ..look.scene import Scene
from ..look.values import log_curve_style, log_scalar, log_scalars
from .convergence import power_of_ten

# Distinguishable in every kind of colour vision; in grey settled frames are dark, frames that need attention bright.
STATUS_COLOURS: dict[FrameStatus, Rgba] = {
    FrameStatus.RESET: (188, 180, 244, 255),
    FrameStatus.SUSPECT: (229, 109, 122, 255),
    FrameStatus.REARRANGING: (249, 221, 115, 255),
    FrameStatus.SETTLING: (50, 136, 231, 255),
    FrameStatus.SETTLED: (15, 106, 49, 255),
    FrameStatus.FAILED: (82, 16, 44, 255),
}
# One sign each, as a lane is often narrower than a word; the titles of the lanes explain them.
STATUS_MARKS: dict[FrameStatus, str] = {
    FrameStatus.RESET: "0", FrameStatus.SUSPECT: "?", FrameStatus.REARRANGING: "≠", FrameStatus.SETTLING: "≈",
    FrameStatus.SETTLED: "=", FrameStatus.FAILED: "×",
}  # fmt: skip
AMBIGUOUS = 0.5  # P(touch) below which a contact is more probably open than closed
LOW_TRUST = 0.9  # T below which its reasons are flagged
# States of the tracking lane; of those that apply to a frame the first is shown.
SOME_LOST, SOME_CUT, SOME_INFERRED = "grains lost", "grains beyond the border", "visible ones tracked, some inferred"
ALL_TRACKED = "all tracked"
TRACKING_COLOURS: dict[str, Rgba] = {
    ALL_TRACKED: (58, 84, 108, 255),
    SOME_INFERRED: INFERRED,
    SOME_CUT: (249, 221, 115, 255),
    SOME_LOST: (229, 109, 122, 255),
}
TRACKING_MARKS = {ALL_TRACKED: "=", SOME_INFERRED: "+", SOME_CUT: "/", SOME_LOST: "−"}

_LEVELS = {
    FrameStatus.FAILED: "ERROR",
    FrameStatus.SUSPECT: "WARN",
    FrameStatus.REARRANGING: "INFO",
    FrameStatus.RESET: "INFO",
}


def log_settling_styles(stream: rr.RecordingStream) -> None:
    """Log lanes, names and colours."""
    stream.log(
        entities.STATUS_LANE,
        rr.StateConfiguration(
            values=[status.name.lower() for status in FrameStatus],
            labels=[STATUS_MARKS[status] for status in FrameStatus],
            colors=list(STATUS_COLOURS.values()),
        ),
        static=True,
    )
    stream.log(
        entities.TRACKING_LANE,
        rr.StateConfiguration(
            values=list(TRACKING_COLOURS),
            labels=list(TRACKING_MARKS.values()),
            colors=list(TRACKING_COLOURS.values()),
        ),
        static=True,
    )
    for path, name, colour in (
        (entities.TRUST, "trust T (these inputs)", SERIES[2]),
        (entities.SIMILARITY, "similarity with the frame before", SERIES[1]),
        (entities.CORRECTION, "correction ε", SERIES[0]),
        (entities.OLD_UNBALANCE, "residual of the previous forces ū", SERIES[3]),
        (entities.START_DIFFERENCE, "difference H of two starts", SERIES[1]),
        (entities.FRAMES_SINCE_RESET, "frames since reset", SERIES[1]),
        (entities.SAVED_SWEEPS, "sweeps saved", SERIES[1]),
        (entities.SWEEP_COUNT, "sweeps", SERIES[1]),
        (entities.FINAL_NATURAL_MAP, "natural map reached", SERIES[2]),
        (entities.FINAL_UNBALANCE, "worst force residual of the reported field", SERIES[3]),
        (entities.NEW_CONTACT_COUNT, "new", NEW_CONTACT),
        (entities.LOST_CONTACT_COUNT, "lost", LOST),
        (entities.COLD_RESIDUAL, "cold: one sweep from zero forces", SERIES[1]),
        (entities.WARM_RESIDUAL, "warm: one sweep from the previous forces", SERIES[0]),
        (entities.EXPECTED_COUNT, "expected: sum of P(touch)", SERIES[1]),
        (entities.AMBIGUOUS_COUNT, "kept with P(touch) < 1/2", SERIES[3]),
    ):
        log_curve_style(stream, path, name, colour)


def log_settling(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    """Log lanes, curves and flags of one frame."""
    cold, probability = forces.cold_residual, forces.probability
    computed = bool(np.isfinite(probability).any())
    clock.start()
    clock.log(entities.STATUS_LANE, rr.StateChange(state=forces.status.name.lower()))
    clock.log(entities.TRACKING_LANE, rr.StateChange(state=tracking_state(scene.tracks, clock.frame)))
    _log_flags(clock, scene, forces)
    clock.end()
    for path, value in (
        (entities.TRUST, forces.trust),
        (entities.SIMILARITY, forces.similarity),
        (entities.CORRECTION, forces.correction),
        (entities.OLD_UNBALANCE, forces.old_unbalance),
        (entities.START_DIFFERENCE, forces.start_difference),
        (entities.FRAMES_SINCE_RESET, forces.frames_since_reset),
        (entities.SWEEP_COUNT, forces.sweeps),
        (entities.FINAL_NATURAL_MAP, power_of_ten(np.array(forces.natural_map))),
        (entities.FINAL_UNBALANCE, power_of_ten(np.array(forces.unbalance))),
        (entities.NEW_CONTACT_COUNT, forces.new_contact_count),
        (entities.LOST_CONTACT_COUNT, forces.lost_contact_count),
        (entities.COLD_RESIDUAL, power_of_ten(np.array(np.nan if cold is None else cold[0]))),
        (entities.WARM_RESIDUAL, power_of_ten(np.array(forces.warm_residual))),
        (entities.SAVED_SWEEPS, forces.sweeps_saved),
        (entities.EXPECTED_COUNT, np.nansum(probability) if computed else np.nan),
        (entities.AMBIGUOUS_COUNT, np.sum(probability < AMBIGUOUS) if computed else np.nan),
    ):
        log_scalar(clock, path, float(value))
    if forces.error_budget is not None:
        _log_error_budget(clock, forces.error_budget)


def _log_error_budget(clock: Clock, fraction: Array) -> None:
    """Log the fractions (p,) of the causes and the styles of their curves, which other recordings lack."""
    log_scalars(clock, entities.ERROR_BUDGET, fraction)
    colours = [(*SERIES, BOUNDARY, INK)[part] for part in range(len(ERROR_PARTS))]
    style = rr.SeriesLines(colors=colours, names=list(ERROR_PARTS), widths=[2.0] * len(ERROR_PARTS))
    clock.log(entities.ERROR_BUDGET, style, static=True)


def tracking_state(tracks: Tracks, frame: int) -> str:
    """Return the state of a frame in the tracking lane."""
    tracks = tracks.frame(frame)
    if tracks.lost.any():
        return SOME_LOST
    if tracks.out_of_frame.any():
        return SOME_CUT
    return SOME_INFERRED if (tracks.status == TrackStatus.INFERRED).any() else ALL_TRACKED


def _log_flags(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    both = scene.tracks.frames(max(clock.frame - 1, 0), clock.frame + 1)
    now, cut = both.present[-1], both.out_of_frame[-1]
    before = both.present[0] if clock.frame else np.ones(len(now), bool)
    if forces.status in _LEVELS:
        _log_flag(clock, f"{forces.status.name.lower()}: {forces.reason}", _LEVELS[forces.status])
    if forces.trust_penalties and forces.trust < LOW_TRUST:
        _log_flag(clock, f"T = {forces.trust:.2f}: {forces.trust_penalties}", "INFO")
    if (before & ~now & ~cut).any():
        ids = _listed(scene, before & ~now & ~cut)
        _log_flag(clock, f"grain {ids} is lost and left out from this frame on", "WARN")
    if (before & cut).any():
        ids = _listed(scene, before & cut)
        _log_flag(clock, f"grain {ids} is cut by the border of the picture and left out from this frame on", "INFO")
    if clock.frame and (now & ~before).any():
        _log_flag(clock, f"grain {_listed(scene, now & ~before)} found again", "INFO")


def _log_flag(clock: Clock, text: str, level: str) -> None:
    clock.log(entities.FLAGS, rr.TextLog(printable(text), level=level))


def _listed(scene: Scene, rows: np.ndarray) -> str:
    """Return the ids of grains, at most eight."""
    ids = scene.tracks.id[rows].tolist()
    shown = ", ".join(str(i) for i in ids[:8])
    return f"{shown} and {len(ids) - 8} more" if len(ids) > 8 else shown
