"""How tracks become forces: the settings of the whole road, and what an experiment file makes of them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from solver.bodies.grains import Array
from solver.bodies.rods import RodMaterial
from solver.boundary.boundary import BoundarySettings
from solver.calibration.settings import CalibrationSettings
from solver.nlgs.chain import ChainSettings
from solver.sequence.settings import SequenceSettings, typical_overlap

from ..experiment.config.experiment_file import ExperimentFile, InferenceSections

FIRST_GUESS = 0.3  # of a friction that is found from the motion


@dataclass(frozen=True, slots=True)
class InferenceSettings:
    """How tracks become forces. The defaults are what `rodsight run` does where nothing is set."""

    sequence: SequenceSettings = field(default_factory=SequenceSettings)
    calibration: CalibrationSettings | None = field(default_factory=CalibrationSettings)  # None: as tracked
    boundary: BoundarySettings | None = field(default_factory=BoundarySettings)  # None: as it was told
    infer_unseen: bool = True  # rods that no photograph shows are put back where they must be
    coordination: float | None = None  # change all radii alike until z without rattlers is this
    overlap: float | None = None  # [m] of touching surfaces; None: 3e-4 mean diameters, or as the gaps show

    def overlap_of(self, radius: Array) -> float:
        """How far touching surfaces of grains of these radii (n,) [m] overlap [m]."""
        return typical_overlap(radius) if self.overlap is None else self.overlap

    def for_overlap(self, overlap: float) -> SequenceSettings:
        """The solver's settings for surfaces that overlap by so much [m]; a given overlap is not measured anew."""
        return replace(self.sequence, overlap=overlap, measure_overlap=self.overlap is None)

    def uncorrected(self) -> InferenceSettings:
        """The same for tracks that are corrected already: neither calibrated nor tuned."""
        return replace(self, calibration=None, boundary=None, infer_unseen=False, coordination=None)

    def without_sweeps(self) -> InferenceSettings:
        """The same where only the final forces are wanted: no sweep keeps its own."""
        return replace(self, sequence=self.sequence.without_sweeps())


def material_of(config: InferenceSections) -> RodMaterial:
    """The rods of an experiment."""
    told = config.material.model_dump()
    if measured := told["friction"] == "measured":
        told["friction"] = FIRST_GUESS
    return RodMaterial(**told, friction_measured=measured)


def settings_of(config: InferenceSections) -> InferenceSettings:
    """The settings of an experiment, or of a call."""
    calibration, contacts = config.calibration, config.contacts
    return InferenceSettings(
        sequence=sequence_settings(config),
        calibration=CalibrationSettings(
            calibration.pixel_size,
            calibration.lens,
            calibration.radius_class,
            _radius_offset(config),
            radii_are_metres(config),
        )
        if calibration.enabled
        else None,
        boundary=BoundarySettings(calibration.camera, calibration.walls_continue),
        infer_unseen=contacts.unseen == "infer",
        coordination=contacts.coordination,
        overlap=contacts.overlap,
    )


def _radius_offset(config: InferenceSections) -> float:
    """How far all radii may be wrong alike, relative; a number that was told is exact."""
    tracks = getattr(config, "tracks", None)
    told = tracks is not None and tracks.radius_offset != "estimate"
    return 0.0 if told else CalibrationSettings().radius_offset


def sequence_settings(config: InferenceSections) -> SequenceSettings:
    """The solver's settings of an experiment, but for the overlap of its surfaces."""
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
    """Whether radii are known by themselves, so that they tell the pixel size.

    Radii that were seen in the photographs share the error of its pixel size and cannot tell it.
    """
    section = config.photographs if isinstance(config, ExperimentFile) else None
    return section is None or (bool(section.radii) and section.grains is None)
