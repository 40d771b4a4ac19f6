"""The caption of a frame, the same in recordings, films and figures: when it was, how strained, how far to trust it."""

from __future__ import annotations

import numpy as np

from ..solver.frame_forces import FrameForces


def caption_of_time(forces: FrameForces, time: float) -> str:
    """Return frame, time [s] and strain, e.g. "frame 11 · 330 s · shear 4.40°"."""
    parts = [f"frame {forces.frame}", f"{time:.4g} s" if np.isfinite(time) else "", caption_of_strain(forces)]
    return " · ".join(part for part in parts if part)


def caption_of_strain(forces: FrameForces) -> str:
    """Return the shear since frame 0, or the change of area where that is greater; empty where not known."""
    area = np.nan if forces.strain is None else float(np.trace(forces.strain))
    if np.isfinite(area) and not abs(area) <= abs(forces.shear):
        return f"area {round(100.0 * np.expm1(area), 2) + 0.0:+.2f} %"
    return f"shear {np.degrees(forces.shear):.2f}°" if np.isfinite(forces.shear) else ""


def caption_of_trust(forces: FrameForces) -> str:
    """Return status and trust, e.g. "settled · trust 0.80"."""
    trust = f"trust {forces.trust:.2f}" if np.isfinite(forces.trust) else "trust unknown"
    return f"{forces.status.name.lower()} · {trust}"
