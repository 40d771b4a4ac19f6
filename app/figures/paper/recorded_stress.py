"""Friction angle and principal direction of the recorded stress: of true forces, or of measured forces on the walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...results.results import Results, TruthContacts
from ...solver.bodies.grains import Array, Grains
from ...solver.contacts.contacts import measure_pairs
from ...solver.contacts.pairs import are_present
from ...solver.statistics.stress import friction_angle, love_weber_stress, principal_stresses


@dataclass(frozen=True, slots=True)
class RecordedStress:
    """Directions of the recorded stress of every frame; NaN where it is unknown."""

    friction_angle: Array  # (f,) [rad]
    principal_direction: Array  # (f,) [rad]
    source: str


def recorded_stress(results: Results, truth: TruthContacts | None) -> RecordedStress | None:
    """Return the recorded stress directions; None where neither true forces nor forces on all walls are known.

    Notes
    -----
    Of true forces σ = Σ f ⊗ ℓ / (A L). Of forces F_w on straight walls σ = Σ F_w ⊗ x_w / (A L), symmetrised, with x_w
    the middle of the wall, as the place where its force acts is not recorded. Neither A nor L changes the directions.
    """
    count = len(results.frames)
    angle, direction = np.full(count, np.nan), np.full(count, np.nan)
    force = results.walls.force
    if truth is not None:
        stresses, source = _of_true_forces(results, truth), "true forces"
    elif force is not None and np.isfinite(force).all():
        middle = results.walls.endpoints.mean(axis=2)
        middle = middle - middle.mean(axis=1, keepdims=True)
        stress = np.einsum("fwa,fwb->fab", force, middle)
        stresses, source = list(0.5 * (stress + stress.transpose(0, 2, 1))), "forces on the walls"
    else:
        return None
    for k, stress in enumerate(stresses):
        if stress is not None and np.isfinite(stress).all() and stress.any():
            angle[k], direction[k] = friction_angle(stress), principal_stresses(stress)[2]
    return RecordedStress(angle, direction, source)


def _of_true_forces(results: Results, truth: TruthContacts) -> list[Array | None]:
    grains = Grains.of_rods(results.tracks.radius, density=1.0, length=1.0)
    bodies = results.grains.count + results.walls.count
    stresses: list[Array | None] = []
    for k, (key, force) in enumerate(truth.by_frame(bodies, len(results.frames))):
        here = np.argsort(key)
        here = here[are_present(key[here], results.tracks.present[k], bodies)]
        if not len(here):
            stresses.append(None)
            continue
        position = results.tracks.position[k]
        contacts = measure_pairs(grains, position, results.walls.at_rest(k), key[here])
        stresses.append(love_weber_stress(contacts, force[here, 0], force[here, 1], position, 1.0, 1.0))
    return stresses
