"""Sections of the experiment file for the material and for the settings of tracking, calibration and solver.

Their defaults are those of the solver's own settings.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from ...solver.bodies.rods import RodMaterial
from ...solver.part_settings import BoundarySettings, CalibrationSettings
from ...solver.sequence.settings import SequenceSettings
from .corrections import SOLID_DENSITIES
from .section import Finite, Frame, Pixels, Section, Switch, above, between, key, whole

RODS, CALIBRATION, SEQUENCE = RodMaterial(), CalibrationSettings(), SequenceSettings()
CHAIN, BOUNDARY = SEQUENCE.chain, BoundarySettings()


class MaterialSection(Section):
    """Properties common to all rods."""

    density: Annotated[float, between(*SOLID_DENSITIES)] = key(
        "Density of the rods.", unit="kg/m³", default=RODS.density
    )
    length: Annotated[float, between(1e-6, 10.0)] = key(
        "Length of the rods, which converts pressures to forces.", unit="m", default=RODS.length
    )
    friction: Annotated[float, above(0, 2)] | Literal["measured"] = key(
        "Coefficient of friction between grains, or measured: found from the motion and used. Of all errors in this "
        "section, too low a friction harms most.",
        default=RODS.friction,
    )
    wall_friction: Annotated[float, between(0, 2)] | None = key(
        "Coefficient of friction at walls; absent: as friction.", default=RODS.wall_friction
    )
    base_friction: Annotated[float, between(0, 1e4)] | Literal["measured"] = key(
        "Coefficient of friction between the rods and the base on which they slide, opposed to the motion of each; "
        "measured: the one whose forces leave least unexplained.",
        default=RODS.base_friction,
    )
    base_gravity: Annotated[float, above(0, 1e6)] = key(
        "Acceleration that presses the rods on the base, normal to the picture.",
        unit="m/s²",
        default=RODS.base_gravity,
    )
    stiffness: Annotated[float, above(0, 1e13)] | Literal["estimate", "rigid"] | None = key(
        "Normal stiffness of a contact per length; estimate: grains are soft, and it is found from their overlaps; "
        "rigid: overlaps are not used; absent: decided by the gaps and, without walls, by the noise of the positions. "
        "The overlap is taken as proportional to the force.",
        unit="Pa",
        default=None,
    )
    formal_weight: Annotated[float, between(0, 0.5)] = key(
        "Formal weight η of the paper, which multiplies impedances by 1 / (1 − η). Change it only to study the method.",
        default=RODS.formal_weight,
    )
    gravity: tuple[Annotated[float, between(-1e4, 1e4)], Annotated[float, between(-1e4, 1e4)]] = key(
        "Gravity in the plane of the photographs, x to the right, y up; zero for rods that lie flat.",
        unit="m/s²",
        default=RODS.gravity,
    )


class TrackingSection(Section):
    """Settings of the tracker."""

    workers: Annotated[int, whole(1, 1024)] | None = key(
        "Threads of the correlation; absent: the number of cores. Their number changes no bit of the results.",
        default=None,
    )
    radius_range: tuple[Pixels, Pixels] | None = key(
        "Range of radii of detected grains when their radii are unknown; absent: any size, from 4 px where small discs "
        "are seen. Narrow it where dirt is detected as grains.",
        unit="px",
        default=None,
    )
    search_window: Annotated[float, above(0, 1e4)] = key(
        "Half width of the widest search for a grain that has jumped. Widen it where grains are lost in an avalanche.",
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

    enabled: Switch = key("Find constant errors and correct them; false: tracks are used as given.", default=True)
    pixel_size: Annotated[float, between(0, 1)] = key(
        "Relative standard deviation of the given scale; 0: it is exact.", default=CALIBRATION.pixel_size
    )
    lens: Switch = key("Find the remaining radial distortion of the lens.", default=CALIBRATION.lens)
    radius_class: Annotated[float, between(0, 1)] = key(
        "Relative standard deviation of the error common to all rods of a radius class; 0: none.",
        default=CALIBRATION.radius_class,
    )
    radius_factor: Annotated[float, between(0, 1)] = key(
        "Relative standard deviation of a factor common to all radii, of tracks in tables or where corner discs "
        "distinguish it from the pixel size; 0: none.",
        default=CALIBRATION.radius_factor,
    )

    camera: Switch = key(
        "Find the camera's motion relative to the walls between photographs, and the distortion of the picture by a "
        "lens or by pixels that are not square; false: neither.",
        default=BOUNDARY.camera,
    )
    walls_continue: Switch = key(
        "Continue walls along rods that touch their line beyond the given ends; false: a wall ends where it is given.",
        default=BOUNDARY.continued,
    )
    resistance: Switch = key(
        "Use another friction of walls, or a base that drags the rods, where the sliding clearly shows them; false: "
        "only as stated. The friction between rods is always as stated.",
        default=True,
    )


class ContactsSection(Section):
    """Settings of the contact detection."""

    threshold_sigmas: Annotated[float, above(0, 1e3)] = key(
        "Gap below which a single chain counts a pair as a contact, in standard deviations of a position. The "
        "ensemble uses contact probabilities instead.",
        unit="σ",
        default=SEQUENCE.threshold_sigmas,
    )
    threshold: Annotated[float, between(-1, 1)] | None = key(
        "The same gap as a length, instead of threshold_sigmas. The ensemble uses contact probabilities instead.",
        unit="m",
        default=SEQUENCE.threshold,
    )
    coordination: Annotated[float, above(0, 12)] | None = key(
        "Change all radii alike until the coordination number without rattlers has this value (the paper: near 4). For "
        "imprecise radii.",
        default=None,
    )
    unseen: Literal["infer", "ignore"] = key(
        "Rods that no photograph shows. infer: added, with a mark, where neighbours require them; ignore: left out.",
        default="infer",
    )
    overlap: Annotated[float, between(0, 1)] | None = key(
        "Typical elastic overlap and roughness of touching surfaces; absent: 3e-4 mean diameters, or measured from the "
        "gaps. A missed contact harms more than a false one.",
        unit="m",
        default=None,
    )


class SolverSection(Section):
    """Settings of the force solver."""

    estimator: Literal["ensemble", "nlgs"] = key(
        "ensemble: mean of two Gauss-Seidel chains and five convex programs, projected onto equilibrium; nlgs: one "
        "chain, much faster and less exact.",
        default=SEQUENCE.estimator,
    )
    preset: Literal["rodsight", "paper"] = key(
        "paper: exactly the method of 2013, one chain with inertia alone, one step per interval, reset to zero.",
        default="rodsight",
    )
    kappa: Annotated[float, above(0, 1e6)] = key(
        "Kinematic number: weight of the measured motion relative to the contact forces. A smaller value gives the "
        "motion less weight.",
        default=CHAIN.kappa,
    )
    substeps: Annotated[int, whole(1, 1000)] = key(
        "Steps of the chain between two photographs.", default=CHAIN.substeps
    )
    spin_up: Annotated[int, whole(1, 10_000)] = key(
        "Steps of the chain where there are no previous forces.", default=CHAIN.spin_up
    )
    sweeps: Annotated[int, whole(1, 1_000_000)] = key(
        "Gauss-Seidel sweeps of a sub-step. They regularise: more sweeps make the forces of a sequence less exact. "
        "Where an ensemble of more than 1200 grains has no previous forces, they grow with the number of grains.",
        default=CHAIN.sweeps,
    )
    relaxation: Annotated[float, Field(strict=True, gt=0, lt=2)] = key(
        "Relaxation factor of every sweep; above 1 it selects another solution.", default=CHAIN.relaxation
    )
    force_change: Annotated[float, above(0, 1)] | None = key(
        "Stop a sub-step when the relative change of the forces is below this, the paper's ε_f; absent: never early.",
        default=CHAIN.force_change,
    )
    workers: Annotated[int, whole(1, 1024)] | None = key(
        "Threads that solve the ensemble members of a frame in parallel; absent: the number of cores. Their number "
        "changes no bit of the results.",
        default=SEQUENCE.workers,
    )
    keep_members: Switch = key("Store the forces of every ensemble member as well.", default=SEQUENCE.keep_members)
    positions: Literal["needed", "always", "never"] = key(
        "When to compute the position-only estimate, a posterior over contacts and forces, and combine it with the "
        "motion estimate. needed: where the motion carries little information, and for soft grains.",
        default=SEQUENCE.positions,
    )
    precision: Literal["measured", "stated"] = key(
        "Which precision of positions to use. measured: that of the gaps of touching rods, where it contradicts the "
        "stated one.",
        default="measured" if SEQUENCE.measure_precision else "stated",
    )
    ensemble_size: Annotated[int, whole(0, 10_000)] = key(
        "Number of sequences solved with resampled inputs for the error bars, as by --ensemble; 0: the free formula.",
        default=0,
    )
    reset: Literal["never", "rearrangement"] = key(
        "When to reset the forces to zero automatically.",
        default="rearrangement" if SEQUENCE.reset_to_zero else "never",
    )
    reset_frames: tuple[Frame, ...] = key(
        "Frames that always start from zero forces, such as those after an interruption of the test.", default=()
    )
    kept_frames: tuple[Frame, ...] = key("Frames that are never reset at a rearrangement.", default=())


class SensitivitySection(Section):
    """Ranges of the factors of the robustness study."""

    ranges: dict[str, tuple[Finite, Finite]] = key(
        "Low and high value of the factors varied by `rodsight sensitivity`, such as friction = [0.7, 1.3].", default={}
    )


class RecordingSection(Section):
    """Settings of the recording."""

    sweeps: Literal["all", "log", "none"] = key(
        "Sweeps whose forces are recorded: log records 1, 2, 4, … of every sub-step; all makes large files, the forces "
        "of further sweeps in steps of 1/256 of the mean f_n.",
        default=CHAIN.keep,
    )


class InferenceSections(Section):
    """The sections for the computation of forces from tracks of any source."""

    material: MaterialSection = key("Properties common to all rods.", default=MaterialSection())
    calibration: CalibrationSection = key("Self-calibration from persistent contacts.", default=CalibrationSection())
    contacts: ContactsSection = key("Settings of the contact detection.", default=ContactsSection())
    solver: SolverSection = key("Settings of the force solver.", default=SolverSection())
    recording: RecordingSection = key("Settings of the recording.", default=RecordingSection())
