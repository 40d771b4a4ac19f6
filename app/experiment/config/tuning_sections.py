"""Sections of the experiment file that say what the rods are and how they are treated.

The solver's own settings hold their defaults; these keys take them from there.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from solver.bodies.rods import RodMaterial
from solver.boundary.boundary import BoundarySettings
from solver.calibration.settings import CalibrationSettings
from solver.sequence.settings import SequenceSettings

from .section import Finite, Frame, Pixels, Section, Switch, above, between, key, whole

RODS, CALIBRATION, SEQUENCE = RodMaterial(), CalibrationSettings(), SequenceSettings()
CHAIN, BOUNDARY = SEQUENCE.chain, BoundarySettings()


class MaterialSection(Section):
    """What all rods have in common."""

    density: Annotated[float, between(1, 3e4)] = key("Density of the rods.", unit="kg/m³", default=RODS.density)
    length: Annotated[float, between(1e-6, 1e3)] = key(
        "Length of the rods, by which pressures become forces.", unit="m", default=RODS.length
    )
    friction: Annotated[float, above(0, 2)] | Literal["measured"] = key(
        "Coefficient of friction between grains, or measured: found from the motion and used. Too low a friction is "
        "the worst error you can make here.",
        default=RODS.friction,
    )
    wall_friction: Annotated[float, between(0, 2)] | None = key(
        "Coefficient of friction at walls; absent: as friction.", default=RODS.wall_friction
    )
    stiffness: Annotated[float, above(0, 1e13)] | Literal["estimate", "rigid"] | None = key(
        "Normal stiffness of a contact per length; estimate: grains are soft, and their overlaps tell it; rigid: "
        "overlaps say nothing; absent: as the gaps show. The overlap is taken as proportional to the force.",
        unit="Pa",
        default=None,
    )
    formal_weight: Annotated[float, between(0, 0.5)] = key(
        "Formal weight η of the paper: impedances grow by 1 / (1 − η). Leave it unless you study the method.",
        default=RODS.formal_weight,
    )
    gravity: tuple[Annotated[float, between(-1e4, 1e4)], Annotated[float, between(-1e4, 1e4)]] = key(
        "Gravity in the plane of the photographs, x to the right, y up; rods that lie flat have none.",
        unit="m/s²",
        default=RODS.gravity,
    )


class TrackingSection(Section):
    """Tuning of the tracker."""

    workers: Annotated[int, whole(1, 1024)] | None = key(
        "Threads that correlate; absent: as many as there are cores. Their number changes no bit of the results.",
        default=None,
    )
    radius_range: tuple[Pixels, Pixels] | None = key(
        "Radii of grains looked for when they are not known; absent: any size, from 4 px where small discs are seen. "
        "Narrow it where dirt is taken for grains.",
        unit="px",
        default=None,
    )
    search_window: Annotated[float, above(0, 1e4)] = key(
        "Half width of the widest search for a grain that has jumped. Widen it where an avalanche loses grains.",
        unit="px",
        default=60.0,
    )

    @model_validator(mode="after")
    def _ascending(self) -> TrackingSection:
        if self.radius_range is not None and not 3.0 < self.radius_range[0] < self.radius_range[1]:
            raise ValueError(f"radius_range value {list(self.radius_range)!r}: must ascend and exceed 3 px")
        return self


class CalibrationSection(Section):
    """Self-calibration of centres, radii, walls and pixel size from persistent contacts."""

    enabled: Switch = key(
        "Look for constant errors and correct them; false: tracks are taken as they are.", default=True
    )
    pixel_size: Annotated[float, between(0, 1)] = key(
        "Relative standard deviation of the given scale; 0: it is exact.", default=CALIBRATION.pixel_size
    )
    lens: Switch = key("Look for what is left of the lens's radial distortion.", default=CALIBRATION.lens)
    radius_class: Annotated[float, between(0, 1)] = key(
        "Relative error that the rods of a known radius may share; 0: none.", default=CALIBRATION.radius_class
    )

    camera: Switch = key(
        "Let the camera move against the walls from photograph to photograph; false: it stood still.",
        default=BOUNDARY.camera,
    )
    walls_continue: Switch = key(
        "Continue walls along rods that bear on their line beyond the ends told; false: a wall really ends there.",
        default=BOUNDARY.continued,
    )


class ContactsSection(Section):
    """Tuning of contact detection."""

    threshold_sigmas: Annotated[float, above(0, 1e3)] = key(
        "Gap below which a single chain takes a pair for a contact, in standard deviations of a position. The "
        "ensemble weighs probabilities instead.",
        unit="σ",
        default=SEQUENCE.threshold_sigmas,
    )
    threshold: Annotated[float, between(-1, 1)] | None = key(
        "The same gap as a length, in place of threshold_sigmas. The ensemble weighs probabilities instead.",
        unit="m",
        default=SEQUENCE.threshold,
    )
    coordination: Annotated[float, above(0, 12)] | None = key(
        "Change all radii alike until the coordination number without rattlers is this (the paper: near 4). For radii "
        "that are known badly.",
        default=None,
    )
    unseen: Literal["infer", "ignore"] = key(
        "Rods that no photograph shows. infer: put back, marked, where neighbours hold them; ignore: left out.",
        default="infer",
    )
    overlap: Annotated[float, between(0, 1)] | None = key(
        "Typical elastic overlap and roughness of touching surfaces; absent: 3e-4 mean diameters, or what the gaps "
        "show. A missed contact costs more than a false one.",
        unit="m",
        default=None,
    )


class SolverSection(Section):
    """Tuning of the force solver."""

    estimator: Literal["ensemble", "nlgs"] = key(
        "ensemble: two Gauss-Seidel chains and five convex programs, brought into balance; nlgs: one chain, much "
        "faster and less exact.",
        default=SEQUENCE.estimator,
    )
    preset: Literal["rodsight", "paper"] = key(
        "paper: the recipe of 2013 to the letter, one chain with inertia alone, one step per interval, reset to zero.",
        default="rodsight",
    )
    kappa: Annotated[float, above(0, 1e6)] = key(
        "Kinematic number: how much the measured motion weighs against the contact forces. Smaller trusts it less.",
        default=CHAIN.kappa,
    )
    substeps: Annotated[int, whole(1, 1000)] = key(
        "Steps of the chain between two photographs.", default=CHAIN.substeps
    )
    spin_up: Annotated[int, whole(1, 10_000)] = key(
        "Steps of the chain where there are no former forces.", default=CHAIN.spin_up
    )
    sweeps: Annotated[int, whole(1, 1_000_000)] = key(
        "Gauss-Seidel sweeps of a sub-step. They regularise: more of them make the forces of a sequence worse.",
        default=CHAIN.sweeps,
    )
    relaxation: Annotated[float, Field(strict=True, gt=0, lt=2)] = key(
        "Factor of every sweep's correction; above 1 it selects another solution.", default=CHAIN.relaxation
    )
    force_change: Annotated[float, above(0, 1)] | None = key(
        "Stop a sub-step when the forces change by less than this share, the paper's ε_f; absent: never early.",
        default=CHAIN.force_change,
    )
    workers: Annotated[int, whole(1, 1024)] | None = key(
        "Threads that solve members of a frame side by side; absent: as many as there are cores. Their number changes "
        "no bit of the results.",
        default=SEQUENCE.workers,
    )
    keep_members: Switch = key("Store the forces of every member of the ensemble, too.", default=SEQUENCE.keep_members)
    positions: Literal["needed", "always", "never"] = key(
        "When positions alone are asked, by a posterior over contacts and forces, and mixed with what the motion says. "
        "needed: where the motion says little, and of soft grains.",
        default=SEQUENCE.positions,
    )
    precision: Literal["measured", "stated"] = key(
        "Which precision of positions to believe: measured, where the gaps of touching rods contradict what is stated.",
        default="measured" if SEQUENCE.measure_precision else "stated",
    )
    ensemble_size: Annotated[int, whole(0, 10_000)] = key(
        "Sequences solved again with resampled inputs for the error bars, as --ensemble does; 0: the free formula.",
        default=0,
    )
    reset: Literal["never", "rearrangement"] = key(
        "When to go back to zero forces by itself.", default="rearrangement" if SEQUENCE.reset_to_zero else "never"
    )
    reset_frames: tuple[Frame, ...] = key(
        "Frames that start from zero forces whatever is found: after an interruption of the test.", default=()
    )
    kept_frames: tuple[Frame, ...] = key("Frames that are never reset at a rearrangement.", default=())


class SensitivitySection(Section):
    """Ranges of the robustness study, by factor."""

    ranges: dict[str, tuple[Finite, Finite]] = key(
        "Low and high value of factors that `rodsight sensitivity` varies, such as friction = [0.7, 1.3].", default={}
    )


class RecordingSection(Section):
    """Tuning of the recording."""

    sweeps: Literal["all", "log", "none"] = key(
        "Sweeps whose forces are kept: log keeps 1, 2, 4, … of every sub-step, all is large.", default=CHAIN.keep
    )
