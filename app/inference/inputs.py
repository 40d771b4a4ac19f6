"""Inputs of the inference: everything that the forces follow from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..solver.bodies.grains import Array
from ..solver.bodies.rods import RodMaterial
from ..solver.contacts.verdicts import Verdicts
from ..solver.convex.friction_check import FrictionCheck
from ..tracks import Tracks, WallTracks
from .inference_settings import InferenceSettings


@dataclass(frozen=True, slots=True)
class Stretching:
    """Stretching of the picture that was removed from positions and walls; no other distortion is sought then."""

    factor: Array  # (2,) by which x and y were multiplied; ones: there is none
    middle: Array  # (2,) [m] that stays in its place
    evidence: str = ""


@dataclass(frozen=True, slots=True)
class Inputs:
    """Everything that the forces follow from."""

    tracks: Tracks
    walls: WallTracks
    material: RodMaterial = field(default_factory=RodMaterial)
    settings: InferenceSettings = field(default_factory=InferenceSettings)
    verdicts: Mapping[int, Verdicts] = field(default_factory=dict)  # of reviewers, by row of the frame
    placed: NDArray[np.bool_] | None = None  # (f, n) poses that are where somebody put them: no outliers
    stretching: Stretching | None = None  # None: the gaps are to show it

    @property
    def seeks_distortion(self) -> bool:
        """Whether a distortion of the camera is sought."""
        boundary = self.settings.boundary
        return boundary is not None and boundary.camera and self.stretching is None

    def without(self, stretching: Stretching) -> Inputs:
        """Remove a stretching of the picture."""
        middle, factor = stretching.middle, stretching.factor
        tracks = replace(self.tracks, position=middle + factor * (self.tracks.position - middle))
        walls = replace(self.walls, endpoints=middle + factor * (self.walls.endpoints - middle))
        return replace(self, tracks=tracks, walls=walls, stretching=stretching)

    def with_base_friction(self, coefficient: float) -> Inputs:
        """Fix the friction coefficient of the base, which is then not measured again."""
        material = replace(self.material, base_friction=coefficient, base_friction_measured=False)
        return replace(self, material=material)

    def with_friction(self, friction: float, check: FrictionCheck | None = None) -> Inputs:
        """Fix a friction coefficient that was to be measured, so that a sequence solved again does not measure it.

        Parameters
        ----------
        friction : float
            Coefficient between rods.
        check : FrictionCheck, optional
            Holds the coefficient measured at walls, too.
        """
        of_walls = self.material.wall_friction
        if check is not None and np.isfinite(check.wall_measured):
            of_walls = check.wall_measured
        if not self.material.friction_measured:
            return replace(self, material=replace(self.material, wall_friction=of_walls))
        known = replace(self.material, friction=friction, wall_friction=of_walls, friction_measured=False)
        return replace(self, material=known)
