"""Forces of a run under another assumption: contacts forbidden or forced, grains moved, another friction."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from .. import pipeline
from ..exchange.grain_quantities import rod_length
from ..inference.infer_sequence import infer_sequence
from ..inference.inputs import Inputs
from ..inference.solve_frames import InferenceObserver
from ..process.errors import InputError
from ..results.results import Results
from ..solver.contacts.pairs import find_rows
from ..solver.contacts.verdicts import Verdicts
from ..solver.statistics.contact_removal import remove_contact
from ..solver.statistics.stress import friction_angle, love_weber_stress, wall_forces
from ..verdicts.decisions import BodyNames
from .comparisons import Source, as_run
from .run import Run
from .shown_progress import shown_progress

Pairs = Iterable[tuple[int, int | str]]


def what_if(
    results: Source,
    frame: int | None = None,
    *,
    forbid: Pairs = (),
    force: Pairs = (),
    move: Mapping[int, tuple[float, float]] | None = None,
    friction: float | None = None,
    local: bool = False,
) -> Run:
    """Solve a run again under another assumption; nothing on the disk changes.

    Parameters
    ----------
    results : Run or path
        A run of `rodsight.run`, `rodsight.solve` or `rodsight.open`.
    frame : int, optional
        The frame in which contacts are forbidden or forced, or grains moved; default: every frame.
    forbid, force : iterable of pairs
        Contacts that do not exist, or do: ids (i, j), or an id and the name of a wall.
    move : mapping of int to (float, float), optional
        Displacement [m] to add to the measured position of grains, by id.
    friction : float, optional
        Coefficient of friction between rods, and at walls that have no coefficient of their own.
    local : bool
        Forbidden contacts only: the nearest forces around each of them that keep every grain balanced, in milliseconds,
        without using the motion again. Statistics stay those of the run, except stress, friction angle and wall forces.

    Returns
    -------
    Run
        In memory. `rodsight.compare(new, results)` gives both forces of every contact.

    Raises
    ------
    IndexError
        If there is no such frame.
    InputError
        A body is unknown, a forbidden contact does not exist (local), or the input of the run changed on the disk.

    Examples
    --------
    >>> run = rodsight.open("runs/shear")
    >>> strongest = run.contacts(frame=4).query("j >= 0").nlargest(1, "fn")[["i", "j"]].to_numpy().tolist()
    >>> without = rodsight.what_if(run, 4, forbid=strongest, local=True)
    >>> change = rodsight.compare(without, run).query("frame == 4").eval("fn - fn_reference")
    >>> bool(change.abs().max() > 1.0)
    True
    """
    run = as_run(results)
    stored = run.results
    frames = range(stored.tracks.frame_count) if frame is None else (run.checked_frame(frame),)
    forbidden, forced = _keys(stored, forbid, "forbid"), _keys(stored, force, "force")
    if local:
        if len(forced) or move or friction is not None:
            raise InputError("what_if", "local", "applies to forbid only: solve the whole sequence again instead")
        return Run(_without(stored, frames, forbidden))
    inputs = run.inputs if run.inputs is not None else _stored_inputs(run)
    inputs = _with_verdicts(inputs, frames, forbidden, forced)
    inputs = _moved(inputs, frames, move or {})
    if friction is not None:
        inputs = _with_friction(inputs, friction)
    solved = infer_sequence(inputs, InferenceObserver(shown_progress()))
    return Run.in_memory(solved, f"{run.name} (what if)", stored.configuration, inputs)


def _stored_inputs(run: Run) -> Inputs:
    assert run.file is not None
    return pipeline.stored_inputs(run.file)[0]


def _keys(results: Results, pairs: Pairs, name: str) -> np.ndarray:
    """Return the keys of the pairs, ascending. Raises InputError for unknown bodies."""
    bodies = BodyNames.of(results.tracks, results.walls)
    rows = bodies.rows()
    found = set()
    for i, j in pairs:
        for body in (i, j):
            if body not in rows:
                raise InputError("what_if", f"{name} = {(i, j)}", f"{body!r} is neither a grain's id nor a wall's name")
        if rows[i] == rows[j]:
            raise InputError("what_if", f"{name} = {(i, j)}", "is one body")
        found.add(bodies.key(*sorted((rows[i], rows[j]))))
    return np.array(sorted(found), np.int64)


def _with_verdicts(inputs: Inputs, frames: Iterable[int], forbidden: np.ndarray, forced: np.ndarray) -> Inputs:
    if not (len(forbidden) or len(forced)):
        return inputs
    verdicts = dict(inputs.verdicts)
    for k in frames:
        given = verdicts.get(k, Verdicts())
        verdicts[k] = replace(
            given,
            forced=np.union1d(np.setdiff1d(given.forced, forbidden), forced),
            forbidden=np.union1d(np.setdiff1d(given.forbidden, forced), forbidden),
        )
    return replace(inputs, verdicts=verdicts)


def _moved(inputs: Inputs, frames: Iterable[int], move: Mapping[int, tuple[float, float]]) -> Inputs:
    if not move:
        return inputs
    position = inputs.tracks.position.copy()
    for name, step in move.items():
        row = np.flatnonzero(inputs.tracks.id == name)
        if not len(row):
            raise InputError("what_if", f"move = {name}", "is not the id of a grain")
        position[list(frames), row[0]] += np.asarray(step, np.float64)
    return replace(inputs, tracks=replace(inputs.tracks, position=position))


def _with_friction(inputs: Inputs, friction: float) -> Inputs:
    if not (np.isfinite(friction) and friction >= 0.0):
        raise InputError("what_if", f"friction = {friction!r}", "is not a coefficient of friction")
    return replace(inputs, material=replace(inputs.material, friction=float(friction), friction_measured=False))


def _without(results: Results, frames: Sequence[int], forbidden: np.ndarray) -> Results:
    """Return results without these contacts: the nearest balanced forces around each of them."""
    solved, statistics = list(results.frames), list(results.statistics)
    for k in frames:
        forces = solved[k]
        rows, known = find_rows(forbidden, forces.contacts.key)
        if not known.all() and len(frames) == 1:
            raise InputError("what_if", f"frame {k}", "has no such contact to forbid")
        fn, ft = forces.fn, forces.ft
        for row in rows[known].tolist():
            removal = remove_contact(results.grains, forces.contacts, fn, ft, row, friction=results.contact_friction(k))
            fn, ft = removal.fn, removal.ft
        solved[k] = replace(forces, fn=fn, ft=ft)
        before, position = statistics[k], results.tracks.position[k]
        stress = love_weber_stress(forces.contacts, fn, ft, position, before.area, rod_length(results))
        on_walls = wall_forces(forces.contacts, fn, ft)
        statistics[k] = replace(
            before, stress=stress, pressure=0.5 * float(np.trace(stress)), friction_angle=friction_angle(stress),
            wall_force=on_walls,
        )  # fmt: skip
    return replace(results, frames=solved, statistics=statistics)
