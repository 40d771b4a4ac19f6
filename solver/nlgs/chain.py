"""One interval of the Gauss-Seidel chain: sub-steps in order, each on its own contact network."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array
from solver.bodies.motion import FrameMotion
from solver.bodies.packing import Packing
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts
from solver.detection.networks import Network
from solver.nlgs.interval import Interval
from solver.nlgs.problem import ContactProblem, inertial_impedance, kinematic_impedance
from solver.nlgs.solve import NlgsSettings, Solution, solve, unbalance_of
from solver.nlgs.sweep_record import Keep, SweepHistory, SweepRecorder
from solver.nlgs.warm_start import ForceMemory


@dataclass(frozen=True, slots=True)
class ChainSettings:
    kappa: float | None = 0.05  # kinematic number; None: as the paper's time step gives it
    substeps: int = 5  # per interval
    spin_up: int = 10  # sub-steps without former forces
    sweeps: int = 1000  # per sub-step; more of them regularise less
    relaxation: float = 1.0  # above 1 selects another solution
    force_change: float | None = None  # the paper's ε_f as a stopping level
    reference_pressure: float = 1e4  # [Pa] scale of the forces where no wall carries a pressure
    keep: Keep = "log"  # which sweeps keep their forces


@dataclass(frozen=True, slots=True)
class ChainStep:
    """What one interval gave."""

    contacts: Contacts  # of the frame
    walls: Walls
    solution: Solution  # of the last sub-step
    sweeps: int  # of all sub-steps
    history: SweepHistory
    kappa: float
    old_unbalance: float  # ū, NaN without former forces
    memory: ForceMemory
    problem: ContactProblem  # of the last sub-step
    former: Array | None  # (c, 2) [N] forces of the former frame on these contacts; None: there were none


def force_scale(packing: Packing, settings: ChainSettings) -> float:
    """f₀ = σ L d [N], with the mean diameter and the mean pressure of the plates, or that of the packing's weight.

    The weight presses on average with half of what all of it does on a square packing's base.
    """
    diameter = 2.0 * float(packing.grains.radius.mean())
    loaded = np.isfinite(packing.pressure)
    if loaded.any():
        return float(packing.pressure[loaded].mean()) * packing.length * diameter
    if any(packing.material.gravity):
        return 0.5 * float(np.linalg.norm(packing.weight.sum(axis=0))) / float(np.sqrt(packing.grains.count))
    return settings.reference_pressure * packing.length * diameter


def advance_chain(
    packing: Packing, motion: FrameMotion, memory: ForceMemory, settings: ChainSettings, network: Network
) -> ChainStep:
    """Take the forces of the former frame through one interval, on the contacts of a network."""
    return advance_through(Interval(packing, motion, network), memory, settings)


def advance_through(interval: Interval, memory: ForceMemory, settings: ChainSettings) -> ChainStep:
    """The same through an interval that other chains go through, too."""
    packing, motion = interval.packing, interval.motion
    fresh = len(memory.key) == 0
    steps = (settings.spin_up if fresh else settings.substeps) if motion.spans else 1
    sweeps = settings.sweeps if motion.spans else settings.sweeps * settings.substeps
    impedance, kappa = _impedance(packing, motion, settings, steps)
    nlgs = NlgsSettings(sweeps, settings.force_change, None, settings.relaxation)
    recorder = SweepRecorder(steps * sweeps, settings.keep)

    def solve_step(problem: ContactProblem, contacts: Contacts, guess: Array) -> Solution:
        recorder.begin(problem, contacts)
        # Where a stopping level is looked at, every sweep is measured.
        every = recorder.strides() if nlgs.force_change is None else 1
        return solve(problem, nlgs, guess=guess, observer=recorder.hear, every=every, measured=recorder.measured)

    carried, done = memory, 0
    for step in range(1, steps):
        problem, contacts, _ = interval.at(step / steps, impedance)
        solution = solve_step(problem, contacts, memory.recall(contacts))
        memory = memory.renew(contacts, solution.force, motion.grains.present)
        done += solution.sweeps
    problem, contacts, walls = interval.at(1.0, impedance)
    solution = solve_step(problem, contacts, memory.recall(contacts))
    former = None if fresh else carried.recall(contacts)
    return ChainStep(
        contacts=contacts,
        walls=walls,
        solution=solution,
        sweeps=done + solution.sweeps,
        history=recorder.history(contacts),
        kappa=kappa,
        old_unbalance=np.nan if former is None else unbalance_of(problem, former)[1],
        memory=memory.renew(contacts, solution.force, motion.grains.present),
        problem=problem,
        former=former,
    )


def _impedance(packing: Packing, motion: FrameMotion, settings: ChainSettings, steps: int) -> tuple[Array, float]:
    scale, velocity = force_scale(packing, settings), motion.velocity_rms
    weight = packing.material.formal_weight
    if settings.kappa is None:
        step = motion.interval / steps
        impedance = inertial_impedance(packing.grains, interval=step, formal_weight=weight)
        return impedance, float(packing.grains.mass.mean()) * velocity / (step * scale)
    impedance = kinematic_impedance(
        packing.grains, kappa=settings.kappa, force_scale=scale, velocity_scale=velocity, formal_weight=weight
    )
    return impedance, settings.kappa
