"""Names of presets and scenarios, without the code that makes them, for the help of commands."""

from __future__ import annotations

from typing import Literal

PhotographedPreset = Literal["small", "paper", "1g2e"]
MeasuredPreset = Literal["photoelastic"]  # no experiment, but the output of another program
FringedPreset = Literal["fringes", "stiff_fringes"]  # photographs of photoelastic discs
Group = Literal["correct", "missing physics", "wrong input"]
ScenarioName = Literal[
    "shear", "sheared", "biaxial", "isotropic", "rising_loads", "rising_corners", "gravity",
    "soft", "softer", "soft_radii_03", "soft_radii_1", "soft_noise", "softer_noise",
    "soft_stretched", "softer_stretched", "soft_unseen", "nearly_jammed",
    "corners", "short_walls", "unseen", "biaxial_unseen", "camera", "centres", "radii_03", "radii_1", "radius_offset",
    "mu_low", "mu_high", "step_05", "step_1", "ten_frames", "periodic", "outer", "circle", "loads",
    "outer_biaxial", "outer_isotropic", "outer_gravity", "outer_moving", "outer_noise_40", "outer_radii_03",
    "outer_theta_sign", "outer_mu_05", "unknown_load",
    "loose", "cyclic", "noise_40", "correlated_noise", "annulus", "tilted_bed", "tiny_cycles", "power_law",
    "isotropic_centres", "stepped_centres", "rising_centres", "annulus_centres", "cycles_centres",
    "annulus_radii_1", "cycles_radii_1", "tilted_radii_1",
    "stiff_annulus", "stiff_tiny_cycles", "stiff_stepped_loads", "pins", "stepped_pins", "tilted_pins", "cycles_pins",
    "moving", "stepped_loads", "membrane", "shear_box", "footing", "intruder", "drum", "stiffest",
    "stiff", "stiff_moving", "stiff_loose", "stiff_noise_40",
    "base_friction", "cohesion", "strong_cohesion", "friction_spread",
    "smooth_walls", "smooth_walls_spread", "rough_walls", "inertia", "strong_inertia", "rolling",
    "elliptic", "slightly_elliptic", "sizes_10",
    "time_reversed", "shuffled", "swapped_frames", "duplicate_frame",
    "theta_sign", "theta_zero", "theta_degrees", "theta_absent",
    "mu_01", "mu_05", "walls_late", "left_late", "top_fixed", "wall_inside", "walls_scatter",
    "aspect_03", "aspect_1", "lens_03", "class_2", "some_radii", "wrong_class", "overhang", "outliers", "one_jump",
    "missing_poses", "exchanged_ids", "stepped_some_radii", "annulus_some_radii", "rising_lens",
    "unloaded_annulus", "unloaded_biaxial", "unloaded_cyclic", "unloaded_loose", "unloaded_noise_40",
    "unloaded_step_05", "unloaded_rolling", "unloaded_inertia", "unloaded_mu_01", "unloaded_theta_degrees",
    "unloaded_time_reversed", "unloaded_class_2", "unloaded_walls_late", "unloaded_some_radii",
]  # fmt: skip
