"""Macroscopic quantities of one frame: stress, fabric, connectivity, force distribution and force chains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from ..bodies.grains import Array
from ..bodies.motion import Snapshot
from ..bodies.packing import Packing
from ..contacts.connectivity import coordination_number, expected_rattlers
from ..contacts.contacts import Contacts
from ..quantity import Quantity, quantities
from .fabric import anisotropies, contact_fabric, fabric_anisotropy
from .force_chains import find_force_chains
from .force_statistics import (
    FORCE_EDGES,
    MOBILISATION_EDGES,
    force_density,
    mobilisation,
    mobilisation_density,
    plateau_ratio,
    strong_network,
    tail_exponent,
)
from .packing_area import packing_area
from .stress import (
    branch_vectors,
    contact_force_vectors,
    friction_angle,
    love_weber_stress,
    principal_stresses,
    sums_on_walls,
    wall_forces,
    wall_ratio_angle,
)
from .weighted import weighted_mean

KNOWN_SLIDING = 0.99  # |f_t| / (μ f_n) above which a contact with exact forces slides
NAN = float("nan")
EVEN = 0.5  # P(bears force) above which a contact counts as bearing, for the rattlers


@dataclass(frozen=True, slots=True)
class ContactProbabilities:
    """Probabilities that the contacts of a frame bear force and slide."""

    bearing: Array  # (c,) P(bears force)
    sliding: Array  # (c,) P(slides | bears force)

    @classmethod
    def of_known(cls, fn: Array, ft: Array, friction: Array) -> ContactProbabilities:
        """Return probabilities 0 or 1 from exact forces: contacts on the Coulomb cone slide; friction (c,)."""
        bearing = fn > 0
        sliding = bearing & (mobilisation(fn, ft, friction) >= KNOWN_SLIDING)
        return cls(bearing.astype(np.float64), sliding.astype(np.float64))


def _sd_of(name: str, unit: str = "", formerly: str | None = None) -> Quantity:
    former = f"statistics/{formerly}_sd" if formerly else None
    return Quantity(f"standard deviation of {name}, calibrated", unit, since=2, formerly=former)


@dataclass(frozen=True, slots=True)
class FrameStatistics:
    """Statistics of one frame.

    Means, fractions and counts of contacts are weighted with P(bears force).
    """

    area: Annotated[float, Quantity("area of the polygon between the walls", "m2")]
    stress: Annotated[Array, Quantity("Love-Weber stress, compression positive", "Pa", "xy axis")]
    pressure: Annotated[float, Quantity("half the trace of the stress", "Pa")]
    friction_angle: Annotated[float, Quantity("asin((σ₁−σ₂)/(σ₁+σ₂))", "rad")]
    wall_ratio_angle: Annotated[float, Quantity("atan(|T|/N) on the loaded plate, NaN without one", "rad")]
    principal_direction: Annotated[float, Quantity("direction of σ₁, in (−π/2, π/2]", "rad")]
    coordination_number: Annotated[float, Quantity("contacts with force per grain, those with walls counted once")]
    coordination_number_without_rattlers: Annotated[float, Quantity("contacts with force per grain that is no rattler")]
    rattler_count: Annotated[int, Quantity("expected number of grains with fewer than two contacts")]
    contact_count: Annotated[int, Quantity("expected number of contacts bearing force")]
    sliding_fraction: Annotated[float, Quantity("fraction of the contacts bearing force that slide")]
    mean_fn: Annotated[float, Quantity("mean f_n over contacts bearing force", "N")]
    max_fn: Annotated[float, Quantity("greatest f_n", "N")]
    fabric: Annotated[Array, Quantity("mean n⊗n over contacts between grains that bear force", dims="xy axis")]
    fabric_anisotropy: Annotated[float, Quantity("2 (F₁ − F₂) of the fabric")]
    sigma_1: Annotated[float, Quantity("greatest principal stress", "Pa")]
    sigma_2: Annotated[float, Quantity("smallest principal stress", "Pa")]
    wall_force: Annotated[Array, Quantity("force of the packing on every wall", "N", "wall xy")]
    # Anisotropies of the contacts between grains only, as normals of walls have fixed directions.
    contact_anisotropy: Annotated[float, Quantity("a_c of contacts between grains, Rothenburg & Bathurst 1989")]
    branch_anisotropy: Annotated[float, Quantity("a_l of branch lengths")]
    normal_force_anisotropy: Annotated[float, Quantity("a_n of normal forces")]
    tangential_force_anisotropy: Annotated[float, Quantity("a_t of tangential forces")]
    anisotropy_direction: Annotated[
        Array, Quantity("direction of each anisotropy, in (−π/2, π/2]", "rad", "anisotropy")
    ]
    friction_angle_of_anisotropies: Annotated[float, Quantity("friction angle from the four anisotropies", "rad")]
    mobilisation: Annotated[float, Quantity("mean of |f_t| / (μ f_n)")]
    mobilisation_density: Annotated[Array, Quantity("P(|f_t| / (μ f_n))", dims="mobilisation_bin")]
    fn_density: Annotated[Array, Quantity("P(f_n / ⟨f_n⟩)", dims="force_bin")]
    ft_density: Annotated[Array, Quantity("P(|f_t| / ⟨|f_t|⟩)", dims="force_bin")]
    tail_exponent: Annotated[float, Quantity("β of P(f_n) ∝ exp(−β f_n/⟨f_n⟩) above the mean, NaN: no tail")]
    tail_exponent_sd: Annotated[float, Quantity("standard error of tail_exponent")]
    plateau_ratio: Annotated[float, Quantity("1: P(f_n) flat below the mean; above 1: more of the weakest")]
    plateau_ratio_sd: Annotated[float, Quantity("standard error of plateau_ratio")]
    strong_fraction: Annotated[
        float,
        Quantity("fraction of the contacts with more than the mean normal force", formerly="statistics/strong_share"),
    ]
    strong_pressure_fraction: Annotated[
        float,
        Quantity(
            "fraction of the pressure that the strong contacts carry", formerly="statistics/strong_pressure_share"
        ),
    ]
    strong_deviator_fraction: Annotated[
        float,
        Quantity(
            "fraction of the deviator that the strong contacts carry; above 1: the weak oppose it",
            formerly="statistics/strong_deviator_share",
        ),
    ]
    chain_count: Annotated[int, Quantity("force chains, Peters et al. 2005")]
    chain_grain_fraction: Annotated[
        float,
        Quantity(
            "fraction of the grains present that belong to a force chain", formerly="statistics/chain_grain_share"
        ),
    ]
    wall_normal_force: Annotated[
        Array | None, Quantity("sum of the normal forces on each wall", "N", "wall", since=2)
    ] = None
    wall_tangential_force: Annotated[
        Array | None, Quantity("sum of the tangential forces on each wall, towards end 1", "N", "wall", since=2)
    ] = None

    # Calibrated standard deviations, set by `assessment.intervals.statistic_intervals`; NaN where unknown.
    friction_angle_sd: Annotated[float, _sd_of("friction_angle", "rad")] = NAN
    wall_ratio_angle_sd: Annotated[float, _sd_of("wall_ratio_angle", "rad")] = NAN
    principal_direction_sd: Annotated[float, _sd_of("principal_direction", "rad")] = NAN
    pressure_sd: Annotated[float, _sd_of("pressure", "Pa")] = NAN
    sigma_1_sd: Annotated[float, _sd_of("sigma_1", "Pa")] = NAN
    sigma_2_sd: Annotated[float, _sd_of("sigma_2", "Pa")] = NAN
    coordination_number_sd: Annotated[float, _sd_of("coordination_number")] = NAN
    coordination_number_without_rattlers_sd: Annotated[float, _sd_of("coordination_number_without_rattlers")] = NAN
    rattler_count_sd: Annotated[float, _sd_of("rattler_count")] = NAN
    contact_count_sd: Annotated[float, _sd_of("contact_count")] = NAN
    sliding_fraction_sd: Annotated[float, _sd_of("sliding_fraction")] = NAN
    mobilisation_sd: Annotated[float, _sd_of("mobilisation")] = NAN
    mean_fn_sd: Annotated[float, _sd_of("mean_fn", "N")] = NAN
    max_fn_sd: Annotated[float, _sd_of("max_fn", "N")] = NAN
    fabric_anisotropy_sd: Annotated[float, _sd_of("fabric_anisotropy")] = NAN
    contact_anisotropy_sd: Annotated[float, _sd_of("contact_anisotropy")] = NAN
    branch_anisotropy_sd: Annotated[float, _sd_of("branch_anisotropy")] = NAN
    normal_force_anisotropy_sd: Annotated[float, _sd_of("normal_force_anisotropy")] = NAN
    tangential_force_anisotropy_sd: Annotated[float, _sd_of("tangential_force_anisotropy")] = NAN
    friction_angle_of_anisotropies_sd: Annotated[float, _sd_of("friction_angle_of_anisotropies", "rad")] = NAN
    strong_fraction_sd: Annotated[float, _sd_of("strong_fraction", formerly="strong_share")] = NAN
    strong_pressure_fraction_sd: Annotated[
        float, _sd_of("strong_pressure_fraction", formerly="strong_pressure_share")
    ] = NAN
    strong_deviator_fraction_sd: Annotated[
        float, _sd_of("strong_deviator_fraction", formerly="strong_deviator_share")
    ] = NAN
    chain_count_sd: Annotated[float, _sd_of("chain_count")] = NAN
    chain_grain_fraction_sd: Annotated[float, _sd_of("chain_grain_fraction", formerly="chain_grain_share")] = NAN


def frame_statistics(
    contacts: Contacts,
    fn: Array,
    ft: Array,
    probabilities: ContactProbabilities,
    snapshot: Snapshot,
    packing: Packing,
) -> FrameStatistics:
    """Compute the statistics of one frame.

    Parameters
    ----------
    contacts
        Contacts of the frame, c in number.
    fn, ft : (c,)
        Forces that i exerts on j [N].
    probabilities
        Probabilities that the contacts bear force and slide.
    snapshot
        Positions, walls and their measured loads in the frame.
    packing
        Grains, rod length, material and pressures.
    """
    position, present, walls = snapshot.position, snapshot.present, packing.walls_of(snapshot)
    grains, length = packing.grains, packing.length
    bearing = fn > 0
    normal, tangential = fn[bearing], ft[bearing]
    weight, sliding = probabilities.bearing[bearing], probabilities.sliding[bearing]
    probably_bearing = bearing & (probabilities.bearing > EVEN)
    counted = present & grains.free  # boundary grains are not in equilibrium by contacts
    area = packing_area(walls, position, present, grains.boundary)
    stress = love_weber_stress(contacts, fn, ft, position, area, length)
    sigma_1, sigma_2, direction = principal_stresses(stress)
    on_walls, sums = wall_forces(contacts, fn, ft), sums_on_walls(contacts, fn, ft)

    force, branch = contact_force_vectors(contacts, fn, ft), branch_vectors(contacts, position)
    between = bearing & ~contacts.with_wall
    fabric = contact_fabric(contacts.normal[between], probabilities.bearing[between])
    parts = anisotropies(
        contacts.normal[between], branch[between], fn[between], ft[between], probabilities.bearing[between]
    )
    kinds = (parts.contact, parts.branch, parts.normal, parts.tangential)
    friction = packing.material.friction_at(contacts.with_wall)
    mobilised = mobilisation(normal, tangential, friction[bearing])
    tail, plateau = tail_exponent(normal, weight), plateau_ratio(normal, weight)
    strong = strong_network(normal, force[bearing], branch[bearing], weight)
    chains = find_force_chains(contacts, fn, ft, position, present, grains, length)
    return FrameStatistics(
        area=area,
        stress=stress,
        pressure=0.5 * float(np.trace(stress)),
        friction_angle=friction_angle(stress),
        wall_ratio_angle=wall_ratio_angle(walls, sums),
        principal_direction=direction,
        coordination_number=coordination_number(contacts, probably_bearing, counted, weight=probabilities.bearing),
        coordination_number_without_rattlers=coordination_number(
            contacts, probably_bearing, counted, without_rattlers=True, weight=probabilities.bearing
        ),
        rattler_count=round(expected_rattlers(contacts, probabilities.bearing, counted)),
        contact_count=round(float(weight.sum())),
        sliding_fraction=weighted_mean(sliding, weight),
        mean_fn=weighted_mean(normal, weight),
        max_fn=float(fn.max(initial=0.0)),
        fabric=fabric,
        fabric_anisotropy=fabric_anisotropy(fabric),
        sigma_1=sigma_1,
        sigma_2=sigma_2,
        wall_force=on_walls,
        contact_anisotropy=parts.contact.amplitude,
        branch_anisotropy=parts.branch.amplitude,
        normal_force_anisotropy=parts.normal.amplitude,
        tangential_force_anisotropy=parts.tangential.amplitude,
        anisotropy_direction=np.array([each.direction for each in kinds]),
        friction_angle_of_anisotropies=float(np.arcsin(np.clip(parts.sine_of_friction_angle(direction), -1.0, 1.0))),
        mobilisation=weighted_mean(sliding + (1.0 - sliding) * np.minimum(mobilised, 1.0), weight),
        mobilisation_density=mobilisation_density(mobilised, weight, sliding),
        fn_density=force_density(normal, weight),
        ft_density=force_density(np.abs(tangential), weight),
        tail_exponent=tail.value,
        tail_exponent_sd=tail.standard_error,
        plateau_ratio=plateau.value,
        plateau_ratio_sd=plateau.standard_error,
        strong_fraction=strong.contact_fraction,
        strong_pressure_fraction=strong.pressure_fraction,
        strong_deviator_fraction=strong.deviator_fraction,
        chain_count=chains.count,
        chain_grain_fraction=float(np.mean(chains.chain[present] >= 0)) if present.any() else 0.0,
        wall_normal_force=sums[:, 0],
        wall_tangential_force=sums[:, 1],
    )


def no_statistics(wall_count: int) -> FrameStatistics:
    """Return the statistics of a frame without forces: counts are zero, all other values NaN."""
    sizes = {"xy": 2, "axis": 2, "wall": wall_count, "anisotropy": 4}
    sizes |= {"force_bin": len(FORCE_EDGES) - 1, "mobilisation_bin": len(MOBILISATION_EDGES) - 1}
    values: dict[str, Any] = {}
    for each in quantities(FrameStatistics):
        shape = tuple(sizes[name] for name in each.quantity.dims.split())
        values[each.name] = np.full(shape, np.nan) if shape else 0 if each.dtype.kind == "i" else np.nan
    return FrameStatistics(**values)
