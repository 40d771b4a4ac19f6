"""Softness of the grains, decided before calibration: overlaps of soft grains are forces."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from ...solver.assessment.mixture_trust import MAX_TRUST_MEASURED, MAX_TRUST_STATED
from ...solver.bodies.interpolation import interpolate_ignored_frames
from ...solver.bodies.packing import Packing
from ...solver.bodies.rods import RodMaterial
from ...solver.mixture.soft_grains import find_soft_overlap
from ...solver.nlgs.chain import force_scale
from ...solver.posterior.posterior_settings import PosteriorSettings
from ...solver.sequence.settings import SequenceSettings
from ...tracks import Tracks, WallTracks
from ..snapshots import make_snapshots

STIFFNESS_SD = 0.2  # relative standard deviation of a given stiffness


def find_softness(
    material: RodMaterial, settings: SequenceSettings, tracks: Tracks, walls: WallTracks, failed: Collection[int]
) -> SequenceSettings:
    """Adapt the settings to soft grains, as specified or as their gaps show; unchanged for hard grains."""
    if settings.positions == "never" or material.stiffness == "rigid":
        return settings
    pressure = walls.usual_pressure(material.length)
    packing = material.pack(tracks.radius, pressure, boundary=tracks.boundary)
    seen = find_soft_overlap(packing, interpolate_ignored_frames(make_snapshots(tracks, walls), failed))
    # A given stiffness, or the request to estimate it, means soft grains even where too small radii hide the overlaps.
    if not seen and material.stiffness is None:
        return settings
    trust = MAX_TRUST_MEASURED if seen else MAX_TRUST_STATED
    posterior = _stiffness_prior(material, settings, packing)
    return replace(settings, soft=True, measured_overlap=seen, soft_trust=trust, posterior=posterior)


def _stiffness_prior(material: RodMaterial, settings: SequenceSettings, packing: Packing) -> PosteriorSettings:
    """Prior of the overlap per force unit by the given stiffness."""
    posterior = settings.posterior
    if not isinstance(material.stiffness, int | float):
        return posterior
    unit = force_scale(packing, settings.chain)
    overlap = unit / (material.stiffness * material.length) / (2.0 * float(packing.grains.radius.mean()))
    return replace(posterior, compliance=overlap, compliance_sd=STIFFNESS_SD * overlap)
