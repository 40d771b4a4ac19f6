"""The recipe of the authors' own program beside the paper's and that of this program, on one experiment with a truth.

The method's authors published an early version of their program. Its recipe differs from the paper's in friction, radii
and stopping; `solve_as_authors` follows it by its description, on the sweeps of this program.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from rich.console import Console
from rich.table import Table

from ..inference.infer_sequence import infer_sequence
from ..inference.inference_settings import InferenceSettings
from ..inference.inputs import Inputs
from ..inference.snapshots import make_snapshots
from ..inference.solve_frames import InferenceObserver
from ..process.progress import Progress, no_progress
from ..results.results import Results, TruthContacts
from ..solver.bodies.grains import Array, GrainMotion, Grains
from ..solver.bodies.motion import LastSeen, Snapshot, motion_from, motion_to
from ..solver.bodies.packing import Packing
from ..solver.bodies.walls import Walls
from ..solver.contacts.contacts import Contacts, detect_contacts, measure_pairs
from ..solver.contacts.pairs import Keys, are_present
from ..solver.frame_forces import FrameStatus
from ..solver.nlgs.chain import ChainSettings
from ..solver.nlgs.force_memory import ForceMemory
from ..solver.nlgs.interval import Interval
from ..solver.nlgs.problem import ContactProblem, inertial_impedance
from ..solver.nlgs.solve import NlgsSettings, sweeps, to_contact_order
from ..solver.sequence.settings import SequenceSettings
from ..solver.statistics.agreement import compare_forces
from ..solver.statistics.stress import friction_angle, love_weber_stress, principal_stresses
from .scenarios.perturbation import on_given_grains

FIRST_FRAME = 3  # before it, the initial forces matter
FRICTION, WALL_FRICTION = 0.3, 0.5
RADIUS_FACTOR = 1.02  # of the radii before contacts are detected: they are known up to about so much
# Radii among which the best ones are chosen with the truth: the recipe varies them slightly to control the contacts.
TRIED_FACTORS = (1.001, 1.002, 1.003, 1.005, 1.021, 1.022, 1.023, 1.025)
WALL_REACH = 2.0 * 1.45e-4  # [m]: two pixels, within which a rod touches a wall
LEAST_SWEEPS, MOST_SWEEPS = 300, 100_000
STEADY_CHANGE = 1e-5  # relative, of the sum of all f_n in a sweep …
STEADY_SWEEPS = 500  # … in so many successive sweeps

FrameField = tuple[Keys, Array]  # keys (c,) and forces (c, 2) [N]


@dataclass(frozen=True, slots=True)
class AuthorsSettings:
    """What the authors' program leaves to its user."""

    radius_factor: float = RADIUS_FACTOR
    most_sweeps: int = MOST_SWEEPS


@dataclass(frozen=True, slots=True)
class RecipeScore:
    """Agreement of one recipe with the truth, mean over frames."""

    recipe: str
    r_fn: float
    r_ft: float
    scale: float
    friction_angle: float  # [°] rms error
    direction: float  # [°] rms error of the principal direction of the stress
    frames: int


@dataclass(frozen=True, slots=True)
class _TouchingNetwork:
    """Pairs that overlap, and rods within reach of a wall."""

    def at(self, fraction: float, grains: Grains, state: GrainMotion, walls: Walls) -> tuple[Contacts, Array | None]:
        found = detect_contacts(grains, state.position, state.present, walls, 0.0, wall_threshold=WALL_REACH)
        return found, None


def compare_programs(
    inputs: Inputs, ours: Results, truth: TruthContacts, progress: Progress = no_progress
) -> list[RecipeScore]:
    """Score the paper's recipe, that of the authors' program and these results on the same input.

    Parameters
    ----------
    inputs : Inputs
    ours : Results
        Of these inputs.
    truth : TruthContacts
    progress : Progress

    Returns
    -------
    list of RecipeScore
        From frame FIRST_FRAME on; frames that a recipe cannot solve are left out.
    """
    count, walls, given = len(ours.frames), inputs.walls.count, inputs.tracks.grain_count
    bodies = ours.grains.count + walls
    true = [on_given_grains(*each, bodies, walls, given) for each in truth.by_frame(bodies, count)]

    def paper(factor: float) -> list[FrameField | None]:
        observer = InferenceObserver(progress)
        return _fields_of(infer_sequence(_as_in_the_paper(inputs, factor), observer, complete=False), walls, given)

    def authors(factor: float) -> list[FrameField]:
        return list(_reported(solve_as_authors(inputs, AuthorsSettings(factor)), count, progress))

    def score(recipe: str, found: Sequence[FrameField | None]) -> RecipeScore:
        return score_recipe(recipe, inputs, found, true)

    def best(
        recipe: str, solve: Callable[[float], Sequence[FrameField | None]], factors: Sequence[float]
    ) -> RecipeScore:
        scores = [score(f"{recipe}, best radii: {_percent(factor)}", solve(factor)) for factor in factors]
        return max(scores, key=lambda each: each.r_fn if np.isfinite(each.r_fn) else -1.0)

    return [
        best("the paper", paper, (1.0, RADIUS_FACTOR)),
        score("authors' program, radii as given", authors(1.0)),
        score(f"authors' program, radii {_percent(RADIUS_FACTOR)}", authors(RADIUS_FACTOR)),
        best("authors' program", authors, TRIED_FACTORS),
        score("this program", _fields_of(ours, walls, given)),
    ]


def _percent(factor: float) -> str:
    return f"+ {100.0 * (factor - 1.0):.1f} %"


def solve_as_authors(inputs: Inputs, settings: AuthorsSettings | None = None) -> Iterator[FrameField]:
    """Solve all frames by the recipe of the authors' program.

    Parameters
    ----------
    inputs : Inputs
    settings : AuthorsSettings, optional

    Yields
    ------
    keys : (c,)
    force : (c, 2)
        f_n and f_t [N].

    Notes
    -----
    Radii are enlarged by a common factor. Pairs that overlap touch, as do rods within two pixels of a wall. Friction is
    .3 between rods and .5 at walls. Every frame is swept once with the grains' own inertia, from the forces of the
    previous one, until Σ f_n changes by less than 1e-5 in each of 500 successive sweeps, but 300 to 100 000 times.
    """
    settings = AuthorsSettings() if settings is None else settings
    packing, snapshots = _packing_of(inputs, settings), make_snapshots(inputs.tracks, inputs.walls)
    memory, seen = ForceMemory.empty(), LastSeen.never(packing.grains.count)
    for k, snapshot in enumerate(snapshots):
        if k == 0:
            motion = motion_from(snapshot, snapshots[1])
        else:
            motion = motion_to(snapshot, seen, snapshots[k - 1].time, snapshots[k - 1].endpoints)
        impedance = inertial_impedance(packing.grains, interval=motion.interval)
        problem, contacts, _ = Interval(packing, motion, _TouchingNetwork()).at(1.0, impedance)
        force = sweep_until_steady(problem, memory.recall(contacts), settings.most_sweeps)
        memory, seen = memory.renew(contacts, force, snapshot.present), seen.updated(snapshot)
        yield contacts.key, force


def sweep_until_steady(problem: ContactProblem, guess: Array, most: int = MOST_SWEEPS) -> Array:
    """Sweep from a guess (c, 2) [N] until the sum of all f_n is steady; return the forces (c, 2) [N]."""
    if not len(guess):
        return guess
    total = deque([float(guess[:, 0].sum())], maxlen=2)
    steady, force = 0, guess
    for sweep in sweeps(problem, NlgsSettings(), guess=guess):
        force = sweep.force
        total.append(float(force[:, 0].sum()))
        change = abs(total[1] - total[0]) / total[1] if total[1] > 0.0 else 0.0
        steady = steady + 1 if change < STEADY_CHANGE else 0
        if sweep.number >= most or (steady >= STEADY_SWEEPS and sweep.number >= LEAST_SWEEPS):
            break
    return to_contact_order(problem, force)


def score_recipe(
    recipe: str, inputs: Inputs, found: Sequence[FrameField | None], true: Sequence[FrameField]
) -> RecipeScore:
    """Score forces of all frames, None where there are none, against the true ones of the same grains and walls."""
    grains = Grains.of_rods(inputs.tracks.radius, density=1.0, length=1.0)
    snapshots, rows = make_snapshots(inputs.tracks, inputs.walls), []
    for k in range(FIRST_FRAME, len(snapshots)):
        forces = found[k]
        if forces is None or not forces[1].any():
            continue
        agreement = compare_forces(*forces, *true[k])
        (angle, direction), (true_angle, true_direction) = (
            _stress_angles(grains, snapshots[k], key, force) for key, force in (forces, true[k])
        )
        turned = (direction - true_direction + 90.0) % 180.0 - 90.0
        rows.append((agreement.r_fn, agreement.r_ft, agreement.scale, angle - true_angle, turned))
    table = np.array(rows).reshape(-1, 5)
    with np.errstate(invalid="ignore"):
        mean, rms = table[:, :3].sum(axis=0) / len(rows), np.sqrt((table[:, 3:] ** 2).sum(axis=0) / len(rows))
    r_fn, r_ft, scale = mean.tolist()
    angle_error, direction_error = rms.tolist()
    return RecipeScore(recipe, r_fn, r_ft, scale, angle_error, direction_error, len(rows))


def print_programs(console: Console, title: str, scores: Sequence[RecipeScore]) -> None:
    """Print one row for every recipe."""
    table = Table(title=title, box=None)
    headings = ("recipe", "r(f_n)", "r(f_t)", "scale", "friction angle", "principal direction", "frames")
    for number, heading in enumerate(headings):
        table.add_column(heading, justify="right" if number else "left", overflow="fold")
    for each in scores:
        table.add_row(
            each.recipe, f"{each.r_fn:.3f}", f"{each.r_ft:.3f}", f"{each.scale:.2f}", f"± {each.friction_angle:.1f}°",
            f"± {each.direction:.1f}°", str(each.frames),
        )  # fmt: skip
    console.print(table)


def mean_scores(scores: Sequence[Sequence[RecipeScore]]) -> list[RecipeScore]:
    """Average the scores of the same recipes over experiments."""
    numbers = [each.name for each in fields(RecipeScore) if each.name not in ("recipe", "frames")]
    return [
        replace(
            rows[0],
            recipe=" / ".join(dict.fromkeys(row.recipe for row in rows)),
            frames=sum(row.frames for row in rows),
            **{name: float(np.mean([getattr(row, name) for row in rows])) for name in numbers},
        )
        for rows in zip(*scores, strict=True)
    ]


def _as_in_the_paper(inputs: Inputs, factor: float) -> Inputs:
    """The same with the paper's recipe: radii times a factor, inertia only, stop at ε_f, reset to zero."""
    chain = ChainSettings(kappa=None, substeps=1, spin_up=1, sweeps=5000, force_change=1e-2, keep="none")
    sequence = SequenceSettings(estimator="nlgs", chain=chain, reset_to_zero=True)
    settings = InferenceSettings(sequence, calibration=None, boundary=None, infer_unseen=False)
    tracks = replace(inputs.tracks, radius=factor * inputs.tracks.radius)
    return replace(inputs, tracks=tracks, settings=settings)


def _packing_of(inputs: Inputs, settings: AuthorsSettings) -> Packing:
    material = replace(inputs.material, friction=FRICTION, wall_friction=WALL_FRICTION)
    radius = settings.radius_factor * inputs.tracks.radius
    return material.pack(radius, inputs.walls.usual_pressure(material.length), boundary=inputs.tracks.boundary)


def _fields_of(results: Results, walls: int, given: int) -> list[FrameField | None]:
    bodies = results.grains.count + walls
    return [
        None
        if frame.status is FrameStatus.FAILED
        else on_given_grains(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), bodies, walls, given)
        for frame in results.frames
    ]


def _reported(solved: Iterator[FrameField], count: int, progress: Progress) -> Iterator[FrameField]:
    """Report every frame as it is solved."""
    for number, frame in enumerate(solved, start=1):
        progress("authors' program", number, count)
        yield frame


def _stress_angles(grains: Grains, snapshot: Snapshot, key: Keys, force: Array) -> tuple[float, float]:
    """Friction angle and principal direction [°] of the stress of forces (c, 2) [N]."""
    order = np.argsort(key)
    key, force = key[order], force[order]
    here = are_present(key, snapshot.present, grains.count + len(snapshot.endpoints))
    contacts = measure_pairs(grains, snapshot.position, snapshot.walls, key[here])
    force = force[here]
    stress = love_weber_stress(contacts, force[:, 0], force[:, 1], snapshot.position, 1.0, 1.0)
    return float(np.rad2deg(friction_angle(stress))), float(np.rad2deg(principal_stresses(stress)[2]))
