"""One interval of the Gauss-Seidel chain: sub-steps in order, each on its own contact network."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bodies.grains import Array
from ..bodies.motion import FrameMotion
from ..bodies.packing import Packing
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts
from ..detection.contact_networks import Network
from ..part_settings import ChainSettings
from .force_memory import ForceMemory
from .interval import Interval
from .problem import ContactProblem, inertial_impedance, kinematic_impedance, moved_before, with_boundary
from .solve import NlgsSettings, Solution, relative_force_residual, solve, velocity_change
from .sweep_record import SweepHistory, SweepRecorder


@dataclass(frozen=True, slots=True)
class ChainStep:
    """Result of one interval."""

    contacts: Contacts  # of the frame
    walls: Walls
    solution: Solution  # of the last sub-step
    sweeps: int  # of all sub-steps
    history: SweepHistory
    kappa: float
    old_unbalance: float  # ū, NaN without previous forces
    memory: ForceMemory
    problem: ContactProblem  # of the last sub-step
    previous_force: Array | None  # (c, 2) [N] of the previous frame on these contacts; None without any


def force_scale(packing: Packing, settings: ChainSettings) -> float:
    """Compute the force scale f₀ of a packing [N].

    Notes
    -----
    f₀ = σ L d with the mean diameter d and the mean pressure σ of the plates. Without plates, σ is the mean pressure of
    the weight in a square packing, half the pressure on its base. Without weight, σ is `reference_pressure`.
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
    """Advance the forces of the previous frame through one interval, on the contacts of a network."""
    return advance_chain_through(Interval(packing, motion, network), memory, settings)


def advance_chain_through(interval: Interval, memory: ForceMemory, settings: ChainSettings) -> ChainStep:
    """Advance the forces through an interval that several chains share."""
    packing, motion = interval.packing, interval.motion
    cold_start = len(memory.key) == 0
    steps = (settings.spin_up if cold_start else settings.substeps) if motion.ends_here else 1
    sweeps = settings.sweeps if motion.ends_here else settings.sweeps * settings.substeps
    impedance, kappa = _impedance(packing, motion, settings, steps)
    nlgs = NlgsSettings(sweeps, settings.force_change, None, settings.relaxation)
    recorder = SweepRecorder(steps * sweeps, settings.keep)

    def solve_step(problem: ContactProblem, contacts: Contacts, guess: Array) -> Solution:
        recorder.begin(problem, contacts)
        # With a stopping level, every sweep is measured.
        every = recorder.strides() if nlgs.force_change is None else 1
        return solve(problem, nlgs, guess=guess, observer=recorder.on_sweep, every=every, measured=recorder.measured)

    def instant(fraction: float) -> tuple[ContactProblem, Contacts, Walls]:
        problem, contacts, walls = interval.at(fraction, impedance)
        return problem if support is None else moved_before(problem, support), contacts, walls

    initial_memory, sweeps_done = memory, 0
    support = None if cold_start else _support(interval, initial_memory, impedance, 1.0 / steps)
    for step in range(1, steps):
        problem, contacts, _ = instant(step / steps)
        solution = solve_step(problem, contacts, memory.recall(contacts))
        memory = memory.renew(contacts, solution.force, motion.grains.present)
        sweeps_done += solution.sweeps
    problem, contacts, walls = instant(1.0)
    solution = solve_step(problem, contacts, memory.recall(contacts))
    previous_force = None if cold_start else initial_memory.recall(contacts)
    return ChainStep(
        contacts=contacts,
        walls=walls,
        solution=solution,
        sweeps=sweeps_done + solution.sweeps,
        history=recorder.history(contacts),
        kappa=kappa,
        old_unbalance=np.nan if previous_force is None else relative_force_residual(problem, previous_force)[1],
        memory=memory.renew(contacts, solution.force, motion.grains.present),
        problem=problem,
        previous_force=previous_force,
    )


def _support(interval: Interval, memory: ForceMemory, impedance: Array, fraction: float) -> Array | None:
    """Velocities (n, 3) [m/s] that cancel what the previous forces do to boundary grains; None: there are none."""
    boundary = interval.packing.grains.boundary
    if boundary is None:
        return None
    problem, contacts, _ = interval.at(fraction, impedance)
    return np.where(boundary[:, None], -velocity_change(problem, memory.recall(contacts)), 0.0)


def _impedance(packing: Packing, motion: FrameMotion, settings: ChainSettings, steps: int) -> tuple[Array, float]:
    scale, velocity = force_scale(packing, settings), motion.velocity_rms
    weight = packing.material.formal_weight
    if settings.kappa is None:
        step = motion.interval / steps
        impedance = inertial_impedance(packing.grains, interval=step, formal_weight=weight)
        impedance = with_boundary(impedance, packing.grains, force_scale=scale, error=0.0)  # as in the paper
        return impedance, float(packing.grains.mass.mean()) * velocity / (step * scale)
    impedance = kinematic_impedance(
        packing.grains, kappa=settings.kappa, force_scale=scale, velocity_scale=velocity, formal_weight=weight
    )
    error = float(np.sqrt(2.0)) * motion.sigma / motion.interval
    return with_boundary(impedance, packing.grains, force_scale=scale, error=error), settings.kappa
