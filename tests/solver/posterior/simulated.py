"""A small simulated packing in simple shear, photographed with noise, and its true forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rodsight.solver.bodies.grains import Array
from rodsight.solver.bodies.motion import Snapshot
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.contacts.pairs import Keys, make_keys
from rodsight.solver.dem.dem_truth import DemFrame, DemSettings
from rodsight.solver.dem.shear_cell import shear_photographs
from rodsight.synthetic.dense_packing import prepare_packing

NOISE = 1e-5  # [m]
GRAINS = 150


@dataclass(frozen=True)
class SimulatedShear:
    packing: Packing
    snapshots: list[Snapshot]
    frames: list[DemFrame]

    def truth(self, k: int) -> tuple[Keys, Array]:
        """Keys (c,) and forces (c, 2) [N] of frame k."""
        frame = self.frames[k]
        bodies = self.packing.grains.count + len(frame.endpoints)
        return make_keys(frame.i, frame.j, bodies), np.column_stack([frame.fn, frame.ft])


def simulate_shear(step_degrees: float, frames: int, normal_stiffness: float = 2e7) -> SimulatedShear:
    """Shear a packing by step_degrees [°] from photograph to photograph; stiffness [N/m]."""
    settings, rng = DemSettings(normal_stiffness=normal_stiffness), np.random.default_rng(3)
    cell = prepare_packing(GRAINS, rng, settings)
    seen = list(shear_photographs(cell, np.deg2rad(step_degrees) * np.arange(frames)))
    n = cell.grains.count
    material = Material(settings.friction, settings.wall_friction)
    packing = Packing(cell.grains, settings.length, material, np.array([np.nan, np.nan, settings.pressure, np.nan]))
    snapshots = [
        Snapshot(
            float(k), each.position + rng.normal(0.0, NOISE, (n, 2)), each.rotation, np.ones(n, bool), each.endpoints,
            NOISE,
        )
        for k, each in enumerate(seen)
    ]  # fmt: skip
    return SimulatedShear(packing, snapshots, seen)
