"""What stored results were made from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ...process.frame_range import FrameRange


@dataclass(frozen=True, slots=True)
class Provenance:
    """The input and settings of results; stored as attributes."""

    fingerprint: str  # hash of the input and of the settings that affect the stored results
    experiment: str  # name of the experiment file; earlier versions: its path
    frames: FrameRange  # stored frames of the experiment
    checksums: dict[str, str]  # SHA-256 by input file
    inputs: str = ""  # hash of the input and the settings alone: the same for other code
    code: str = ""  # hash of all sources that the results depend on
    libraries: dict[str, str] = field(default_factory=dict)  # versions by name

    @property
    def program(self) -> dict[str, Any]:
        """What the manifest stores beside the fingerprint, to distinguish other code from other input."""
        return {"inputs": self.inputs, "code": self.code, "libraries": self.libraries}

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", FrameRange(*self.frames))
