"""Writes the contact forces: the network once per frame, its widths and colours at the recorded sweeps."""

from __future__ import annotations

from enum import StrEnum
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from ....solver.bodies.grains import Array
from ....solver.contacts.contacts import Contacts, ContactState
from ....solver.frame_forces import FrameForces
from ....solver.nlgs.sweep_record import SweepHistory
from ....solver.statistics.force_statistics import mobilisation
from ...look import entities
from ...look.clock import Clock
from ...look.colours import SLIDING
from ...look.force_style import ForceStyle
from ...look.scene import Scene
from ...look.values import dots, nullable
from .contact_colours import contact_colours

CHUNK_BYTES = 1_000_000  # size of one columnar message, the unit in which viewers load and drop data
FIRST_SWEEPS = 8  # always kept


class SweepChoice(StrEnum):
    """The sweeps that are written to the recording."""

    LOG = "log"  # logarithmically spaced sweeps
    ALL = "all"  # every sweep in which a width or a colour changes
    NONE = "none"  # the reported field only


def log_network(
    clock: Clock, scene: Scene, forces: FrameForces, previous: FrameForces | None, choice: SweepChoice, kept: int
) -> int:
    """Log the contact forces of one frame, from its first sweep to the reported field.

    Parameters
    ----------
    clock : Clock
        The frame on the timelines.
    scene : Scene
        The run.
    forces : FrameForces
        The frame.
    previous : FrameForces, optional
        The frame before; None for the first.
    choice : SweepChoice
        The sweeps that are recorded.
    kept : int
        Greatest number of sweeps, with SweepChoice.LOG.

    Returns
    -------
    int
        Number of rows written.
    """
    rows, fn, _ = visible_sweeps(forces, clock.last - clock.first, choice, kept)
    style, contacts = scene.style, forces.contacts
    clock.start()
    clock.log(
        entities.FORCES,
        style.strips(scene.branches(clock.frame, contacts), fn[0]),
        contact_values(scene, forces),
        *contact_colours(scene, forces, previous),
    )
    if scene.walls.cell is not None:
        _log_far_halves(clock, scene, forces)
    sent = send_sweeps(clock, style, rows[1:], fn[1:], thin=choice is SweepChoice.ALL) if contacts.count else 0
    _log_sliding(clock, scene, forces)
    return 1 + sent


def _log_far_halves(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    """Log the second halves of contacts across the edge of the cell, as reported; the first are with the others."""
    rows, lines = scene.far_halves(clock.frame, forces.contacts)
    fn = np.nan_to_num(forces.fn[rows])
    clock.log(entities.FORCES_ACROSS, scene.style.strips(scene.canvas.points(lines), fn))


def visible_sweeps(
    forces: FrameForces, last: int, choice: SweepChoice, kept: int
) -> tuple[NDArray[np.int64], NDArray[np.floating], NDArray[np.floating]]:
    """Select the rows of a frame that are recorded.

    Parameters
    ----------
    forces : FrameForces
        The frame.
    last : int
        The row of the reported field, after the last sweep of the chain.
    choice : SweepChoice
        The sweeps that are recorded.
    kept : int
        Greatest number of sweeps, with SweepChoice.LOG.

    Returns
    -------
    rows : array (r,)
        Ascending from 0 to `last`.
    fn, ft : array (r, c)
        Forces of these rows [N]; zero in row 0 if the forces of the first sweep were not kept.
    """
    reported = np.nan_to_num(np.stack([forces.fn, forces.ft]))[:, None]
    if last == 0 or choice is SweepChoice.NONE:
        return np.zeros(1, np.int64), reported[0], reported[1]
    history = forces.history
    chosen = chosen_sweeps(history, choice, kept)
    rows, force = history.recorded[chosen], [history.fn[chosen], history.ft[chosen]]
    if len(rows) == 0 or rows[0] != 0:
        zero = np.zeros((1, reported.shape[2]))
        rows, force = np.concatenate([[0], rows]), [np.concatenate([zero, each]) for each in force]
    fn, ft = (np.concatenate([each, end]) for each, end in zip(force, reported, strict=True))
    return np.concatenate([rows, [last]]), fn, ft


def chosen_sweeps(history: SweepHistory, choice: SweepChoice, kept: int) -> NDArray[np.int64]:
    """Return the rows of history.recorded that are written, ascending."""
    if choice is SweepChoice.ALL or len(history.recorded) <= kept:
        return np.arange(len(history.recorded))
    available = history.spaced_rows  # whose forces are stored with all digits
    if len(available) <= kept:
        return available
    number = history.recorded[available]
    early = available[number < FIRST_SWEEPS][:kept]
    spaced = np.geomspace(FIRST_SWEEPS, max(history.count - 1, FIRST_SWEEPS), max(kept - len(early), 1))
    nearest = np.clip(np.searchsorted(number, spaced), 0, len(available) - 1)
    return np.union1d(early, available[nearest])


def contact_values(scene: Scene, forces: FrameForces) -> rr.AnyValues:
    """Return the values that a click on a contact shows."""
    mobilised = mobilisation(forces.fn, forces.ft, contact_friction(scene, forces))
    return rr.AnyValues(
        **body_values(scene, forces.contacts),
        fn=nullable(forces.fn),
        ft=nullable(forces.ft),
        gap_um=nullable((1e6 * forces.contacts.gap).astype(np.float32)),
        fn_sd=nullable(forces.fn_sd.astype(np.float32)),
        mobilisation=nullable(np.where(forces.fn > 0.0, mobilised, np.nan).astype(np.float32)),
        state=pa.array([ContactState(s).name.lower() for s in forces.state.tolist()], pa.string()),
        age=pa.array(forces.age.astype(np.int32)),
        probability=nullable(forces.probability.astype(np.float32)),
        sliding_probability=_where_known(forces.sliding_probability, forces),
        bearing_probability=_where_known(forces.bearing_probability, forces),
    )


def contact_friction(scene: Scene, forces: FrameForces) -> Array:
    """Return the coefficient of friction of every contact (c,); in files of earlier versions that between grains."""
    return np.full(forces.contacts.count, scene.friction) if forces.friction is None else forces.friction


def _where_known(probability: Array | None, forces: FrameForces) -> pa.Array:
    """Return values of contacts (c,), absent in files of earlier versions."""
    values = np.full(forces.contacts.count, np.nan) if probability is None else probability
    return nullable(values.astype(np.float32))


def body_values(scene: Scene, contacts: Contacts) -> dict[str, Any]:
    """Return the bodies of contacts: rows i and j, the id of grain i and the name of body j.

    The types are explicit, as empty lists would have none if the first frame has no contacts.
    """
    return {
        "i": pa.array(contacts.i),
        "j": pa.array(contacts.j),
        "grain_a": pa.array(scene.tracks.id[contacts.i]),
        "body_b": pa.array(scene.body_names(contacts.j), pa.string()),
    }


def send_sweeps(
    clock: Clock, style: ForceStyle, rows: NDArray[np.int64], fn: NDArray[np.floating], *, thin: bool
) -> int:
    """Send widths and colours of sweeps.

    Parameters
    ----------
    clock : Clock
        The frame on the timelines.
    style : ForceStyle
        Widths and colours.
    rows : array (r,)
        Rows of the frame.
    fn : array (r, c)
        Forces in these rows [N].
    thin : bool
        Leave out rows that look like the row before.

    Returns
    -------
    int
        Number of rows sent.
    """
    count = fn.shape[1]
    step = max(CHUNK_BYTES // (8 * count), 1)
    previous: tuple[NDArray, NDArray] | None = None
    sent = 0
    for start in range(0, len(rows), step):
        part = slice(start, start + step)
        radii, colours = style.radii(fn[part]), style.colours(fn[part])
        keep = np.ones(len(radii), bool)
        if thin:
            keep[1:] = (np.diff(radii, axis=0) != 0).any(axis=1) | (colours[1:] != colours[:-1]).any(axis=1)
            if previous is not None:
                keep[0] = bool((radii[0] != previous[0]).any() or (colours[0] != previous[1]).any())
            if start + step >= len(rows):
                keep[-1] = True  # the reported field is always sent
            previous = radii[-1], colours[-1]
        kept = rows[part][keep]
        if len(kept):
            lengths = np.full(len(kept), count)
            columns = rr.LineStrips2D.columns(radii=radii[keep].ravel(), colors=colours[keep].ravel())
            clock.send(entities.FORCES, clock.columns(kept), columns.partition(lengths))
            sent += len(kept)
    return sent


def _log_sliding(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    sliding = (forces.state == ContactState.SLIDING) & (forces.fn > 0.0)
    point = scene.canvas.points(scene.contact_points(clock.frame, forces.contacts)[sliding]).astype(np.float32)
    if clock.last > clock.first:
        clock.start()
        _log_sliding_points(clock, scene, point[:0], forces.fn[:0])
    clock.end()
    _log_sliding_points(clock, scene, point, forces.fn[sliding])


def _log_sliding_points(clock: Clock, scene: Scene, point: NDArray[np.float32], fn: Array) -> None:
    """Log marks whose size increases slightly with the force: weak sliding contacts must not dominate the view."""
    fraction = np.clip(fn / scene.style.range.top, 0.0, 1.0)
    radii = scene.canvas.grain_radius * (0.07 + 0.12 * np.sqrt(fraction))
    clock.log(entities.SLIDING, dots(point, radii, SLIDING, 30.0))
