"""Forces of a run under another assumption: contacts forbidden or forced, grains moved, another friction."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from .. import pipeline
from ..exchange.grain_quantities import rod_length
from ..experiment.plausibility import PackingSources, check_inside
from ..inference.infer_sequence import infer_sequence
from ..inference.inputs import Inputs
from ..inference.solve_frames import InferenceObserver
from ..process.errors import InputError
from ..results.hdf5.lazy_sequences import LazySequence
from ..results.results import Results
from ..solver.bodies.wall_shapes import IN, OUT, STRAIGHT
from ..solver.contacts.contacts import Contacts, measure_contacts
from ..solver.contacts.pairs import find_rows, split_key, split_keys
from ..solver.contacts.verdicts import Verdicts
from ..solver.frame_forces import FrameForces, FrameStatus
from ..solver.redistribution.contact_removal import remove_contact
from ..solver.redistribution.local_change import limit_friction, rebalance
from ..solver.statistics.frame_statistics import FrameStatistics
from ..solver.statistics.stress import friction_angle, love_weber_stress, wall_forces
from ..tracks import Tracks
from ..verdicts.decisions import BodyNames
from .arguments import as_mapping, is_number
from .comparisons import Source, as_run
from .run import Run
from .shown_progress import shown_progress

Pairs = Iterable[tuple[int, int | str]]
PAIR_EXAMPLE = "such as (3, 7) or (3, 'top')"
T = TypeVar("T")


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
        The nearest forces around what changes that keep every grain balanced, in milliseconds, without using the motion
        again. Forces that are within the cones of another friction stay as they are. Not for forced contacts, which
        bear nothing in the nearest forces. Statistics stay those of the run, except stress, friction angle and wall
        forces.

    Returns
    -------
    Run
        In memory. `rodsight.compare(new, results)` gives both forces of every contact.

    Raises
    ------
    InputError
        There is no such frame (an IndexError as well), a body is unknown, forced bodies are farther apart than a
        radius, a grain is moved beyond a wall, a forbidden contact does not exist or contacts are forced (local), or
        the input of the run changed on the disk.

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
    if friction is not None and not (is_number(friction) and friction >= 0.0):
        raise InputError("what_if", f"friction = {friction!r}", "is not a coefficient of friction")
    frames = range(stored.tracks.frame_count) if frame is None else (run.checked_frame(frame),)
    forbidden, forced = _keys(stored, forbid, "forbid"), _keys(stored, force, "force")
    if local:
        if len(forced):
            raise InputError(
                "what_if", "local", "does not apply to force: a forced contact bears nothing in the nearest forces; "
                "solve the sequence again, without local",
            )  # fmt: skip
        return Run(_changed_locally(stored, frames, forbidden, _steps(stored.tracks, move or {}), friction))
    _check_pairs(stored, frames, forbidden, forced)
    inputs = run.inputs if run.inputs is not None else _stored_inputs(run)
    inputs = _with_verdicts(inputs, frames, forbidden, forced)
    inputs = _moved(inputs, frames, move or {})
    if friction is not None:
        inputs = _with_friction(inputs, friction)
    known = stored.diagnosis if friction is None else None  # another friction may be the cure of what was found
    solved = infer_sequence(inputs, InferenceObserver(shown_progress()), diagnosis=known)
    return Run.in_memory(solved, f"{run.name} (what if)", stored.configuration, inputs)


def _stored_inputs(run: Run) -> Inputs:
    assert run.file is not None
    return pipeline.stored_inputs(run.file)[0]


def _keys(results: Results, pairs: Pairs, name: str) -> np.ndarray:
    """Return the keys of the pairs, ascending. Raises InputError for unknown bodies."""
    bodies = BodyNames.of(results.tracks, results.walls)
    rows = bodies.rows()
    found = set()
    for i, j in _as_pairs(pairs, name):
        for body in (i, j):
            if not isinstance(body, Hashable) or body not in rows:
                raise InputError("what_if", f"{name} = {(i, j)}", f"{body!r} is neither a grain's id nor a wall's name")
        if rows[i] == rows[j]:
            raise InputError("what_if", f"{name} = {(i, j)}", "is one body")
        found.add(bodies.key(*sorted((rows[i], rows[j]))))
    return np.array(sorted(found), np.int64)


def _check_pairs(results: Results, frames: Sequence[int], forbidden: np.ndarray, forced: np.ndarray) -> None:
    """Raise InputError where a pair is both forbidden and forced, or where forced bodies are farther than a radius."""
    bodies = BodyNames.of(results.tracks, results.walls)
    both = np.intersect1d(forbidden, forced)
    if len(both):
        raise InputError("what_if", f"force = {_names(bodies, int(both[0]))}", "is forbidden as well")
    i, j = split_keys(forced, bodies.count)
    for k in frames if len(forced) else ():
        gap = measure_contacts(results.grains, results.tracks.position[k], results.walls.at_rest(k), i, j).gap
        far = np.flatnonzero(gap > results.tracks.radius[i])
        if len(far):
            apart = 1e3 * float(gap[far[0]])
            raise InputError(
                "what_if", f"force = {_names(bodies, int(forced[far[0]]))}", f"are {apart:.3g} mm apart in frame {k}"
            )


def _names(bodies: BodyNames, key: int) -> tuple[Any, Any]:
    i, j = split_key(key, bodies.count)
    return bodies.name(i), bodies.name(j)


def _as_pairs(pairs: Pairs, name: str) -> Iterator[tuple[Any, Any]]:
    """Yield both bodies of every pair. Raises InputError for what is no pair."""
    if not isinstance(pairs, Iterable) or isinstance(pairs, str):
        raise InputError("what_if", f"{name} = {pairs!r}", f"is no list of pairs, {PAIR_EXAMPLE}")
    for pair in pairs:
        bodies = tuple(pair) if isinstance(pair, Iterable) and not isinstance(pair, str) else ()
        if len(bodies) != 2:
            raise InputError("what_if", f"{name} = {pairs!r}", f"{pair!r} is no pair of bodies, {PAIR_EXAMPLE}")
        yield bodies[0], bodies[1]


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
    tracks, at = inputs.tracks, list(frames)
    position, placed = tracks.position.copy(), np.zeros(tracks.present.shape, np.bool_)
    for row, step in _steps(tracks, move).items():
        position[at, row] += step
        placed[at, row] = True
    if inputs.placed is not None:
        placed |= inputs.placed
    moved = replace(inputs, tracks=replace(tracks, position=position), placed=placed)
    _check_walls(moved)
    return moved


def _check_walls(inputs: Inputs) -> None:
    """Raise InputError where a grain was moved beyond a wall."""
    named: dict[int, str] = dict.fromkeys((STRAIGHT, IN, OUT), "what_if: move")
    check_inside(PackingSources(("what_if: move", ""), None, named), inputs.tracks, inputs.walls)


def _steps(tracks: Tracks, move: Mapping[int, tuple[float, float]]) -> dict[int, np.ndarray]:
    """The displacements by row. Raises InputError for unknown grains."""
    steps, example = {}, "ids to displacements [m], such as {3: (1e-5, 0.0)}"
    for name, step in as_mapping("what_if: move", move, example).items():
        row = np.flatnonzero(tracks.id == name)
        if not len(row):
            raise InputError("what_if", f"move = {name}", "is not the id of a grain")
        if not isinstance(step, Sequence | np.ndarray) or len(step) != 2 or not all(map(is_number, step)):
            raise InputError("what_if", f"move = {{{name}: {step!r}}}", f"is no mapping of {example}")
        steps[int(row[0])] = np.asarray(step, np.float64)
    return steps


def _with_friction(inputs: Inputs, friction: float) -> Inputs:
    return replace(inputs, material=replace(inputs.material, friction=float(friction), friction_measured=False))


def _changed_locally(
    results: Results, frames: Sequence[int], forbidden: np.ndarray, steps: Mapping[int, np.ndarray],
    friction: float | None,
) -> Results:  # fmt: skip
    """Return results with the nearest balanced forces around what changes."""
    solved: dict[int, FrameForces] = {}
    statistics: dict[int, FrameStatistics] = {}
    for k in frames:
        forces = results.frames[k]
        if forces.status is FrameStatus.FAILED:
            continue
        limit = _coefficients(results, k, friction)
        contacts, fn, ft = forces.contacts, forces.fn, forces.ft
        if steps:
            contacts, fn, ft = _with_steps(results, k, steps, limit)
        if friction is not None:
            fn, ft = limit_friction(results.grains, contacts, fn, ft, friction=limit)
        rows, known = find_rows(forbidden, contacts.key)
        if not known.all() and len(frames) == 1:
            raise InputError("what_if", f"frame {k}", "has no such contact to forbid")
        for row in rows[known].tolist():
            removal = remove_contact(results.grains, contacts, fn, ft, row, friction=limit)
            fn, ft = removal.fn, removal.ft
        solved[k] = replace(forces, contacts=contacts, fn=fn, ft=ft)
        before, position = results.statistics[k], results.tracks.position[k]
        stress = love_weber_stress(contacts, fn, ft, position, before.area, rod_length(results))
        statistics[k] = replace(
            before, stress=stress, pressure=0.5 * float(np.trace(stress)), friction_angle=friction_angle(stress),
            wall_force=wall_forces(contacts, fn, ft),
        )  # fmt: skip
    return replace(
        results, frames=_with_items(results.frames, solved), statistics=_with_items(results.statistics, statistics)
    )


def _with_items(before: Sequence[T], changed: Mapping[int, T]) -> Sequence[T]:
    """Return a sequence with some items changed; the others are read on access, not before."""
    return LazySequence(len(before), lambda k: changed[k] if k in changed else before[k])


def _coefficients(results: Results, frame: int, friction: float | None) -> np.ndarray:
    """The coefficient (c,) of every contact of a frame; friction: of rods, and of walls without one of their own."""
    used = np.array(results.contact_friction(frame), np.float64)
    if friction is not None:
        used[used == results.friction] = friction
    return used


def _with_steps(
    results: Results, frame: int, steps: Mapping[int, np.ndarray], limit: np.ndarray
) -> tuple[Contacts, np.ndarray, np.ndarray]:
    """The contacts of a frame with grains elsewhere, and the nearest forces that balance there."""
    forces, position = results.frames[frame], results.tracks.position[frame].copy()
    for row, step in steps.items():
        position[row] += step
    contacts = forces.contacts
    moved = measure_contacts(results.grains, position, results.walls.at_rest(frame), contacts.i, contacts.j)
    rows = np.flatnonzero(np.isin(contacts.i, list(steps)) | np.isin(contacts.j, list(steps)))
    if not len(rows):
        return contacts, forces.fn, forces.ft
    force = np.stack([forces.fn, forces.ft])
    fn, ft = rebalance(results.grains, contacts, force, rows, friction=limit, moved=moved)
    return moved, fn, ft
