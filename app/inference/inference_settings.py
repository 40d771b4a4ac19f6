"""Settings of the inference from tracks to forces, with defaults and by experiment file."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from ..experiment.config.experiment_file import ExperimentFile, InferenceSections
from ..solver.bodies.grains import Array
from ..solver.bodies.rods import RodMaterial
from ..solver.contacts.surface import typical_overlap
from ..solver.part_settings import BoundarySettings, CalibrationSettings, ChainSettings
from ..solver.sequence.settings import SequenceSettings

FIRST_GUESS = 0.3  # of a friction that is measured from the motion


@dataclass(frozen=True, slots=True)
class InferenceSettings:
    """Settings of the inference; the defaults are those of `rodsight run`."""

    sequence: SequenceSettings = field(default_factory=SequenceSettings)
    calibration: CalibrationSettings | None = field(default_factory=CalibrationSettings)  # None: as tracked
    boundary: BoundarySettings | None = field(default_factory=BoundarySettings)  # None: as given
    resistance: bool = True  # use a friction of walls or base that is not stated but that the sliding clearly shows
    infer_unseen: bool = True  # add rods that no photograph shows where their neighbours require them
    coordination: float | None = None  # target of z without rattlers, reached by an equal change of all radii
    overlap: float | None = None  # [m] of touching surfaces; None: 3e-4 mean diameters, or as measured from the gaps

    @property
    def radii_are_known(self) -> bool:
        """Whether the radii are exact, and give the pixel size; not without calibration."""
        return self.calibration is not None and self.calibration.radii_are_known

    def overlap_of(self, radius: Array) -> float:
        """Overlap of touching surfaces [m] for grains of these radii (n,) [m]."""
        return typical_overlap(radius) if self.overlap is None else self.overlap

    def for_overlap(self, overlap: float) -> SequenceSettings:
        """Settings of the sequence for this overlap [m]; a given overlap is not measured."""
        return replace(self.sequence, overlap=overlap, measure_overlap=self.overlap is None)

    def uncorrected(self) -> InferenceSettings:
        """The same settings for tracks that are corrected already: without calibration and tuning."""
        return replace(self, calibration=None, boundary=None, resistance=False, infer_unseen=False, coordination=None)

    def without_sweeps(self) -> InferenceSettings:
        """The same settings without recorded sweeps."""
        return replace(self, sequence=self.sequence.without_sweeps())


def material_of(config: InferenceSections) -> RodMaterial:
    """Material of the rods of an experiment."""
    given = config.material.model_dump()
    if measured := given["friction"] == "measured":
        given["friction"] = FIRST_GUESS
    if base_measured := given["base_friction"] == "measured":
        given["base_friction"] = 0.0
    return RodMaterial(**given, friction_measured=measured, base_friction_measured=base_measured)


def settings_of(config: InferenceSections) -> InferenceSettings:
    """Settings of an experiment, or of a call."""
    calibration, contacts = config.calibration, config.contacts
    return InferenceSettings(
        sequence=sequence_settings(config),
        calibration=CalibrationSettings(
            calibration.pixel_size,
            calibration.lens,
            calibration.radius_class,
            _radius_offset(config),
            radii_are_metres(config),
            _radius_factor(config),
        )
        if calibration.enabled
        else None,
        boundary=BoundarySettings(calibration.camera, calibration.walls_continue),
        resistance=calibration.enabled and calibration.resistance,
        infer_unseen=contacts.unseen == "infer",
        coordination=contacts.coordination,
        overlap=contacts.overlap,
    )


def _radius_offset(config: InferenceSections) -> float:
    """Relative standard deviation of the common error of all radii; zero for a given number."""
    tracks = getattr(config, "tracks", None)
    given = tracks is not None and tracks.radius_offset != "estimate"
    return 0.0 if given else CalibrationSettings().radius_offset


def _radius_factor(config: InferenceSections) -> float:
    """Relative standard deviation of a factor of all radii; zero where their offset is given.

    Radii that photographs were scaled by determine the pixel size, unless corner discs show which of both is wrong.
    """
    if _radius_offset(config) == 0.0:
        return 0.0
    tables = not isinstance(config, ExperimentFile) or config.photographs is None
    discs = isinstance(config, ExperimentFile) and config.walls is not None and config.walls.corners is not None
    return config.calibration.radius_factor if tables or discs else 0.0


def sequence_settings(config: InferenceSections) -> SequenceSettings:
    """Settings of the sequence of an experiment, without the overlap of its surfaces."""
    solver, contacts = config.solver, config.contacts
    paper = solver.preset == "paper"
    chain = ChainSettings(
        kappa=None if paper else solver.kappa,
        substeps=1 if paper else solver.substeps,
        spin_up=1 if paper else solver.spin_up,
        sweeps=solver.sweeps * (solver.substeps if paper else 1),
        relaxation=solver.relaxation,
        force_change=solver.force_change,
        keep=config.recording.sweeps,
    )
    return SequenceSettings(
        estimator="nlgs" if paper else solver.estimator,
        chain=chain,
        workers=solver.workers,
        keep_members=solver.keep_members,
        positions=solver.positions,
        measure_precision=solver.precision == "measured" and not paper,
        threshold_sigmas=contacts.threshold_sigmas,
        threshold=contacts.threshold,
        reset_frames=frozenset(solver.reset_frames),
        kept_frames=frozenset(solver.kept_frames),
        reset_to_zero=paper or solver.reset == "rearrangement",
    )


def radii_are_metres(config: InferenceSections) -> bool:
    """Whether radii are known independently of the photographs, so that they determine the pixel size.

    Radii that were measured in the photographs have the error of the pixel size in common with it.
    """
    section = config.photographs if isinstance(config, ExperimentFile) else None
    return section is None or (bool(section.radii) and section.grains is None)
