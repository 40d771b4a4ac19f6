"""How a sequence is solved: the defaults live here."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from solver.convex.program import ConvexSettings
from solver.detection.touch_probability import ContactProbabilitySettings
from solver.nlgs.chain import ChainSettings


@dataclass(frozen=True, slots=True)
class EnsembleSettings:
    stiffer: float = 2.0  # kinematic number of the second chain over that of the first
    convex: ConvexSettings = field(default_factory=ConvexSettings)
    probability: ContactProbabilitySettings = field(default_factory=ContactProbabilitySettings)


@dataclass(frozen=True, slots=True)
class SequenceSettings:
    estimator: Literal["ensemble", "nlgs"] = "ensemble"
    chain: ChainSettings = field(default_factory=ChainSettings)  # nlgs: the estimator; ensemble: its first member
    ensemble: EnsembleSettings = field(default_factory=EnsembleSettings)
    keep_members: bool = False  # ensemble: keep the field of every member
    measure_precision: bool = True  # from the gaps, where they contradict what is stated
    measure_overlap: bool = True  # likewise
    overlap: float = 0.0  # [m] typical overlap or roughness of touching surfaces
    threshold_sigmas: float = 6.0  # nlgs: gap threshold in standard deviations of a position, overlap included
    threshold: float | None = None  # [m], instead of threshold_sigmas
    reset_to_zero: bool = False  # the paper's reset at a rearrangement
    reset_frames: frozenset[int] = frozenset()  # frames that start from zero forces whatever is found
    kept_frames: frozenset[int] = frozenset()  # frames that never do
