"""Names of the causes that a diagnosis can give, with their effect and cure. The documentation lists this table."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from ...results.finding import Finding


@dataclass(frozen=True, slots=True)
class Cause:
    """Something that makes forces wrong."""

    effect: str
    cure: str
    corrected: bool = False  # by a run itself


CAUSES: dict[str, Cause] = {
    "photographs_reversed": Cause(
        "friction acts in the direction of sliding instead of against it", "turn the order of the photographs round"
    ),
    "photographs_swapped": Cause(
        "the motion goes to and fro where the packing did not", "put the photographs in the order of their times"
    ),
    "photograph_repeated": Cause(
        "no motion leads to the second of both, and its forces rest on the positions alone",
        "leave one of them out",
        corrected=True,
    ),
    "smoothed_tracks": Cause(
        "sudden motion is spread over several photographs, and errors that they share seem to be knowledge: forces err "
        "more than they seem to",
        "give the tracks as measured: a run treats their noise itself",
    ),
    "rotation_sign": Cause(
        "rolling is taken for sliding",
        "a run changes the sign: give theta counter-clockwise with y up",
        corrected=True,
    ),
    "rotation_in_degrees": Cause(
        "rolling is taken for sliding", "a run converts them: give theta in radians", corrected=True
    ),
    "rotation_zero": Cause(
        "rolling is taken for sliding",
        "a run takes them for unknown: leave theta out where it was not measured",
        corrected=True,
    ),
    "friction": Cause(
        "tangential forces are limited wrongly, and with them the normal forces",
        'set material.friction to the value found, or to "measured"',
    ),
    "wall_friction": Cause(
        "tangential forces at the walls are limited wrongly",
        "a run uses the value found, unless calibration.resistance is false: set material.wall_friction to it",
    ),
    "base_friction": Cause(
        "the base carries part of the load: as stated, forces are too small",
        "a run uses the coefficient found, unless calibration.resistance is false: set material.base_friction to it",
    ),
    "adhesion": Cause(
        "contacts also pull, and this model lets them only push",
        "take the forces for patterns, not for values: this model has no attraction",
    ),
    "rolling_resistance": Cause(
        "contacts exert moments, and this model lets them exert none",
        "take the forces for patterns, not for values: this model has no rolling resistance",
    ),
    "inertia": Cause(
        "part of the forces accelerates rods, and their balance lacks it",
        "load more slowly, or photograph at rest",
    ),
    "outlier_tracks": Cause(
        "a rod that jumps for one photograph, or whose pose is repeated, seems to slide; it is interpolated there",
        "look at these rods in these photographs",
        corrected=True,
    ),
    "exchanged_ids": Cause(
        "a rod seems to jump to another's place, with its radius, or to be lost",
        "a run gives every rod the name under which it was seen first: correct the table of the tracks",
        corrected=True,
    ),
    "missing_poses": Cause(
        "contacts of rods that photographs lack are interpolated, or missing",
        "find these rods in the photographs, or leave out the photographs that lack most of them",
        corrected=True,
    ),
    "wall_misplaced": Cause(
        "rods stand beyond a wall or touch none of it: it then carries too much force, or none",
        "a run moves it to the rods that touch it, or turns all walls together: correct the ends of the walls",
        corrected=True,
    ),
    "walls_shifted": Cause(
        "rods seem to penetrate walls or to leave them",
        "a run uses the places at the other time: give the places of the walls at the times of the photographs",
        corrected=True,
    ),
    "wall_at_rest": Cause(
        "rods seem to penetrate the wall or to leave it",
        "a run moves it with the rods that touch it: give the motion of the wall in every photograph",
        corrected=True,
    ),
    "wall_scatter": Cause(
        "rods seem to penetrate a wall in one photograph and to leave it in the next",
        "a run moves it with the rods that stay at it: measure the places of the walls as exactly as those of the rods",
        corrected=True,
    ),
    "wall_forces": Cause(
        "a load, a sensor or the forces are wrong, and with a load the scale of all forces",
        "compare names, signs and units of the recorded forces with the loads of the same walls",
    ),
    "stretched_picture": Cause(
        "rods that touch seem apart in one direction and overlap in the other",
        "calibrate the camera: x and y have different scales; a run removes it as far as the gaps show it",
        corrected=True,
    ),
    "load_missing": Cause(
        "forces that the weight causes are taken for any that friction can hold",
        "give the weight, [material] gravity = [0, -9.81], or the pressure of a wall",
    ),
    "lens": Cause(
        "rods that touch seem apart in one part of the picture and overlap in another",
        "calibrate the camera (photographs.lens); a run removes it as far as the gaps show it",
        corrected=True,
    ),
    "all_radii": Cause("contacts are lost or invented", "measure the radii anew, or the pixel size"),
    "class_radii": Cause("contacts of one size of rods are lost or invented", "measure the radii of every size anew"),
    "oversized_rods": Cause(
        "forces on these rods and around them are far too large",
        "measure their radii anew; other rods may be stated too small, which no overlap shows",
    ),
    "exchanged_sizes": Cause(
        "these rods penetrate their neighbours or touch none",
        "a run uses the sizes with which they touch: correct their radii in the table",
        corrected=True,
    ),
    "sections_not_round": Cause(
        "rods that touch seem apart in some directions and overlap in others",
        "take forces for patterns, not for values, unless the trust is high: rods are circles in this model",
    ),
    "not_explained": Cause(
        "the forces contradict the motion, the positions or one another",
        "check radii, walls, pixel size and tracks; the packing may do what this model lacks, such as cohesion, "
        "friction on the base, or inertia",
    ),
}

# Causes that the trust of every frame contains already: by its evidence, or by a limit or an interval of their own.
JUDGED_BY_FRAMES = frozenset({"not_explained", "smoothed_tracks", "wall_forces"})


def name_once(findings: Iterable[Finding]) -> list[Finding]:
    """Return one finding for every cause, in order, with all its evidence: two tests may find the same one."""
    found: dict[str, Finding] = {}
    for each in findings:
        known = found.get(each.cause)
        found[each.cause] = (
            each
            if known is None
            else replace(
                known, evidence=f"{known.evidence}; {each.evidence}", corrected=known.corrected and each.corrected
            )
        )
    return list(found.values())


def finding(cause: str, evidence: str, *, corrected: bool | None = None) -> Finding:
    """Return a finding with the documented effect and cure of its cause; corrected by a run: None: as documented."""
    known = CAUSES[cause]
    return Finding(cause, evidence, known.effect, known.cure, known.corrected if corrected is None else corrected)


def uncorrected(findings: Iterable[Finding]) -> list[Finding]:
    """Return the causes for which forces suffer, and of which the evidence of single frames shows a part only."""
    return [each for each in findings if not each.corrected and each.cause not in JUDGED_BY_FRAMES]
