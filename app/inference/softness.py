"""Whether the grains are soft, before anything is calibrated: overlaps of soft grains are forces."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from solver.bodies.bridging import bridge_frames
from solver.bodies.packing import Packing
from solver.bodies.rods import RodMaterial
from solver.mixture.softness import SEEN_AT_MOST, TOLD_AT_MOST, find_overlap
from solver.nlgs.chain import force_scale
from solver.posterior.settings import PosteriorSettings
from solver.sequence.settings import SequenceSettings

from ..tracks import Tracks, WallTracks
from .snapshots import make_snapshots

STIFFNESS_DOUBT = 0.2  # share by which a stiffness that was told may be wrong


def find_softness(
    material: RodMaterial, settings: SequenceSettings, tracks: Tracks, walls: WallTracks, failed: Collection[int]
) -> SequenceSettings:
    """The settings as they are for grains that are hard, or soft by what was told of them and by their gaps."""
    if settings.positions == "never" or material.stiffness == "rigid":
        return settings
    pressure = walls.usual_pressure(material.length)
    packing = material.pack(tracks.radius, pressure, boundary=tracks.boundary)
    seen = find_overlap(packing, bridge_frames(make_snapshots(tracks, walls), failed))
    # Who tells a stiffness, or to estimate it, knows that grains are soft: where all radii are read too small no gap
    # shows it.
    if not seen and material.stiffness is None:
        return settings
    trust = SEEN_AT_MOST if seen else TOLD_AT_MOST
    posterior = _told(material, settings, packing)
    return replace(settings, soft=True, overlap_seen=seen, soft_trust=trust, posterior=posterior)


def _told(material: RodMaterial, settings: SequenceSettings, packing: Packing) -> PosteriorSettings:
    """What is thought of the overlap per force unit before the gaps are looked at."""
    posterior = settings.posterior
    if not isinstance(material.stiffness, int | float):
        return posterior
    unit = force_scale(packing, settings.chain)
    overlap = unit / (material.stiffness * material.length) / (2.0 * float(packing.grains.radius.mean()))
    return replace(posterior, stiffness=overlap, stiffness_sd=STIFFNESS_DOUBT * overlap)
