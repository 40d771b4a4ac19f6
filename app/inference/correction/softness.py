"""Softness of the grains, decided before calibration: overlaps of soft grains are forces."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from ...solver.bodies.packing import Packing
from ...solver.bodies.rods import RodMaterial
from ...solver.mixture.soft_grains import judge_gaps
from ...solver.nlgs.chain import force_scale
from ...solver.part_settings import MAX_TRUST_MEASURED, MAX_TRUST_STATED
from ...solver.posterior.posterior_settings import PosteriorSettings
from ...solver.posterior.sequence_evidence import gather_position_evidence
from ...solver.sequence.settings import SequenceSettings
from ...tracks import Tracks, WallTracks
from ..snapshots import pack_seen
from .radii import find_wrong_sizes

STIFFNESS_SD = 0.2  # relative standard deviation of a given stiffness
# Noise of a position over the mean diameter, above which the motion of hard rods without walls shows no more forces
# than their positions do. Overlaps as forces against calibrated gaps, r of sheared hard rods without walls (two seeds):
# .88 against .92 at a noise of .0006, .70 against .73 at .003, .65 against .63 at .007.
BLURRED = 0.005


def assume_softness(
    material: RodMaterial, tracks: Tracks, walls: WallTracks, failed: Collection[int]
) -> tuple[RodMaterial, str]:
    """Let overlaps be evidence of forces where neither walls nor the motion determine them.

    Overlaps of soft grains may be hidden by radii that are read too small, so that no gap shows them. Without walls,
    and with positions too noisy for the motion to show forces, nothing is lost by reading gaps as those of soft grains,
    whether they are soft or hard.

    Returns
    -------
    RodMaterial
        With the stiffness "estimate" where it is assumed; otherwise the given one.
    str
        A sentence on the assumption; empty: none.
    """
    given = material.stiffness is not None or walls.count > 0 or walls.cell is not None
    if given or tracks.grain_count == 0 or len(failed) == tracks.frame_count:
        return material, ""
    try:
        evidence = gather_position_evidence(*pack_seen(material, tracks, walls, failed))
    except ValueError:  # no two bodies are near
        return material, ""
    noise = evidence.noise.sigma / (2.0 * float(tracks.radius.mean()))
    if noise < BLURRED:
        return material, ""
    sentence = (
        f"positions vary by {100 * noise:.2g} % of a diameter from photograph to photograph, so that the motion shows "
        'little: overlaps are read as forces of soft grains (if they are hard: material.stiffness = "rigid")'
    )
    return replace(material, stiffness="estimate"), sentence


def find_softness(
    material: RodMaterial, settings: SequenceSettings, tracks: Tracks, walls: WallTracks, failed: Collection[int]
) -> tuple[SequenceSettings, bool]:
    """Adapt the settings to soft grains, as specified or as their gaps show; unchanged for hard grains.

    Also return whether errors may hide that grains are soft.
    """
    if settings.positions == "never" or material.stiffness == "rigid":
        return settings, False
    packing, snapshots = pack_seen(material, tracks, walls, failed)
    seen, hidden = judge_gaps(packing, snapshots)
    # A given stiffness, or the request to estimate it, means soft grains even where too small radii hide the overlaps.
    if material.stiffness is None:
        wrong_sizes = bool((seen or hidden) and find_wrong_sizes(tracks, walls, failed))
        if not seen or wrong_sizes:
            return settings, hidden and not wrong_sizes
    trust = MAX_TRUST_MEASURED if seen else MAX_TRUST_STATED
    posterior = _stiffness_prior(material, settings, packing)
    return replace(settings, soft=True, measured_overlap=seen, soft_trust=trust, posterior=posterior), False


def _stiffness_prior(material: RodMaterial, settings: SequenceSettings, packing: Packing) -> PosteriorSettings:
    """Prior of the overlap per force unit by the given stiffness."""
    posterior = settings.posterior
    if not isinstance(material.stiffness, int | float):
        return posterior
    unit = force_scale(packing, settings.chain)
    overlap = unit / (material.stiffness * material.length) / (2.0 * float(packing.grains.radius.mean()))
    return replace(posterior, compliance=overlap, compliance_sd=STIFFNESS_SD * overlap)
