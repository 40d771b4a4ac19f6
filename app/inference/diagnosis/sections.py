"""Rods that are not round as a cause: no correction of radii and centres removes them."""

from __future__ import annotations

from ...results.finding import Finding
from ...solver.boundary.section_shape import measure_section_shape
from ...tracks import Tracks
from .causes import finding

# Chosen with both in view: on tracks of round rods (200 rods, seeds 20, 22, 41, 51, 52 and 61: loading paths, noise,
# wrong radii, centres and cameras) the significance was at most 3.9, and the fraction .24 where it exceeded 2; on
# elliptic rods (seeds 42 and 43) 7 to 9, and .37 to .5.
SIGNIFICANT, DOMINANT = 4.5, 0.2
VISIBLE = 5e-3  # ovality below which forces are found nevertheless


def examine_sections(tracks: Tracks) -> list[Finding]:
    """Look for sections that are not round, by gaps at opposite sides of a rod and at right angles."""
    shape = measure_section_shape(tracks.position, tracks.radius, tracks.boundary)
    if shape.significance < SIGNIFICANT or shape.fraction < DOMINANT or shape.ovality < VISIBLE:
        return []
    words = (
        "gaps at opposite sides of a rod err alike and those at right angles oppositely, as of elliptic sections of "
        f"±{100.0 * shape.ovality:.1f} % of the radius"
    )
    return [finding("sections_not_round", words)]
