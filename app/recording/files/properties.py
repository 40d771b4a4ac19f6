"""Sends the properties of a recording, each a column in a catalogue of recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
import rerun as rr

from ...process.counts import known_or_none, mean_of_known
from ...solver.frame_forces import FrameStatus
from ..look.printable_text import printable
from ..look.scene import Scene
from ..tabs.summary_tab import FrameSummary

EXPERIMENT, OUTCOME, SETTINGS = "experiment", "outcome", "settings"


def send_experiment(stream: rr.RecordingStream, scene: Scene) -> None:
    """Send the input of the run."""
    pressure = scene.walls.usual_pressure(scene.rod_length)[scene.walls.loaded]
    stream.send_property(
        EXPERIMENT,
        rr.AnyValues(
            name=printable(scene.name),
            frames=scene.tracks.frame_count,
            grains=scene.grains.count,
            walls=scene.walls.count,
            friction=scene.friction,
            pressure_kpa=1e-3 * float(pressure.mean()) if len(pressure) else None,
            rod_length_mm=1e3 * scene.rod_length,
            mean_diameter_mm=2e3 * float(np.mean(scene.tracks.radius)),
        ),
    )
    # A property of its own: a catalogue groups columns by property, and this column is wide.
    if scene.configuration:
        stream.send_property(SETTINGS, rr.AnyValues(configuration=printable(scene.configuration)))


def send_outcome(stream: rr.RecordingStream, facts: Sequence[FrameSummary]) -> None:
    """Send the results of the run; unknown values are absent."""
    if not facts:
        return
    count = Counter(fact.status for fact in facts)
    settled = [fact.frame for fact in facts if fact.status is FrameStatus.SETTLED]
    agreements = [fact.agreement for fact in facts if fact.agreement is not None]
    values = {
        "settled_share": count[FrameStatus.SETTLED] / len(facts),
        "settled_from": settled[0] if settled else None,
        "suspect_frames": count[FrameStatus.SUSPECT] + count[FrameStatus.FAILED],
        "rearranging_frames": count[FrameStatus.REARRANGING],
        "trust_least": _least([fact.trust for fact in facts]),
        "trust_median": _median([fact.trust for fact in facts]),
        "contacts_mean": _mean([float(fact.contacts) for fact in facts]),
        "friction_angle_mean_deg": _mean([float(np.degrees(fact.friction_angle)) for fact in facts]),
        "unbalance_worst": _least([-fact.unbalance for fact in facts], sign=-1.0),
        "lost_grains_most": max(fact.lost for fact in facts),
        "r_fn_mean": _mean([each.r_fn for each in agreements]),
        "r_fn_least": _least([each.r_fn for each in agreements]),
        "r_ft_mean": _mean([each.r_ft for each in agreements]),
    }
    stream.send_property(OUTCOME, rr.AnyValues(**{name: value for name, value in values.items() if value is not None}))


def _known(values: Sequence[float]) -> list[float]:
    return [value for value in values if np.isfinite(value)]


def _least(values: Sequence[float], *, sign: float = 1.0) -> float | None:
    known = _known(values)
    return sign * min(known) if known else None


def _median(values: Sequence[float]) -> float | None:
    known = _known(values)
    return float(np.median(known)) if known else None


def _mean(values: Sequence[float]) -> float | None:
    return known_or_none(mean_of_known(values))
