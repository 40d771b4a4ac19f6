"""Writes the rods in three dimensions, with the strong forces as capsules in front of their ends."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...drawing.frame_caption import caption_of_time, caption_of_trust
from ...solver.bodies.grains import Array
from ...solver.frame_forces import FrameForces
from ...tracks import TrackStatus
from ..look import entities
from ..look.clock import Clock
from ..look.colours import BOUNDARY, INFERRED, INK, LOST, SUSPECT, packed_one
from ..look.level_of_detail import is_outlined
from ..look.printable_text import printable
from ..look.scene import Scene

ALUMINIUM = (34, 39, 48, 255)  # dark, so that forces in front of the rods are visible, also in grey
CHAIN_RADIUS_FRACTION = 0.55  # of the radius of a grain, for a force at the top of the range


def log_rods(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    """Log rods (axis along z, front ends at z = 0) and the contacts that carry more than the mean."""
    clock.end()
    tracks, present = scene.tracks, scene.tracks.frame(clock.frame).present[0]
    position, radius = tracks.position[clock.frame], tracks.radius
    status = tracks.status[clock.frame]
    suspect = status == TrackStatus.SUSPECT
    shade = np.where(suspect, packed_one(SUSPECT), packed_one(ALUMINIUM))
    if tracks.boundary is not None:
        shade = np.where(tracks.boundary, packed_one(BOUNDARY), shade)
    shade = np.where(status == TrackStatus.INFERRED, packed_one(INFERRED), shade)
    shade = np.where(status == TrackStatus.LOST, packed_one(LOST), shade)
    outlined = is_outlined(tracks.grain_count)
    centre = np.column_stack([position, np.full(len(position), -0.5 * scene.rod_length if outlined else 0.0)])
    size = (0.97 * radius[present]).astype(np.float32)  # a dark seam separates the rods
    clock.log(
        entities.RODS,
        rr.Cylinders3D(
            lengths=np.full(int(present.sum()), scene.rod_length, np.float32),
            radii=size,
            centers=centre[present].astype(np.float32),
            colors=shade[present].astype(np.uint32),
            fill_mode=rr.components.FillMode.Solid,
        )
        if outlined
        else rr.Points3D(centre[present].astype(np.float32), radii=size, colors=shade[present].astype(np.uint32)),
    )
    _log_chains(clock, scene, forces)
    _log_caption(clock, scene, forces)


def _log_caption(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    """Log the caption above the rods, with their length as the scale and the range of the forces."""
    top, style = scene.outline(clock.frame), scene.style.range
    place = [float(np.nanmean(top[:, 0])), float(np.nanmax(top[:, 1]) + 3.0 * scene.tracks.radius.max()), 0.0]
    unit, length = scene.force_unit, 1e3 * scene.rod_length
    key = f"rods of {length:g} mm; forces from {style.mean:.3g} {unit} (red) to {style.top:.3g} {unit} (cream)"
    text = f"{caption_of_time(forces, clock.time)}\n{caption_of_trust(forces)}\n{key}"
    clock.log(
        entities.ROD_CAPTION,
        rr.Points3D(
            [place], radii=np.float32(1e-6), colors=packed_one(INK), labels=[printable(text)], show_labels=True
        ),
    )


def _log_chains(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    contacts, style = forces.contacts, scene.style
    strong = np.nan_to_num(forces.fn) > style.range.mean
    start, end = scene.lines(clock.frame, contacts)[strong].transpose(1, 0, 2)
    branch = end - start
    height = np.full(len(start), 0.6 * CHAIN_RADIUS_FRACTION * scene.tracks.radius.max())  # just in front of the ends
    fraction = np.clip(forces.fn[strong] / style.range.top, 0.0, 1.0)
    radius = CHAIN_RADIUS_FRACTION * float(np.mean(scene.tracks.radius)) * fraction
    clock.log(
        entities.ROD_CHAINS,
        rr.Capsules3D(
            lengths=np.linalg.norm(branch, axis=1).astype(np.float32),
            radii=radius.astype(np.float32),
            translations=np.column_stack([start, height]).astype(np.float32),
            quaternions=rotations_from_axis(branch),
            colors=style.colours(forces.fn[strong]),
            fill_mode=rr.components.FillMode.Solid,
        ),
    )  # fmt: skip


def rotations_from_axis(branch: Array) -> NDArray[np.float32]:
    """Return quaternions (c, 4) (x, y, z, w) that rotate the z axis onto branches (c, 2) in the plane z = 0."""
    direction = branch / np.linalg.norm(branch, axis=1)[:, None]
    half = np.sqrt(0.5)  # of a rotation by 90° about (−y, x, 0)
    zero, one = np.zeros(len(branch)), np.ones(len(branch))
    return (half * np.column_stack([-direction[:, 1], direction[:, 0], zero, one])).astype(np.float32)
