"""Names of what can be made, without what it takes to make it: a command's help lists them."""

from __future__ import annotations

from typing import Literal

PhotographedPreset = Literal["small", "paper"]
MeasuredPreset = Literal["photoelastic"]  # no experiment, but what another program would leave of one
WorldName = Literal[
    "shear", "sheared", "biaxial", "isotropic", "gravity", "soft", "softer", "soft_radii_03", "soft_unseen",
    "nearly_jammed",
    "corners", "short_walls", "unseen", "camera", "centres", "radii_03", "radii_1", "radius_offset",
    "mu_low", "mu_high", "step_05", "step_1", "ten_frames", "periodic", "outer", "circle", "loads",
]  # fmt: skip
