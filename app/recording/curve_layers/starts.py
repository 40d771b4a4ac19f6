"""Writes what a frame's solve starts from: how far the former forces carry (warm), and how far none do (cold).

Both are natural-map residuals of the very problem that the last sub-step of the frame's chain solved, after sweeps of
its own: the warm one after a first sweep from the former forces, the cold ones after 1, 2, 4, … sweeps from zero
forces. The distance between them, in sweeps, is what the history of a frame saves.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.motion import FrameMotion, LastSeen, motion_from, motion_to
from solver.bodies.packing import Material, Packing
from solver.contacts.contacts import ContactSource
from solver.detection.networks import SURE
from solver.nlgs.chain import ChainSettings, force_scale
from solver.nlgs.problem import ContactProblem, assemble, kinematic_impedance
from solver.nlgs.solve import NlgsSettings, solve
from solver.nlgs.warm_start import ForceMemory
from solver.sequence.frame_forces import FrameForces

from ...inference.snapshots import make_snapshots
from ..look import entities
from ..look.colours import SERIES
from ..look.scene import Clock, Scene
from ..look.values import log_scalar
from .convergence import power_of_ten

COLD_SWEEPS = 2 ** np.arange(10)  # after which the cold start is measured: up to 512


@dataclass(frozen=True, slots=True)
class Starts:
    """Natural-map residuals of one frame; NaN where they are not known."""

    warm: float  # after one sweep from the former forces; NaN where the frame started without any
    cold: Array  # (len(COLD_SWEEPS),) after so many sweeps from zero forces

    @property
    def saved(self) -> float:
        """Sweeps that a cold start needs to come as far as the warm one after its first; NaN if more than tried."""
        there = np.flatnonzero(self.cold <= self.warm)
        if len(there) == 0:
            return float("nan")
        row = int(there[0])
        if row == 0:
            return 0.0
        # Between two of them the residual falls as a power of the number of sweeps.
        part = np.log(self.cold[row - 1] / self.warm) / np.log(self.cold[row - 1] / self.cold[row])
        return float(COLD_SWEEPS[row - 1] * (COLD_SWEEPS[row] / COLD_SWEEPS[row - 1]) ** part - 1.0)


UNKNOWN = Starts(np.nan, np.full(len(COLD_SWEEPS), np.nan))


def log_start_styles(stream: rr.RecordingStream) -> None:
    """Log names and colours of the curves."""
    for path, name, colour in (
        (entities.COLD_RESIDUAL, "cold: one sweep from no forces", SERIES[1]),
        (entities.WARM_RESIDUAL, "warm: one sweep from the former ones", SERIES[0]),
    ):
        stream.log(path, rr.SeriesLines(colors=[colour], names=name, widths=2.0), static=True)


def log_starts(clock: Clock, starts: Starts) -> None:
    """Log the residuals of one frame."""
    clock.end()
    for path, value in (
        (entities.COLD_RESIDUAL, starts.cold[0]),
        (entities.WARM_RESIDUAL, starts.warm),
    ):
        log_scalar(clock, path, float(power_of_ten(np.array(value))))
    log_scalar(clock, entities.SAVED_SWEEPS, starts.saved)


class StartGauge:
    """Measures the starts of frames in their order."""

    def __init__(self, scene: Scene) -> None:
        self._packing = packing_of(scene)
        self._snapshots = make_snapshots(scene.tracks, scene.walls)
        self._seen = LastSeen.never(scene.grains.count)
        self._former: FrameForces | None = None

    def measure(self, forces: FrameForces) -> Starts:
        """Measure the starts of the next frame."""
        motion, former = self._motion(forces.frame), self._former
        self._seen = self._seen.renewed(self._snapshots[forces.frame])
        self._former = forces
        if self._packing is None or motion is None or not forces.kappa > 0.0 or not forces.contacts.count:
            return UNKNOWN
        problem, rows = contact_problem(self._packing, motion, forces)
        warm = np.nan
        if former is not None and np.isfinite(forces.old_unbalance):
            order = np.argsort(former.contacts.key)
            force = np.nan_to_num(np.column_stack([former.nlgs_fn, former.nlgs_ft]))
            memory = ForceMemory(former.contacts.key[order], force[order])
            warm = solve(problem, NlgsSettings(1), guess=memory.recall(forces.contacts.select(rows))).natural_map
        return Starts(warm, cold_residuals(problem))

    def _motion(self, frame: int) -> FrameMotion | None:
        snapshots = self._snapshots
        if frame == 0:  # nothing leads to it
            return motion_from(snapshots[0], snapshots[1]) if len(snapshots) > 1 else None
        before = snapshots[frame - 1]
        return motion_to(snapshots[frame], self._seen, before.time, before.endpoints)


def cold_residuals(problem: ContactProblem) -> Array:
    """Natural-map residuals after COLD_SWEEPS sweeps from zero forces."""
    residuals, force, done = np.empty(len(COLD_SWEEPS)), None, 0
    for row, count in enumerate(COLD_SWEEPS.tolist()):
        solution = solve(problem, NlgsSettings(count - done), guess=force)
        residuals[row], force, done = solution.natural_map, solution.force, count
    return residuals


def contact_problem(
    packing: Packing, motion: FrameMotion, forces: FrameForces
) -> tuple[ContactProblem, NDArray[np.bool_]]:
    """The problem that the last sub-step of a frame's chain solved, and which of the frame's contacts (c,) are in it.

    Contacts that a reviewer forbade are not in it; a doubtful one must first close the gap that its probability says.
    """
    grains, walls = motion.at(1.0, packing.load(motion.endpoints))
    rows = forces.source != ContactSource.FORBIDDEN_BY_REVIEWER
    contacts, touch = forces.contacts.select(rows), forces.probability[rows]
    doubtful = (touch > 0.0) & (touch < SURE)  # NaN: not computed, hence not doubted
    closing = np.zeros(contacts.count)
    closing[doubtful] = motion.velocity_rms * np.log10(SURE / touch[doubtful])
    impedance = kinematic_impedance(
        packing.grains,
        kappa=forces.kappa,
        force_scale=force_scale(packing, ChainSettings()),
        velocity_scale=motion.velocity_rms,
        formal_weight=packing.material.formal_weight,
    )
    return assemble(packing.grains, grains, walls, contacts, packing.material, impedance, closing=closing), rows


def packing_of(scene: Scene) -> Packing | None:
    """The mechanics that a run's configuration states; None where it states none."""
    try:
        material = tomllib.loads(scene.configuration).get("material", {})
    except tomllib.TOMLDecodeError:
        return None
    friction, of_walls = float(material.get("friction", scene.friction)), material.get("wall_friction")
    gravity = material.get("gravity", (0.0, 0.0))
    return Packing(
        scene.grains,
        scene.rod_length,
        Material(
            friction,
            friction if of_walls is None else float(of_walls),
            float(material.get("formal_weight", 0.0)),
            (float(gravity[0]), float(gravity[1])),
        ),
        scene.walls.pressure,
    )
