"""Writes how sure contact detection is of every contact: the probability that its two bodies touch."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.sequence.frame_forces import FrameForces

from ..look import entities
from ..look.clock import Clock
from ..look.colours import OPEN, PROBABILITY_RAMP, SERIES, packed, packed_one
from ..look.scene import Scene
from ..look.values import known, log_scalar

_RAMP = packed(PROBABILITY_RAMP)
_OPEN = packed_one(OPEN)
DOUBTFUL = 0.5  # below it a contact is more likely open than not


def log_touching_styles(stream: rr.RecordingStream) -> None:
    """Log names and colours of the curves."""
    for path, name, colour in (
        (entities.EXPECTED_COUNT, "expected: sum of P(touch)", SERIES[1]),
        (entities.DOUBTFUL_COUNT, "kept with P(touch) < 1/2", SERIES[3]),
    ):
        stream.log(path, rr.SeriesLines(colors=[colour], names=name, widths=2.0), static=True)


def log_touching(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    """Log P(touch) of one frame's contacts; grey where it was not computed."""
    clock.start()
    probability = forces.probability
    clock.stream.log(
        entities.PROBABILITY,
        rr.LineStrips2D(
            scene.branches(clock.frame, forces.contacts),
            radii=np.float32(0.1 * scene.canvas.grain_radius),
            colors=probability_colours(probability),
            draw_order=20.0,
        ),
        rr.AnyValues(
            probability=known(probability.astype(np.float32)),
            grain_a=scene.tracks.id[forces.contacts.i],
            body_b=scene.body_names(forces.contacts.j),
        ),
    )
    clock.end()
    computed = bool(np.isfinite(probability).any())
    log_scalar(clock, entities.EXPECTED_COUNT, float(np.nansum(probability)) if computed else np.nan)
    log_scalar(clock, entities.DOUBTFUL_COUNT, float(np.sum(probability < DOUBTFUL)) if computed else np.nan)


def probability_colours(probability: Array) -> NDArray[np.uint32]:
    """Colours from surely open to surely touching (c,); grey where unknown."""
    level = np.round(np.nan_to_num(np.clip(probability, 0.0, 1.0)) * (len(_RAMP) - 1)).astype(np.int64)
    return np.where(np.isfinite(probability), _RAMP[level], _OPEN).astype(np.uint32)
