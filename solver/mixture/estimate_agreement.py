"""How far the estimates of a frame agree, and how much of the forces the positions show: evidence of their errors."""

from __future__ import annotations

import math
from dataclasses import replace

from ..assessment.evidence import Evidence
from ..bodies.grains import Array
from ..contacts.pairs import Keys, align
from ..posterior.frame_posterior import FramePosterior
from ..statistics.agreement import pearson

Field = tuple[Keys, Array]  # keys (c,) and f_n (c,) [N]


def with_agreements(
    evidence: Evidence, motion: Field, positions: FramePosterior, balance: Field, sigma: float
) -> Evidence:
    """Add the correlations of f_n between the estimates of a frame, over the contacts of either.

    Parameters
    ----------
    evidence : Evidence
        Of the motion estimate.
    motion : keys (c,), f_n (c,)
        Motion estimate [N].
    positions : FramePosterior
        Position-only estimate.
    balance : keys (c,), f_n (c,)
        Motion-free balance of overlaps [N].
    sigma : float
        Standard deviation of a position component [m]. Where overlaps are much smaller, positions show which contacts
        bear, not how much.
    """
    noise = math.hypot(sigma, evidence.corrected_gap)  # corrected errors of grains hide overlaps, too
    geometry = positions.contacts.key, positions.fn
    return replace(
        evidence,
        agreement=correlate(motion, geometry),
        position_agreement=correlate(geometry, balance),
        overlap_agreement=correlate(motion, balance),
        agreement_age=0,
        shown_overlap=positions.overlap / noise if noise > 0.0 else math.inf,
    )


def with_former_agreements(evidence: Evidence, before: Evidence) -> Evidence:
    """Carry the agreements of the previous frame on."""
    return replace(
        evidence,
        agreement=before.agreement,
        position_agreement=before.position_agreement,
        overlap_agreement=before.overlap_agreement,
        agreement_age=before.agreement_age + 1,
        shown_overlap=before.shown_overlap,
    )


def correlate(one: Field, two: Field) -> float:
    """Correlation of two fields over the contacts of either, a missing contact without force; NaN: one is constant."""
    _, first, second = align(*one, *two)
    return pearson(first, second)
