"""Settings of the parts of the method, with their defaults.

They stand apart from the parts because the experiment file takes its defaults from them: it is read, and photographs
are opened, before the libraries of numerics are loaded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

Keep = Literal["log", "all", "none"]
# Standard deviation of u_t over that of a position: two grains, translation and rotation, two photographs.
SLIP_SIGMAS = 2.8
REFERENCE_STEP = math.radians(0.25)  # [rad] shear between photographs at which forces are followed best
# Largest trust in forces of soft grains from their overlaps.
MAX_TRUST_MEASURED = 0.96  # the gaps show the overlaps; r .98 to .996 on simulated grains
MAX_TRUST_STATED = 0.65  # softness is specified and no gap shows it; r .66 to .74 on photoelastic discs


@dataclass(frozen=True, slots=True)
class ChainSettings:
    """Settings of the Gauss-Seidel chain."""

    kappa: float | None = 0.05  # kinematic number; None: from the paper's time step
    substeps: int = 5  # per interval
    spin_up: int = 10  # sub-steps of an interval without previous forces
    sweeps: int = 1000  # per sub-step; more sweeps regularise less
    relaxation: float = 1.0  # above 1 selects another solution
    force_change: float | None = None  # the paper's ε_f as a stopping level
    reference_pressure: float = 1e4  # [Pa] scale of the forces if no wall carries a pressure
    keep: Keep = "log"  # which sweeps keep their forces


@dataclass(frozen=True, slots=True)
class ConvexSettings:
    """Dimensionless weights of the program."""

    history: float = 3e-3  # λ, proximal weight of the previous forces
    balance: float = 1e3  # ρ, penalty weight of the force residual
    ambiguity_penalty: float = 0.3  # cost of force on a contact whose existence is uncertain
    slip_noise: float = 1.5 * SLIP_SIGMAS  # [σ of a position] smaller slips count as zero
    # ν where noise hides all sliding. On the apparatus at .0267° a photograph, where it is half of the sliding or more,
    # the scale of forces was .956 and .990 without it and is .973 and .994 (seeds 2 and 1, 20 photographs).
    noise_fraction: float = 0.06
    projection_weight: float = 0.5  # λ of the projection onto equilibrium
    tolerance: float = 3e-8  # of the interior-point method; force errors then stay below 0.1 %


@dataclass(frozen=True, slots=True)
class ContactProbabilitySettings:
    """Noise of the measured gaps, and selection of the candidate pairs."""

    overlap: float = 0.0  # [m] typical elastic overlap of a contact that bears force
    radius_sd: float = 0.0  # [m] standard deviation of a grain's radius
    margin: float = 20e-6  # [m] candidates have a gap below margin + reach · σ (+ overlap, 3 radius_sd) in some frame
    reach: float = 6.0  # [σ]
    least: float = 3e-3  # P(touch) below which a pair is no contact

    def __post_init__(self) -> None:
        if min(self.overlap, self.radius_sd, self.margin, self.reach, self.least) < 0:
            raise ValueError("no contact probability setting may be negative")


@dataclass(frozen=True, slots=True)
class BoundarySettings:
    """Which corrections of the boundary are made."""

    camera: bool = True  # estimate the motion of the camera relative to the walls
    continued: bool = True  # extend walls along rods beyond their ends


@dataclass(frozen=True, slots=True)
class CalibrationSettings:
    """Which constant errors are estimated, and their prior standard deviations."""

    pixel_size: float = 5e-3  # relative standard deviation of the given scale; 0: it is exact
    lens: bool = True  # estimate the remaining radial distortion of the lens
    radius_class: float = 1e-3  # relative error common to the rods of one radius class; 0: none
    radius_offset: float = 4e-3  # relative error common to all radii; 0: none
    # Whether radii were measured independently: those from photographs share the scale's error and cannot determine it.
    radii_are_known: bool = True
    radius_factor: float = 2e-2  # relative standard deviation of a factor common to all radii; 0: none
