"""The mixture of both estimates of a frame, in equilibrium and with the stress and the sum that the motion shows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..bodies.grains import Array
from ..contacts.contacts import Contacts
from ..convex.program import Balance, ConvexSettings
from ..posterior.frame_posterior import FramePosterior
from ..statistics.stress import love_weber_stress
from .equilibrium_projection import WeightedSum, project_mixed_field
from .frame_mixture import ForceEstimate, Mixture, Softness, mix_on_contacts
from .stress_matching import stress_factors


@dataclass(frozen=True, slots=True)
class FrameBalance:
    """The contacts of a frame (c) and the balance of its forces."""

    contacts: Contacts
    position: Array  # (n, 2) [m]
    balance: Balance
    settings: ConvexSettings
    scale_known: bool  # by loads or weight
    has_weight: bool  # stress is not uniform then


def mix_in_equilibrium(
    frame: FrameBalance,
    motion: ForceEstimate,
    positions: FramePosterior,
    reliability: float,
    *,
    softness: Softness | None = None,
    position_weight: float | None = None,
) -> Mixture:
    """Mix the motion estimate with the position-only estimate, and project the mixture onto equilibrium.

    Parameters
    ----------
    frame : FrameBalance
    motion : ForceEstimate
        On the contacts of the frame.
    positions : FramePosterior
        Position-only estimate, before any stress factors.
    reliability : float
        Of the motion estimate; NaN where no motion leads to the frame.
    softness, position_weight
        As of `mix_on_contacts`.

    Notes
    -----
    Of hard grains under a known load the stress and the sum of f_n follow from sliding, not from positions. They count
    as far as the motion does: by its weight 1 − u, as a power of the stress factors.
    """

    def mix(placed: FramePosterior, weight: float | None) -> Mixture:
        return mix_on_contacts(
            frame.contacts, motion, placed, reliability, scale_known=frame.scale_known, softness=softness,
            position_weight=weight,
        )  # fmt: skip

    mixture, wanted = mix(positions, position_weight), None
    if frame.scale_known and softness is None and not np.isnan(reliability):
        motion_weight = 1.0 - mixture.position_weight
        wanted = WeightedSum(float(motion.fn.sum()), motion_weight)
        if not frame.has_weight:
            stress = love_weber_stress(frame.contacts, motion.fn, motion.ft, frame.position, 1.0, 1.0)
            factor = stress_factors(positions.contacts, positions.fn, positions.ft, frame.position, stress)
            mixture = mix(replace(positions, stress_factor=factor**motion_weight), mixture.position_weight)
    given = mixture.fn, mixture.ft, mixture.fn_sd, frame.settings, wanted
    projected = project_mixed_field(frame.balance, *given, soft=softness is not None)
    return replace(mixture, fn=projected.fn, ft=projected.ft) if projected.converged else mixture
