"""Contacts, visiting order and contact problems of one interval, shared by all chains and computed once."""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock
from typing import NamedTuple

import numpy as np

from ..bodies.grains import Array, GrainMotion
from ..bodies.motion import FrameMotion
from ..bodies.packing import Packing
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts
from ..detection.contact_networks import Network
from .problem import ContactProblem, PreparedContacts, assemble, with_impedance
from .sweeping.ordering import VisitingOrder, order_contacts


class Instant(NamedTuple):
    """Contact problem of a chain at one instant of an interval."""

    problem: ContactProblem
    contacts: Contacts
    walls: Walls


@dataclass(frozen=True, slots=True)
class _Network:
    """Bodies and contacts at an instant, and the assembled problems with their impedances."""

    state: GrainMotion
    walls: Walls
    contacts: Contacts
    closing: Array | None  # (c,) [m/s]
    order: VisitingOrder
    problems: list[tuple[Array, ContactProblem]]


class Interval:
    """The instants of an interval. Thread-safe: a second request waits for the first and uses its result."""

    def __init__(self, packing: Packing, motion: FrameMotion, network: Network) -> None:
        self.packing, self.motion = packing, motion
        self._network, self._lock = network, Lock()
        self._load = packing.load(
            motion.endpoints, motion.side, motion.load, (motion.grains.position, motion.grains.present)
        )
        self._known: dict[float, _Network] = {}

    def at(self, fraction: float, impedance: Array) -> Instant:
        """Return the instant at a fraction of the interval for grains of this impedance (n,) [N s/m]."""
        with self._lock:
            network = self._known.get(fraction)
            if network is None:
                network = self._known[fraction] = self._measure(fraction)
            for known, problem in network.problems:
                if np.array_equal(known, impedance):
                    return Instant(problem, network.contacts, network.walls)
            grains, material = self.packing.grains, self.packing.material
            if network.problems:
                alike = network.problems[0][1]
                problem = with_impedance(alike, grains, network.state, network.walls, material, impedance)
            else:
                prepared = PreparedContacts(network.closing, network.order)
                problem = assemble(
                    grains, network.state, network.walls, network.contacts, material, impedance, prepared
                )
            network.problems.append((impedance, problem))
            return Instant(problem, network.contacts, network.walls)

    def _measure(self, fraction: float) -> _Network:
        state, walls = self.motion.at(fraction, self._load)
        contacts, closing_distance = self._network.at(fraction, self.packing.grains, state, walls)
        # Reluctance is in displacements of a step, so the time of a step cancels.
        closing = None if closing_distance is None else self.motion.velocity_rms * closing_distance
        return _Network(state, walls, contacts, closing, order_contacts(contacts), [])
