"""How a sequence is solved: the defaults live here."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

from solver.bodies.grains import Array
from solver.convex.program import ConvexSettings
from solver.detection.touch_probability import ContactProbabilitySettings
from solver.mixture.softness import SEEN_AT_MOST
from solver.nlgs.chain import ChainSettings
from solver.posterior.settings import PosteriorSettings

SURFACE = 3e-4  # typical overlap or roughness of touching surfaces in mean diameters


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
    positions: Literal["needed", "always", "never"] = "needed"  # ensemble: ask positions alone where motion says little
    posterior: PosteriorSettings = field(default_factory=PosteriorSettings)
    first_again: bool = False  # positions of the first frame are asked again when all are known: beforehand, briefly
    soft: bool = False  # grains overlap by more than noise and errors: positions are asked of every frame
    overlap_seen: float = 0.0  # [m] mean overlap of soft grains by their gaps; 0: these do not show it
    soft_trust: float = SEEN_AT_MOST  # the most that their overlaps are believed
    keep_members: bool = False  # ensemble: keep the field of every member
    measure_precision: bool = True  # from the gaps, where they contradict what is stated
    measure_overlap: bool = True  # likewise
    overlap: float | None = None  # [m] typical overlap or roughness of touching surfaces; None: `typical_overlap`
    threshold_sigmas: float = 6.0  # nlgs: gap threshold in standard deviations of a position, overlap included
    threshold: float | None = None  # [m], instead of threshold_sigmas
    workers: int | None = None  # threads that members of a frame share; None: one for every core. No bit depends on it
    reset_to_zero: bool = False  # the paper's reset at a rearrangement
    reset_frames: frozenset[int] = frozenset()  # frames that start from zero forces whatever is found
    kept_frames: frozenset[int] = frozenset()  # frames that never do

    @property
    def asks_positions(self) -> bool:
        """Whether positions alone may be asked of forces and radii."""
        return self.estimator == "ensemble" and self.positions != "never"

    def without_sweeps(self) -> SequenceSettings:
        """The same where only the final forces are wanted: no sweep keeps its own."""
        return replace(self, chain=replace(self.chain, keep="none"))

    def for_radii(self, radius: Array) -> SequenceSettings:
        """The same for grains of these radii (n,) [m], their overlap told to all that ask for it."""
        overlap = typical_overlap(radius) if self.overlap is None else self.overlap
        probability = replace(self.ensemble.probability, overlap=overlap)
        return replace(self, overlap=overlap, ensemble=replace(self.ensemble, probability=probability))


def typical_overlap(radius: Array) -> float:
    """How far touching surfaces overlap or stand apart by elasticity and roughness [m]; radius (n,) [m].

    A missed contact costs far more than a false one, so it is rather too large than too small.
    """
    return SURFACE * 2.0 * float(radius.mean())
