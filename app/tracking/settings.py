"""How grains are followed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """How grains are followed. Lengths in pixels."""

    follow: Literal["texture", "outline"] = "texture"  # what of a grain is followed
    patch_share: float = 0.85  # radius of the correlated disc / radius of the grain; the rim is shaded
    tolerance: float = 3e-2  # [px] a step below which a fit has converged: the next one would be a twentieth of it
    step_limit: int = 25  # Gauss-Newton steps
    search_window: float = 60.0  # [px] half width of the widest search
    margin: float = 0.15  # by which a ZNCC must exceed the greatest accidental one, and that of the second best place
    robust_excess: float = 4.0  # residual variance / the frame's typical one, above which a fit is repeated robustly
    kept_least: float = 0.4  # share of a patch that a robust fit must rest on
    overlap_allowed: float = 0.2  # overlap / smaller radius that tilt and a wrong radius can explain

    def __post_init__(self) -> None:
        if not 0.2 <= self.patch_share <= 1.0:
            raise ValueError(f"patch_share must be in [0.2, 1], not {self.patch_share}")
        for name in ("tolerance", "step_limit", "search_window"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive, not {getattr(self, name)}")
