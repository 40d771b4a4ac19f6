"""Mechanics of a granular packing: contacts, contact forces, statistics. Arrays in, arrays out.

The names below are loaded when they are first asked for: `import solver` itself costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from solver.bodies.grains import GrainMotion, Grains
    from solver.bodies.motion import Snapshot
    from solver.bodies.packing import Material, Packing
    from solver.bodies.walls import Walls
    from solver.contacts.contacts import Contacts, ContactSource, ContactState, detect_contacts
    from solver.contacts.verdicts import Verdicts
    from solver.nlgs.chain import ChainSettings
    from solver.nlgs.problem import ContactProblem, assemble
    from solver.nlgs.solve import NlgsSettings, Solution, Stop, Sweep, solve, sweeps
    from solver.sequence.frame_forces import FrameForces, FrameStatus
    from solver.sequence.frames import solve_sequence
    from solver.sequence.settings import EnsembleSettings, SequenceSettings
    from solver.sequence.state import SequenceState
    from solver.statistics.frame_statistics import FrameStatistics, frame_statistics

_HOMES = {
    "solver.bodies.grains": ("GrainMotion", "Grains"),
    "solver.bodies.motion": ("Snapshot",),
    "solver.bodies.packing": ("Material", "Packing"),
    "solver.bodies.walls": ("Walls",),
    "solver.contacts.contacts": ("ContactSource", "ContactState", "Contacts", "detect_contacts"),
    "solver.contacts.verdicts": ("Verdicts",),
    "solver.nlgs.chain": ("ChainSettings",),
    "solver.nlgs.problem": ("ContactProblem", "assemble"),
    "solver.nlgs.solve": ("NlgsSettings", "Solution", "Stop", "Sweep", "solve", "sweeps"),
    "solver.sequence.frame_forces": ("FrameForces", "FrameStatus"),
    "solver.sequence.frames": ("solve_sequence",),
    "solver.sequence.settings": ("EnsembleSettings", "SequenceSettings"),
    "solver.sequence.state": ("SequenceState",),
    "solver.statistics.frame_statistics": ("FrameStatistics", "frame_statistics"),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "ChainSettings",
    "ContactProblem",
    "ContactSource",
    "ContactState",
    "Contacts",
    "EnsembleSettings",
    "FrameForces",
    "FrameStatistics",
    "FrameStatus",
    "GrainMotion",
    "Grains",
    "Material",
    "NlgsSettings",
    "Packing",
    "SequenceSettings",
    "SequenceState",
    "Snapshot",
    "Solution",
    "Stop",
    "Sweep",
    "Verdicts",
    "Walls",
    "assemble",
    "detect_contacts",
    "frame_statistics",
    "solve",
    "solve_sequence",
    "sweeps",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'solver' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
