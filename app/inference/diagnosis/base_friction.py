"""Friction of the base on which rods slide, found as the coefficient whose forces leave least unexplained."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...process.errors import UndeterminedError
from ...solver.bodies.grains import Grains
from ..inputs import Inputs

FRACTIONS = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3)  # drags over the mean contact force that are compared


class BaseFrictionError(UndeterminedError):
    """The motion does not determine the friction of the base."""

    key = "material.base_friction"


def coefficient_of(inputs: Inputs, fraction: float) -> float:
    """Return the friction coefficient of a base whose drag on a mean rod is a fraction of the mean contact force.

    Raises
    ------
    BaseFrictionError
        No wall has a known load, so that contact forces are known up to a factor only.

    Notes
    -----
    The mean contact force is about p L d with the pressure p, the length L of the rods and their mean diameter d.
    """
    material, radius = inputs.material, inputs.tracks.radius
    pressure = inputs.walls.usual_pressure(material.length)
    if not np.isfinite(pressure).any():
        raise BaseFrictionError("needs a wall with a known load")
    force = float(np.nanmean(pressure)) * material.length * 2.0 * float(radius.mean())
    mass = Grains.of_rods(radius, density=material.density, length=material.length).mass.mean()
    return fraction * force / (float(mass) * material.base_gravity)


def measure_base_friction(inputs: Inputs, score: Callable[[Inputs], float]) -> Inputs:
    """Find the friction coefficient of the base.

    Parameters
    ----------
    inputs : Inputs
        Of a sequence with a known load.
    score : callable
        Mean arctanh of the expected r(f_n) of a trial solution; −∞ without forces.

    Returns
    -------
    Inputs
        With the coefficient of the highest score, by a parabola through it and its neighbours.

    Raises
    ------
    BaseFrictionError
        No wall has a known load, or no trial has forces.
    """
    trials = np.array([coefficient_of(inputs, fraction) for fraction in FRACTIONS])
    found = np.array([score(inputs.with_base_friction(each)) for each in trials.tolist()])
    best = int(np.argmax(found))
    if not np.isfinite(found[best]):
        raise BaseFrictionError("no trial solution has forces")
    if 0 < best < len(trials) - 1 and np.isfinite(found[[best - 1, best + 1]]).all():
        curve = np.polynomial.Polynomial.fit(trials[best - 1 : best + 2], found[best - 1 : best + 2], 2)
        top = float(np.clip(curve.deriv().roots()[0].real, trials[best - 1], trials[best + 1]))
        return inputs.with_base_friction(top)
    return inputs.with_base_friction(float(trials[best]))
