"""Writes the stress cross and the rose of contact directions: polar plots about a unit circle."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ...solver.bodies.grains import Array
from ...solver.frame_forces import FrameForces
from ...solver.statistics.frame_statistics import FrameStatistics
from ..look import entities
from ..look.axes import log_cross_hairs, log_texts, polar
from ..look.clock import Clock
from ..look.colours import FAINT, INK, SERIES, packed
from ..look.values import strips

BINS = 36  # of contact directions, 10° each
STRESS_REACH = 1.75  # of the views, in units of the circle
ROSE_REACH = 2.7


def log_polar_axes(stream: rr.RecordingStream) -> None:
    """Log circles and axes."""
    log_cross_hairs(stream, entities.STRESS_AXES, STRESS_REACH)
    log_cross_hairs(stream, entities.ROSE_AXES, ROSE_REACH)
    log_texts(
        stream,
        entities.ROSE_AXES + entities.TICKS,
        [
            (_corner(ROSE_REACH, 0), "contacts between grains", SERIES[1]),
            (_corner(ROSE_REACH, 1), "their forces", SERIES[0]),
        ],
    )


def log_stress(clock: Clock, statistics: FrameStatistics) -> None:
    """Log the principal stresses and the normal stress in every direction, divided by the pressure."""
    clock.end()
    if not (np.all(np.isfinite(statistics.stress)) and statistics.pressure > 0.0):
        clock.log(entities.STRESS_CROSS, rr.LineStrips2D([]))
        clock.log(entities.STRESS_VALUES, rr.Points2D([], labels=[]))
        clock.log(entities.STRESS_CURVE, rr.LineStrips2D([]))
        return
    stress = 0.5 * (statistics.stress + statistics.stress.T)
    value, axis = np.linalg.eigh(stress)
    value, axis = value[::-1], axis[:, ::-1]  # greatest first
    ratio = value / statistics.pressure
    tips = np.stack([axis[0], -axis[1]], axis=1) * (100.0 * ratio)[:, None]
    clock.log(
        entities.STRESS_CROSS,
        strips(np.stack([-tips, tips], axis=1), [3.0, 2.0], packed(np.array(SERIES[:2], np.uint8)), 20.0),
    )
    angle = np.degrees(statistics.principal_direction)
    texts = [
        (_corner(STRESS_REACH, 0), f"σ₁ {1e-3 * value[0]:.1f} kPa at {f'{angle:.0f}'.replace('-', '−')}°", SERIES[0]),
        (_corner(STRESS_REACH, 1), f"σ₂ {1e-3 * value[1]:.1f} kPa", SERIES[1]),
    ]
    log_texts(clock, entities.STRESS_VALUES, texts, static=False)
    angle = np.linspace(0.0, 2.0 * np.pi, 97)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    radius = np.einsum("ka,ab,kb->k", normal, stress, normal) / statistics.pressure
    clock.log(entities.STRESS_CURVE, strips([polar(angle, radius)], 0.9, INK, 10.0))


def log_rose(clock: Clock, forces: FrameForces) -> None:
    """Log the angular densities of contacts between grains and of their forces, over the isotropic density.

    A contact counts with its probability of bearing force. Contacts with walls are left out, as they have the
    direction of the wall normal.
    """
    clock.end()
    loaded = np.isfinite(forces.fn) & (forces.fn > 0.0) & ~forces.contacts.with_wall
    normal, fn = forces.contacts.normal[loaded], forces.fn[loaded]
    bearing = np.ones(len(fn)) if forces.bearing_probability is None else forces.bearing_probability[loaded]
    for path, weight, colour, order in (
        (entities.ROSE, bearing, SERIES[1], 10.0),
        (entities.ROSE_OF_FORCES, bearing * fn, SERIES[0], 20.0),
    ):
        lines = [rose_outline(direction_densities(normal, weight))] if len(fn) else []
        clock.log(path, strips(lines, 1.3, colour if lines else FAINT, order))


def direction_densities(normal: Array, weight: Array) -> Array:
    """Return the angular density of normals and their opposites, over the isotropic density.

    Parameters
    ----------
    normal : array (c, 2)
        Contact normals.
    weight : array (c,)
        Weights of the contacts.

    Returns
    -------
    array (BINS,)
        Density per bin of direction; 1: isotropic.
    """
    angle = np.arctan2(normal[:, 1], normal[:, 0])
    both = np.mod(np.concatenate([angle, angle + np.pi]), 2.0 * np.pi)
    counts = np.bincount((both * BINS / (2.0 * np.pi)).astype(np.int64) % BINS, np.tile(weight, 2), BINS)
    return counts * BINS / counts.sum()


def rose_outline(densities: Array) -> np.ndarray:
    """Return a closed outline of sectors (2 BINS + 1, 2) in view coordinates."""
    edges = np.arange(BINS + 1) * 2.0 * np.pi / BINS
    angle = np.stack([edges[:-1], edges[1:]], axis=1).ravel()
    outline = polar(angle, np.minimum(np.repeat(densities, 2), ROSE_REACH))  # clipped at the edge of the view
    return np.concatenate([outline, outline[:1]])


def _corner(reach: float, line: int) -> Array:
    """Return the position of a line of text in the upper left corner of a polar view."""
    return 100.0 * reach * np.array([-0.62, -0.95 + 0.105 * line])
