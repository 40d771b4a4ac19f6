"""From tracks to what the solver reads: self-calibration, the mechanics of the packing, tuned radii."""

from __future__ import annotations

from dataclasses import dataclass, replace

from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.calibration.calibrate import Calibration
from solver.contacts.radius_tuning import RadiusTuning
from solver.sequence.frame_forces import FrameForces
from solver.statistics.frame_statistics import FrameStatistics, frame_statistics

from ..errors import InputError
from ..experiment.experiment import Experiment, make_packing
from ..tracks import Tracks, WallTracks
from .calibration import calibrate_tracks
from .friction_and_radii import tuned_radii
from .solver_input import typical_overlap


@dataclass(frozen=True, slots=True)
class Prepared:
    """A sequence ready to be solved."""

    packing: Packing
    tracks: Tracks  # as the solver reads them: calibrated, radii tuned
    walls: WallTracks
    overlap: float  # [m] typical, of touching surfaces
    calibration: Calibration | None  # None: not tried
    tuning: RadiusTuning | None  # None: not asked for

    def statistics(self, forces: FrameForces, snapshot: Snapshot) -> FrameStatistics:
        """Statistics of one solved frame; snapshot is the one it was solved from."""
        return frame_statistics(
            forces.contacts, forces.fn, forces.ft, forces.state,
            snapshot.position, snapshot.present, self.packing.walls(snapshot.endpoints), self.packing.length,
            grains=self.packing.grains, material=self.packing.material,
        )  # fmt: skip


def prepare(experiment: Experiment, tracks: Tracks, walls: WallTracks) -> Prepared:
    """Correct tracks as the experiment asks for, and make its packing.

    Raises InputError where the radii cannot be tuned to the coordination number that was asked for.
    """
    overlap = typical_overlap(experiment.config, tracks.radius)
    calibration = tuning = None
    if experiment.config.calibration.enabled:
        tracks, walls, calibration = calibrate_tracks(experiment.config, tracks, walls, overlap)
    packing = make_packing(experiment, tracks.radius, walls.pressure)
    if experiment.config.contacts.coordination is not None:
        tuning = tuned_radii(packing, tracks, walls, experiment.config.contacts.coordination)
        if not tuning.met:
            low, high = tuning.coordination_number.min(), tuning.coordination_number.max()
            problem = f"cannot be met: z goes from {low:.2f} to {high:.2f} as all radii change by up to 4 %"
            raise InputError(experiment.file, f"key contacts.coordination = {tuning.wanted}", problem)
        tracks = replace(tracks, radius=tracks.radius + tuning.found)
        packing = make_packing(experiment, tracks.radius, walls.pressure)
    return Prepared(packing, tracks, walls, overlap, calibration, tuning)
