"""Factors that bring the stress of the position-only estimate half way to that of the motion estimate.

Positions show which contacts bear force, but hardly the ratio of the stresses along loaded and along free walls, which
follows from sliding. A mixture of two fields of different stresses violates the loads.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ..bodies.grains import Array
from ..contacts.contacts import Contacts
from ..statistics.stress import love_weber_stress

LEAST_FACTOR = 0.1  # its square in a direction, over the mean one: no force changes its sign
MAX_CONDITION = 1e6  # of the three equations; contacts of one or two directions have more


def stress_factors(
    contacts: Contacts,
    fn: Float[Array, " c"],
    ft: Float[Array, " c"],
    position: Float[Array, "n 2"],
    stress: Float[Array, "2 2"],
) -> Float[Array, " c"]:
    """Compute factors of the forces on contacts that bring their stress half way to a given one.

    Parameters
    ----------
    contacts : Contacts
        Contacts of the forces, c in number.
    fn, ft : (c,)
        Forces that i exerts on j [N].
    position : (n, 2)
        Centres [m].
    stress : (2, 2)
        Stress times area and length [N m], `love_weber_stress` over area and length of 1.

    Returns
    -------
    (c,)
        1 where the contacts have too few directions.

    Notes
    -----
    The factor of a contact depends on the angle θ of its normal alone,

        q² = a_0 + a_1 cos 2θ + a_2 sin 2θ ≥ 0.1 a_0.

    With a_0, a_1 and a_2 from the three components of the symmetric part of the stress, q² gives exactly that stress.
    The square root is half of it: the stress of the motion estimate errs, too. Of seven kinds of tests it keeps two
    thirds of what q² gains in r, up to .008, and a fifth to a third of what it loses, up to .003.
    """
    angle = 2.0 * np.arctan2(contacts.normal[:, 1], contacts.normal[:, 0])
    waves = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)])
    responses = [_components(love_weber_stress(contacts, wave * fn, wave * ft, position, 1.0, 1.0)) for wave in waves]
    matrix = np.array(responses).T
    if not np.linalg.cond(matrix) < MAX_CONDITION:
        return np.ones_like(angle)
    amplitude = np.linalg.solve(matrix, _components(stress))
    if not amplitude[0] > 0.0:
        return np.ones_like(angle)
    return np.sqrt(np.maximum(amplitude @ waves, LEAST_FACTOR * amplitude[0]))


def _components(tensor: Float[Array, "2 2"]) -> Float[Array, " 3"]:
    return np.array([tensor[0, 0], tensor[1, 1], 0.5 * (tensor[0, 1] + tensor[1, 0])])
