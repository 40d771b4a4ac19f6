"""What all chains through one interval have in common: its contacts, their order and the problems, each made once."""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock
from typing import NamedTuple

import numpy as np

from solver.bodies.grains import Array, GrainMotion
from solver.bodies.motion import FrameMotion
from solver.bodies.packing import Packing
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts
from solver.detection.networks import Network
from solver.nlgs.problem import ContactProblem, assemble
from solver.nlgs.sweeping.ordering import VisitingOrder, order_contacts


class Instant(NamedTuple):
    """An instant of an interval, as a chain of some impedance solves it."""

    problem: ContactProblem
    contacts: Contacts
    walls: Walls


@dataclass(frozen=True, slots=True)
class _Network:
    """Bodies and contacts of an instant, and the problems that were made of them, each with its impedance."""

    state: GrainMotion
    walls: Walls
    contacts: Contacts
    closing: Array | None  # (c,) [m/s]
    order: VisitingOrder
    problems: list[tuple[Array, ContactProblem]]


class Interval:
    """The instants of an interval. Chains may ask from several threads: who comes second waits and finds it done."""

    def __init__(self, packing: Packing, motion: FrameMotion, network: Network) -> None:
        self.packing, self.motion = packing, motion
        self._network, self._lock = network, Lock()
        self._load = packing.load(motion.endpoints, motion.side, motion.load)
        self._known: dict[float, _Network] = {}

    def at(self, fraction: float, impedance: Array) -> Instant:
        """The instant after a fraction of the interval, for grains of this impedance (n,) [N s/m]."""
        with self._lock:
            here = self._known.get(fraction)
            if here is None:
                here = self._known[fraction] = self._measure(fraction)
            for known, problem in here.problems:
                if np.array_equal(known, impedance):
                    return Instant(problem, here.contacts, here.walls)
            problem = assemble(
                self.packing.grains, here.state, here.walls, here.contacts, self.packing.material, impedance,
                closing=here.closing, order=here.order,
            )  # fmt: skip
            here.problems.append((impedance, problem))
            return Instant(problem, here.contacts, here.walls)

    def _measure(self, fraction: float) -> _Network:
        state, walls = self.motion.at(fraction, self._load)
        contacts, reluctance = self._network.at(fraction, self.packing.grains, state, walls)
        # Reluctance counts in displacements of a step, so the time of a step cancels.
        closing = None if reluctance is None else self.motion.velocity_rms * reluctance
        return _Network(state, walls, contacts, closing, order_contacts(contacts), [])
