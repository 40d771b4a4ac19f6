"""The macroscopic quantities of one frame, gathered from stress, fabric and connectivity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.boundaries import Walls
from solver.connectivity import coordination_number, rattlers
from solver.contacts import Contacts
from solver.fabric import contact_fabric, fabric_anisotropy
from solver.frame_forces import ContactState
from solver.grains import Array
from solver.stress import (
    friction_angle,
    love_weber_stress,
    packing_area,
    principal_stresses,
    wall_forces,
    wall_ratio_angle,
)


@dataclass(frozen=True, slots=True)
class FrameStatistics:
    area: float  # [m²] of the polygon between the walls
    stress: Array  # (2, 2) [Pa] Love-Weber, compression positive
    pressure: float  # [Pa] half the trace
    friction_angle: float  # [rad] asin((σ₁−σ₂)/(σ₁+σ₂))
    wall_ratio_angle: float  # [rad] atan(|T|/N) on the loaded plate, NaN without one
    principal_direction: float  # [rad] of σ₁, in (−π/2, π/2]
    coordination_number: float  # contacts with force per grain, walls counted once
    coordination_number_without_rattlers: float
    rattler_count: int
    contact_count: int  # carrying force
    sliding_fraction: float  # of the contacts carrying force
    mean_fn: float  # [N] over contacts carrying force
    max_fn: float  # [N]
    fabric: Array  # (2, 2) mean n⊗n over contacts carrying force
    fabric_anisotropy: float  # 2 (F₁ − F₂)


def frame_statistics(
    contacts: Contacts,
    fn: Array,
    ft: Array,
    state: NDArray[np.uint8],
    position: Array,
    present: NDArray[np.bool_],
    walls: Walls,
    length: float,
) -> FrameStatistics:
    """Gather the statistics of one frame.

    fn, ft (c,) [N]; state (c,) ContactState; position (n, 2) [m]; present (n,); length of the rods [m].
    """
    bearing = fn > 0
    area = packing_area(walls, position[present])
    stress = love_weber_stress(contacts, fn, ft, position, area, length)
    fabric = contact_fabric(contacts.normal[bearing])
    return FrameStatistics(
        area=area,
        stress=stress,
        pressure=0.5 * float(np.trace(stress)),
        friction_angle=friction_angle(stress),
        wall_ratio_angle=wall_ratio_angle(walls, wall_forces(contacts, fn, ft)),
        principal_direction=principal_stresses(stress)[2],
        coordination_number=coordination_number(contacts, bearing, present),
        coordination_number_without_rattlers=coordination_number(contacts, bearing, present, without_rattlers=True),
        rattler_count=int(rattlers(contacts, bearing, present).sum()),
        contact_count=int(bearing.sum()),
        sliding_fraction=float(np.mean(state[bearing] == ContactState.SLIDING)) if bearing.any() else 0.0,
        mean_fn=float(fn[bearing].mean()) if bearing.any() else 0.0,
        max_fn=float(fn.max(initial=0.0)),
        fabric=fabric,
        fabric_anisotropy=fabric_anisotropy(fabric),
    )
