"""Correction of a sequence before contacts are found: boundary, noise, softness, calibration, radii, friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...process.errors import UndeterminedError
from ...solver.bodies.interpolation import interpolate_ignored_frames
from ...solver.bodies.motion import Snapshot
from ...solver.bodies.packing import Packing
from ...solver.bodies.rods import RodMaterial
from ...solver.contacts.radius_tuning import RadiusTuning
from ...solver.convex.friction_check import WallFriction
from ...solver.detection.touch_probability import ContactProbabilitySettings
from ...solver.sequence.failure import find_unseen
from ...tracks import Tracks, WallTracks
from ..corrected_sequence import CorrectedSequence
from ..inputs import InferenceSettings, Inputs
from ..snapshots import make_snapshots
from .boundary import correct_camera, correct_walls, measure_noise
from .calibration import calibrate_tracks, known_radii, own_gap_error, radius_classes
from .close_photographs import choose_span, count_alike
from .friction import measure_friction, measure_resisting, refine_wall_friction, tuned_radii, use_unstated
from .radii import calibrate_with_radii, correct_exchanged_sizes, use_size_classes
from .soft_grain_errors import correct_soft_grains
from .softness import assume_softness, find_softness
from .tables.outliers import remove_outliers, restore_exchanged_ids
from .tables.rotations import correct_rotations
from .tables.short_gaps import interpolate_short_gaps
from .tables.wall_places import correct_wall_places
from .tables.wall_scatter import correct_wall_scatter
from .tables.wall_times import correct_wall_times
from .tables.walls_at_rest import correct_walls_at_rest
from .unseen import add_unseen

# Corrections that the first frame reports, in this order.
REMARKS = (
    "outliers", "gaps", "camera", "noise", "span", "size_classes", "softness", "resistance", "sizes", "ids",
    "rotations", "times", "rest", "scatter", "places",
)  # fmt: skip


class CoordinationError(UndeterminedError):
    """No change of the radii gives the requested coordination number."""

    def __init__(self, tuning: RadiusTuning) -> None:
        low, high = tuning.coordination_number.min(), tuning.coordination_number.max()
        super().__init__(f"cannot be met: z goes from {low:.2f} to {high:.2f} as all radii change by up to 4 %")
        self.key = f"contacts.coordination = {tuning.wanted}"


def correct_sequence(inputs: Inputs) -> CorrectedSequence:
    """Correct tracks, walls and radii as the settings request, and measure what is not given.

    Parameters
    ----------
    inputs : Inputs

    Returns
    -------
    CorrectedSequence

    Raises
    ------
    UndeterminedError
        A requested friction coefficient or coordination number cannot be determined.
    """
    settings = inputs.settings
    tracks, walls, failed, from_tables = _correct_tables(inputs)
    given_radius, nothing_seen = tracks.radius, len(failed) == tracks.frame_count
    if nothing_seen:
        settings = replace(settings, boundary=None, calibration=None, coordination=None)
    overlap, as_given, hidden = settings.overlap_of(tracks.radius), settings.calibration is None, False
    calibration = tuning = boundary = lens = None
    material = inputs.material
    remarks = dict.fromkeys(REMARKS, "") | from_tables
    if settings.calibration is not None:
        if settings.sequence.uses_positions:
            material, remarks["softness"] = assume_softness(material, tracks, walls, failed)
        if material.stiffness not in (None, "rigid"):
            tracks, remarks["size_classes"] = use_size_classes(tracks, soft=True)
    if settings.boundary is not None:
        if inputs.seeks_distortion:
            tracks, walls, remarks["camera"], lens = correct_camera(
                material, tracks, walls, failed, radii_known=settings.radii_are_known
            )
        if not nothing_seen:
            walls, remarks["places"] = correct_wall_places(tracks, walls)
        if settings.sequence.measure_precision:
            tracks, remarks["noise"] = measure_noise(tracks, walls)
        tracks, walls, boundary = correct_walls(settings.boundary, tracks, walls)
    if settings.calibration is not None:
        sequence, hidden = find_softness(material, settings.sequence, tracks, walls, failed)
        if sequence.uses_positions and not remarks["size_classes"]:  # readings show whether grains are soft
            tracks, remarks["size_classes"] = use_size_classes(tracks, soft=sequence.soft)
        # Overlaps of soft grains are forces: calibration would remove them as errors.
        settings = replace(settings, sequence=sequence, calibration=None if sequence.soft else settings.calibration)
    if settings.calibration is not None:
        observed = settings.calibration, tracks, walls, overlap, failed
        if settings.sequence.uses_positions:
            tracks, walls, calibration = calibrate_with_radii(material, *observed)
        else:
            tracks, walls, calibration = calibrate_tracks(*observed)
        if calibration is not None:
            corrected_gap = own_gap_error(calibration, radius_classes(given_radius))
            settings = replace(settings, sequence=replace(settings.sequence, corrected_gap=corrected_gap))
    if not nothing_seen:  # calibration has measured the noise that hides the sliding
        span, remarks["span"] = choose_span(tracks)
        alike = span if settings.sequence.soft else max(span, count_alike(tracks))
        settings = replace(settings, sequence=replace(settings.sequence, span=span, alike=alike))
    if settings.infer_unseen:
        tracks = add_unseen(tracks, walls, known_radii(given_radius), settings.sequence.measured_overlap)
        sequence = replace(settings.sequence, unseen_sought=tracks.inferred is not None)
        settings = replace(settings, sequence=sequence)
        calibration = None if calibration is None else calibration.of_grains(tracks.grain_count)
    packing = _pack(material, tracks, walls)
    if settings.coordination is not None:
        tuning = tuned_radii(packing, tracks, walls, settings.coordination, failed)
        if not tuning.met:
            raise CoordinationError(tuning)
        tracks = replace(tracks, radius=tracks.radius + tuning.found)
        packing = _pack(material, tracks, walls)
    snapshots, of_walls = make_snapshots(tracks, walls), None
    seen = snapshots if nothing_seen else interpolate_ignored_frames(snapshots, failed)
    if not nothing_seen:
        probability = settings.for_overlap(overlap).for_radii(tracks.radius).ensemble.probability
        material, of_walls, remarks["resistance"] = _measure_friction(
            settings, material, tracks, walls, seen, probability
        )
        packing = _pack(material, tracks, walls)
    corrected = CorrectedSequence(
        packing, tracks, walls, seen,
        settings.for_overlap(overlap), inputs.verdicts, calibration, tuning, boundary, failed,
        inputs.material.base_gravity, of_walls, inputs.material.friction_measured,
        "; ".join(filter(None, remarks.values())), lens, bool(from_tables["outliers"]), hidden,
    )  # fmt: skip
    return corrected if as_given or nothing_seen or tuning is not None else correct_soft_grains(corrected)


def _correct_tables(inputs: Inputs) -> tuple[Tracks, WallTracks, dict[int, str], dict[str, str]]:
    """Correct what the tables of rods and walls confuse; also return unusable photographs, and what was done."""
    tracks, ids = restore_exchanged_ids(inputs.tracks)
    walls, failed = complete_walls(tracks, inputs.walls)
    done = {"ids": ids}
    if len(failed) < tracks.frame_count:
        if inputs.settings.calibration is not None:
            tracks, wrong = correct_rotations(tracks, walls)
            done["rotations"] = "; ".join(filter(None, (each.describe() for each in wrong)))
        if inputs.settings.boundary is not None:
            walls, done["times"] = correct_wall_times(tracks, walls)
            walls, resting = correct_walls_at_rest(tracks, walls)
            done["rest"] = "; ".join(each.evidence for each in resting if each.corrected)
            walls, done["scatter"] = correct_wall_scatter(tracks, walls)
        if inputs.settings.calibration is not None:
            tracks, done["sizes"] = correct_exchanged_sizes(tracks, walls)
    tracks, done["outliers"] = remove_outliers(tracks, walls, inputs.placed)
    tracks, done["gaps"] = interpolate_short_gaps(tracks, walls)
    return tracks, walls, failed, done


def _pack(material: RodMaterial, tracks: Tracks, walls: WallTracks) -> Packing:
    inferred = 0 if tracks.inferred is None else int(tracks.inferred.sum())
    return material.pack(tracks.radius, walls.usual_pressure(material.length), inferred, tracks.boundary)


def _measure_friction(
    settings: InferenceSettings,
    material: RodMaterial,
    tracks: Tracks,
    walls: WallTracks,
    seen: Sequence[Snapshot],
    probability: ContactProbabilitySettings,
) -> tuple[RodMaterial, WallFriction | None, str]:
    """Measure the friction that is requested, and use one that is not stated but that the sliding shows.

    Returns
    -------
    RodMaterial
        With the coefficients to use.
    WallFriction or None
        Measured at walls; None: given, or as between rods.
    str
        What is used although it is not stated; empty: nothing.
    """
    of_walls, remark, workers = None, "", settings.sequence.workers
    if settings.resistance and not settings.sequence.soft:
        stated = material.wall_friction
        material, remark = use_unstated(material, _pack(material, tracks, walls), seen, probability, workers)
        if material.wall_friction != stated:
            packing = _pack(material, tracks, walls)
            of_walls = refine_wall_friction(material, packing, seen, probability, workers)
    if material.friction_measured or material.base_friction_measured:
        given_at_walls = material.wall_friction is not None
        material = measure_resisting(material, _pack(material, tracks, walls), seen, probability, workers)
        if material.friction_measured:
            material = measure_friction(material, _pack(material, tracks, walls), seen, probability, workers)
            if not given_at_walls:
                packing = _pack(material, tracks, walls)
                of_walls = refine_wall_friction(material, packing, seen, probability, workers)
            if of_walls is not None:
                material = replace(material, wall_friction=of_walls.measured)
    return material, of_walls, remark


def complete_walls(tracks: Tracks, walls: WallTracks) -> tuple[WallTracks, dict[int, str]]:
    """Interpolate the walls of unusable photographs; also return these, with the reason.

    The walls stay as they are where no photograph is usable.
    """
    given = make_snapshots(tracks, walls)
    failed = find_unseen(given) | tracks.failed
    if len(failed) == tracks.frame_count:
        return walls, failed
    endpoints = np.stack([each.endpoints for each in interpolate_ignored_frames(given, failed)])
    return replace(walls, endpoints=endpoints), failed
