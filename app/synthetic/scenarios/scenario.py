"""A scenario: which truth is simulated, and how the data depart from it."""

from __future__ import annotations

from dataclasses import dataclass

from .departures import Departure, keep_unchanged
from .loading_paths import LoadingPath
from .preset_names import Group


@dataclass(frozen=True, slots=True)
class Scenario:
    """A simulated truth and how its data depart from it."""

    meaning: str
    loading: LoadingPath
    departure: Departure = keep_unchanged
    noise: float = 1e-5  # [m] of a position component
    scale_stated: bool = True  # of forces, where the simulation has a loaded wall
    group: Group = "correct"

    @property
    def scale_known(self) -> bool:
        """Whether a loaded plate or the weight determines the scale of the forces."""
        loaded = bool(self.loading.plates or self.loading.measured)
        return self.scale_stated and (loaded or any(self.loading.settings.gravity))
