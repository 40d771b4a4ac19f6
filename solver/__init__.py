"""Mechanics of a granular packing: contacts, contact forces and statistics of arrays.

Public names are loaded on first access, so importing the package is fast.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .bodies.grains import GrainMotion, Grains
    from .bodies.motion import Snapshot
    from .bodies.packing import Material, Packing
    from .bodies.walls import Walls
    from .contacts.contacts import Contacts, ContactSource, ContactState, detect_contacts
    from .contacts.verdicts import Verdicts
    from .frame_forces import FrameForces, FrameStatus
    from .nlgs.chain import ChainSettings
    from .nlgs.problem import ContactProblem, assemble
    from .nlgs.solve import NlgsSettings, Solution, Stop, Sweep, solve, sweeps
    from .sequence.frames import solve_sequence
    from .sequence.settings import EnsembleSettings, SequenceSettings
    from .sequence.state import SequenceState
    from .statistics.frame_statistics import FrameStatistics, frame_statistics

_HOMES = {
    ".bodies.grains": ("GrainMotion", "Grains"),
    ".bodies.motion": ("Snapshot",),
    ".bodies.packing": ("Material", "Packing"),
    ".bodies.walls": ("Walls",),
    ".contacts.contacts": ("ContactSource", "ContactState", "Contacts", "detect_contacts"),
    ".contacts.verdicts": ("Verdicts",),
    ".nlgs.chain": ("ChainSettings",),
    ".nlgs.problem": ("ContactProblem", "assemble"),
    ".nlgs.solve": ("NlgsSettings", "Solution", "Stop", "Sweep", "solve", "sweeps"),
    ".frame_forces": ("FrameForces", "FrameStatus"),
    ".sequence.frames": ("solve_sequence",),
    ".sequence.settings": ("EnsembleSettings", "SequenceSettings"),
    ".sequence.state": ("SequenceState",),
    ".statistics.frame_statistics": ("FrameStatistics", "frame_statistics"),
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
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOME[name], __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
