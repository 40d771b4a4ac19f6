"""What is thought of a sequence's constant errors before its gaps are looked at."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CalibrationSettings:
    """Which constant errors are looked for, and how large they may be."""

    pixel_size: float = 5e-3  # relative standard deviation of the given scale; 0: it is exact
    lens: bool = True  # look for what is left of the lens's radial distortion
    radius_class: float = 1e-3  # relative error that the rods of a known radius may share; 0: none
    radius_offset: float = 4e-3  # relative error that all radii may share; 0: none
    radii_are_known: bool = True  # by themselves; radii seen in photographs share the scale's error, and cannot tell it
