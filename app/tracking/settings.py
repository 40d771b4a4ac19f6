"""Settings of the tracker."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """Settings of the tracker. Lengths in pixels."""

    follow: Literal["texture", "outline"] = "texture"  # feature of a grain that is tracked
    patch_fraction: float = 0.85  # radius of the correlated disc / radius of the grain; the rim is shaded
    tolerance: float = 6e-2  # [px] step below which a fit has converged: the next one would be a hundredth of it
    step_limit: int = 25  # Gauss-Newton steps
    search_window: float = 60.0  # [px] half width of the widest search
    margin: float = 0.15  # by which a ZNCC must exceed the greatest accidental one, and that of the second best place
    robust_excess: float = 4.0  # residual variance / the frame's typical one, above which a fit is repeated robustly
    min_kept: float = 0.4  # least fraction of a patch that a robust fit must use
    overlap_allowed: float = 0.2  # overlap / smaller radius that tilt and a wrong radius can explain

    def __post_init__(self) -> None:
        if not 0.2 <= self.patch_fraction <= 1.0:
            raise ValueError(f"patch_fraction must be in [0.2, 1], not {self.patch_fraction}")
        for name in ("tolerance", "step_limit", "search_window"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive, not {getattr(self, name)}")
