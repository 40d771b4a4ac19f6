"""What the solver reads: tracks, walls and settings in its own terms."""

from __future__ import annotations

from solver.bodies.grains import Array
from solver.bodies.motion import Snapshot
from solver.detection.touch_probability import ContactProbabilitySettings
from solver.nlgs.chain import ChainSettings
from solver.sequence.ensemble import EnsembleSettings
from solver.sequence.frames import SequenceSettings

from ..experiment.config import ExperimentFile
from ..tracks import Tracks, WallTracks

SURFACE = 3e-4  # typical overlap or roughness of touching surfaces in mean diameters


def make_snapshots(tracks: Tracks, walls: WallTracks) -> list[Snapshot]:
    """What the solver reads of tracks and walls."""
    present, sigma = tracks.present, tracks.position_sigma
    return [
        Snapshot(
            float(tracks.time[k]), tracks.position[k], tracks.rotation[k], present[k], walls.endpoints[k],
            float(sigma[k]),
        )
        for k in range(tracks.frame_count)
    ]  # fmt: skip


def typical_overlap(config: ExperimentFile, radius: Array) -> float:
    """How far touching surfaces overlap or stand apart by elasticity and roughness [m]; radius (n,) [m].

    A missed contact costs far more than a false one, so it is rather too large than too small.
    """
    given = config.contacts.overlap
    return SURFACE * 2.0 * float(radius.mean()) if given is None else given


def sequence_settings(config: ExperimentFile, overlap: float) -> SequenceSettings:
    """The solver's settings from the experiment file; overlap [m] of touching surfaces."""
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
        ensemble=EnsembleSettings(probability=ContactProbabilitySettings(overlap=overlap)),
        keep_members=solver.keep_members,
        measure_precision=solver.precision == "measured" and not paper,
        measure_overlap=contacts.overlap is None,
        overlap=overlap,
        threshold_sigmas=contacts.threshold_sigmas,
        threshold=contacts.threshold,
        reset_frames=frozenset(solver.reset_frames),
        kept_frames=frozenset(solver.kept_frames),
        reset_to_zero=paper or solver.reset == "rearrangement",
    )
