"""Settings of a sequence, with their defaults."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

from ..bodies.grains import Array
from ..contacts.surface import typical_overlap
from ..part_settings import MAX_TRUST_MEASURED, ChainSettings, ContactProbabilitySettings, ConvexSettings
from ..posterior.posterior_settings import PosteriorSettings


@dataclass(frozen=True, slots=True)
class EnsembleSettings:
    """Settings of the ensemble's members."""

    stiffer: float = 2.0  # kinematic number of the second chain over that of the first
    convex: ConvexSettings = field(default_factory=ConvexSettings)
    probability: ContactProbabilitySettings = field(default_factory=ContactProbabilitySettings)


@dataclass(frozen=True, slots=True)
class SequenceSettings:
    """Settings of `solve_sequence`."""

    estimator: Literal["ensemble", "nlgs"] = "ensemble"
    chain: ChainSettings = field(default_factory=ChainSettings)  # nlgs: the estimator; ensemble: its first member
    ensemble: EnsembleSettings = field(default_factory=EnsembleSettings)
    positions: Literal["needed", "always", "never"] = "needed"  # ensemble: when the position-only estimate is used
    posterior: PosteriorSettings = field(default_factory=PosteriorSettings)
    soft: bool = False  # grains overlap by more than noise and errors: every frame uses positions
    measured_overlap: float = 0.0  # [m] mean overlap of soft grains by their gaps; 0: not visible
    corrected_gap: float = 0.0  # [m] rms part of a gap that was corrected as errors of single grains
    centres_by_forces: bool = False  # errors of centres were found again by the forces of the sequence
    unseen_sought: bool = False  # rods that no photograph shows were sought: holes that are left need none
    soft_trust: float = MAX_TRUST_MEASURED  # largest trust in forces from their overlaps
    keep_members: bool = False  # ensemble: keep the field of every member
    measure_precision: bool = True  # from the gaps, where they contradict what is stated
    measure_overlap: bool = True  # from the gaps, where they contradict a given one
    overlap: float | None = None  # [m] typical overlap or roughness of touching surfaces; None: `typical_overlap`
    threshold_sigmas: float = 6.0  # nlgs: gap threshold in standard deviations of a position, overlap included
    threshold: float | None = None  # [m], instead of threshold_sigmas
    # Threads for the members of a frame; None: one for every core. Results do not depend on it.
    workers: int | None = None
    # Photographs over which sliding is read and history is carried, where neighbouring ones are closer than noise. Only
    # the ensemble uses it.
    span: int = 1
    alike: int = 1  # neighbouring photographs that share one position-only estimate
    reset_to_zero: bool = False  # the paper's reset at a rearrangement
    reset_frames: frozenset[int] = frozenset()  # frames that always start from zero forces
    kept_frames: frozenset[int] = frozenset()  # frames that never do

    @property
    def used_span(self) -> int:
        """Photographs over which the estimator reads sliding."""
        return self.span if self.estimator == "ensemble" else 1

    @property
    def uses_positions(self) -> bool:
        """Whether the position-only estimate may be used for forces and radii."""
        return self.estimator == "ensemble" and self.positions != "never"

    def without_sweeps(self) -> SequenceSettings:
        """The same without the forces of single sweeps."""
        return replace(self, chain=replace(self.chain, keep="none"))

    def for_radii(self, radius: Array) -> SequenceSettings:
        """The same with the typical overlap for grains of these radii (n,) [m]."""
        overlap = typical_overlap(radius) if self.overlap is None else self.overlap
        probability = replace(self.ensemble.probability, overlap=overlap)
        return replace(self, overlap=overlap, ensemble=replace(self.ensemble, probability=probability))
