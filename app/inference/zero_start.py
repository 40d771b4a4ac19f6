"""Forces of single frames swept from zero with the paper's recipe, to show what one photograph alone gives."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..experiment.config.experiment_file import ExperimentFile
from ..results.results import Results
from ..solver.bodies.grains import Array, GrainMotion, Grains
from ..solver.bodies.motion import LastSeen, motion_from, motion_to
from ..solver.bodies.walls import Walls
from ..solver.contacts.contacts import Contacts, detect_contacts
from ..solver.frame_forces import FrameStatus
from ..solver.nlgs.interval import Interval
from ..solver.nlgs.problem import inertial_impedance
from ..solver.nlgs.solve import NlgsSettings, sweeps, to_contact_order
from ..solver.statistics.agreement import compare_forces
from .inference_settings import material_of
from .snapshots import make_snapshots

SWEEPS = 5000
STRIDE = 250  # sweeps between tests of the criterion
FORCE_CHANGE = 1e-2  # ε_f: relative change of every force in a sweep at which the paper stops
REACH_SIGMAS = 2.0  # gap below which a pair touches, in standard deviations of a position: a simple geometric rule


@dataclass(frozen=True, slots=True)
class ZeroStart:
    """Forces of one frame from zero initial forces."""

    frame: int
    contacts: Contacts
    fn: Array  # (c,) [N]
    agreement: float  # correlation of f_n with the reported forces of the frame


@dataclass(frozen=True, slots=True)
class _ThresholdNetwork:
    """Pairs with a gap below a threshold [m]."""

    threshold: float

    def at(self, fraction: float, grains: Grains, state: GrainMotion, walls: Walls) -> tuple[Contacts, Array | None]:
        return detect_contacts(grains, state.position, state.present, walls, self.threshold), None


def solve_from_zero(results: Results, frames: Sequence[int]) -> Iterator[ZeroStart]:
    """Sweep frames from zero forces with the grains' own inertia; frames without forces are left out.

    Parameters
    ----------
    results : Results
        Their tracks, walls and material are used.
    frames : sequence of int

    Yields
    ------
    ZeroStart

    Notes
    -----
    Contacts are the pairs with a gap below two standard deviations of a position. Sweeps end when no force changes by
    more than ε_f = 1e-2 in a sweep, or after 5000.
    """
    material = material_of(ExperimentFile.model_validate(tomllib.loads(results.configuration)))
    tracks, walls = results.tracks, results.walls
    inferred = 0 if tracks.inferred is None else int(tracks.inferred.sum())
    packing = material.pack(tracks.radius, walls.usual_pressure(material.length), inferred, tracks.boundary)
    snapshots = make_snapshots(tracks, walls)
    for k in frames:
        if results.frames[k].status is FrameStatus.FAILED or len(snapshots) < 2:
            continue
        if k == 0:
            motion = motion_from(snapshots[0], snapshots[1])
        else:
            seen = LastSeen.never(packing.grains.count).updated(snapshots[k - 1])
            motion = motion_to(snapshots[k], seen, snapshots[k - 1].time, snapshots[k - 1].endpoints)
        threshold = REACH_SIGMAS * float(np.nanmedian(tracks.sigma[k]))
        impedance = inertial_impedance(packing.grains, interval=motion.interval)
        problem, contacts, _ = Interval(packing, motion, _ThresholdNetwork(threshold)).at(1.0, impedance)
        force = np.zeros((contacts.count, 2))
        for sweep in sweeps(problem, NlgsSettings(), every=STRIDE):
            force = sweep.force
            if sweep.number >= SWEEPS or sweep.force_change < FORCE_CHANGE:
                break
        force = to_contact_order(problem, force)
        reported = results.frames[k]
        given = np.column_stack([reported.fn, reported.ft])
        found = compare_forces(contacts.key, force, reported.contacts.key, given)
        yield ZeroStart(k, contacts, force[:, 0], found.r_fn)
