"""The macroscopic quantities of one frame, gathered from stress, fabric, connectivity, forces and chains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array, Grains
from solver.bodies.packing import Material
from solver.bodies.quantity import Quantity, quantities
from solver.bodies.walls import Walls
from solver.contacts.connectivity import coordination_number, expected_rattlers
from solver.contacts.contacts import Contacts
from solver.statistics.fabric import anisotropies, contact_fabric, fabric_anisotropy
from solver.statistics.force_chains import find_force_chains
from solver.statistics.force_statistics import (
    FORCE_EDGES,
    MOBILISATION_EDGES,
    force_density,
    mobilisation,
    mobilisation_density,
    plateau_ratio,
    strong_network,
    tail_exponent,
)
from solver.statistics.stress import (
    branch_vectors,
    contact_force_vectors,
    friction_angle,
    love_weber_stress,
    packing_area,
    principal_stresses,
    sums_on_walls,
    wall_forces,
    wall_ratio_angle,
)
from solver.statistics.weighted import weighted_mean

KNOWN_SLIDING = 0.99  # |f_t| / (μ f_n) of exact forces from which on a contact slides
NAN = float("nan")
EVEN = 0.5  # P(bears force) above which a contact counts where all or nothing is asked: rattlers


@dataclass(frozen=True, slots=True)
class Likely:
    """What the contacts (c,) of a frame do, as far as that is known."""

    bears: Array  # (c,) P(bears force)
    slides: Array  # (c,) P(slides), if it does

    @classmethod
    def of_known(cls, fn: Array, ft: Array, friction: Array) -> Likely:
        """Where forces are exact: what has f_n bears it, what is on the Coulomb cone slides; friction (c,)."""
        bearing = fn > 0
        slides = bearing & (mobilisation(fn, ft, friction) >= KNOWN_SLIDING)
        return cls(bearing.astype(np.float64), slides.astype(np.float64))


def _deviation_of(name: str, unit: str = "") -> Quantity:
    return Quantity(f"standard deviation of {name}, calibrated", unit, since=2)


@dataclass(frozen=True, slots=True)
class FrameStatistics:
    """Statistics of one frame.

    Means, shares and counts over contacts are over those that bear force, each counted as it is likely to.
    """

    area: Annotated[float, Quantity("area of the polygon between the walls", "m2")]
    stress: Annotated[Array, Quantity("Love-Weber stress, compression positive", "Pa", "xy axis")]
    pressure: Annotated[float, Quantity("half the trace of the stress", "Pa")]
    friction_angle: Annotated[float, Quantity("asin((σ₁−σ₂)/(σ₁+σ₂))", "rad")]
    wall_ratio_angle: Annotated[float, Quantity("atan(|T|/N) on the loaded plate, NaN without one", "rad")]
    principal_direction: Annotated[float, Quantity("direction of σ₁, in (−π/2, π/2]", "rad")]
    coordination_number: Annotated[float, Quantity("contacts with force per grain, those with walls counted once")]
    coordination_number_without_rattlers: Annotated[float, Quantity("contacts with force per grain that is no rattler")]
    rattler_count: Annotated[int, Quantity("grains with fewer than two contacts, as many as are expected")]
    contact_count: Annotated[int, Quantity("contacts bearing force, as many as are expected to")]
    sliding_fraction: Annotated[float, Quantity("share of the contacts bearing force that slide")]
    mean_fn: Annotated[float, Quantity("mean f_n over contacts bearing force", "N")]
    max_fn: Annotated[float, Quantity("greatest f_n", "N")]
    fabric: Annotated[Array, Quantity("mean n⊗n over contacts between grains that bear force", dims="xy axis")]
    fabric_anisotropy: Annotated[float, Quantity("2 (F₁ − F₂) of the fabric")]
    sigma_1: Annotated[float, Quantity("greatest principal stress", "Pa")]
    sigma_2: Annotated[float, Quantity("smallest principal stress", "Pa")]
    wall_force: Annotated[Array, Quantity("force of the packing on every wall", "N", "wall xy")]
    # Anisotropies of the contacts between grains: those with walls face where the walls face.
    contact_anisotropy: Annotated[float, Quantity("a_c of contacts between grains, Rothenburg & Bathurst 1989")]
    branch_anisotropy: Annotated[float, Quantity("a_l of branch lengths")]
    normal_force_anisotropy: Annotated[float, Quantity("a_n of normal forces")]
    tangential_force_anisotropy: Annotated[float, Quantity("a_t of tangential forces")]
    anisotropy_direction: Annotated[
        Array, Quantity("direction of each anisotropy, in (−π/2, π/2]", "rad", "anisotropy")
    ]
    friction_angle_of_anisotropies: Annotated[
        float, Quantity("friction angle that the four anisotropies add up to", "rad")
    ]
    mobilisation: Annotated[float, Quantity("mean of |f_t| / (μ f_n)")]
    mobilisation_density: Annotated[Array, Quantity("P(|f_t| / (μ f_n))", dims="mobilisation_bin")]
    fn_density: Annotated[Array, Quantity("P(f_n / ⟨f_n⟩)", dims="force_bin")]
    ft_density: Annotated[Array, Quantity("P(|f_t| / ⟨|f_t|⟩)", dims="force_bin")]
    tail_exponent: Annotated[float, Quantity("β of P(f_n) ∝ exp(−β f_n/⟨f_n⟩) above the mean, NaN: no tail")]
    tail_exponent_sd: Annotated[float, Quantity("standard error of tail_exponent")]
    plateau_ratio: Annotated[float, Quantity("1: P(f_n) flat below the mean; above 1: more of the weakest")]
    plateau_ratio_sd: Annotated[float, Quantity("standard error of plateau_ratio")]
    strong_share: Annotated[float, Quantity("share of the contacts with more than the mean normal force")]
    strong_pressure_share: Annotated[float, Quantity("share of the pressure that the strong contacts carry")]
    strong_deviator_share: Annotated[
        float, Quantity("share of the deviator of the strong contacts; above 1: the weak oppose it")
    ]
    chain_count: Annotated[int, Quantity("force chains, Peters et al. 2005")]
    chain_grain_share: Annotated[float, Quantity("share of the grains present that belong to a force chain")]
    wall_normal_force: Annotated[
        Array | None, Quantity("sum of the normal forces on each wall", "N", "wall", since=2)
    ] = None
    wall_tangential_force: Annotated[
        Array | None, Quantity("sum of the tangential forces on each wall, towards end 1", "N", "wall", since=2)
    ] = None

    # Standard deviations that truths showed, NaN where none is known, as `solver.sequence.judging` sets them.
    friction_angle_sd: Annotated[float, _deviation_of("friction_angle", "rad")] = NAN
    wall_ratio_angle_sd: Annotated[float, _deviation_of("wall_ratio_angle", "rad")] = NAN
    principal_direction_sd: Annotated[float, _deviation_of("principal_direction", "rad")] = NAN
    pressure_sd: Annotated[float, _deviation_of("pressure", "Pa")] = NAN
    sigma_1_sd: Annotated[float, _deviation_of("sigma_1", "Pa")] = NAN
    sigma_2_sd: Annotated[float, _deviation_of("sigma_2", "Pa")] = NAN
    coordination_number_sd: Annotated[float, _deviation_of("coordination_number")] = NAN
    coordination_number_without_rattlers_sd: Annotated[float, _deviation_of("coordination_number_without_rattlers")] = (
        NAN
    )
    rattler_count_sd: Annotated[float, _deviation_of("rattler_count")] = NAN
    contact_count_sd: Annotated[float, _deviation_of("contact_count")] = NAN
    sliding_fraction_sd: Annotated[float, _deviation_of("sliding_fraction")] = NAN
    mobilisation_sd: Annotated[float, _deviation_of("mobilisation")] = NAN
    mean_fn_sd: Annotated[float, _deviation_of("mean_fn", "N")] = NAN
    max_fn_sd: Annotated[float, _deviation_of("max_fn", "N")] = NAN
    fabric_anisotropy_sd: Annotated[float, _deviation_of("fabric_anisotropy")] = NAN
    contact_anisotropy_sd: Annotated[float, _deviation_of("contact_anisotropy")] = NAN
    branch_anisotropy_sd: Annotated[float, _deviation_of("branch_anisotropy")] = NAN
    normal_force_anisotropy_sd: Annotated[float, _deviation_of("normal_force_anisotropy")] = NAN
    tangential_force_anisotropy_sd: Annotated[float, _deviation_of("tangential_force_anisotropy")] = NAN
    friction_angle_of_anisotropies_sd: Annotated[float, _deviation_of("friction_angle_of_anisotropies", "rad")] = NAN
    strong_share_sd: Annotated[float, _deviation_of("strong_share")] = NAN
    strong_pressure_share_sd: Annotated[float, _deviation_of("strong_pressure_share")] = NAN
    strong_deviator_share_sd: Annotated[float, _deviation_of("strong_deviator_share")] = NAN
    chain_count_sd: Annotated[float, _deviation_of("chain_count")] = NAN
    chain_grain_share_sd: Annotated[float, _deviation_of("chain_grain_share")] = NAN


def frame_statistics(
    contacts: Contacts,
    fn: Array,
    ft: Array,
    likely: Likely,
    position: Array,
    present: NDArray[np.bool_],
    walls: Walls,
    length: float,
    *,
    grains: Grains,
    material: Material,
) -> FrameStatistics:
    """Gather the statistics of one frame.

    fn, ft (c,) [N]; likely: which contacts bear force and which slide; position (n, 2) [m]; present (n,); length of
    the rods [m].
    """
    bearing = fn > 0
    carried, held, weight, slides = fn[bearing], ft[bearing], likely.bears[bearing], likely.slides[bearing]
    surely = bearing & (likely.bears > EVEN)
    counted = present & grains.free  # a boundary grain stands by itself
    area = packing_area(walls, position[present])
    stress = love_weber_stress(contacts, fn, ft, position, area, length)
    sigma_1, sigma_2, direction = principal_stresses(stress)
    on_walls, sums = wall_forces(contacts, fn, ft), sums_on_walls(contacts, fn, ft)

    force, branch = contact_force_vectors(contacts, fn, ft), branch_vectors(contacts, position)
    between = bearing & ~contacts.with_wall
    fabric = contact_fabric(contacts.normal[between], likely.bears[between])
    parts = anisotropies(contacts.normal[between], branch[between], fn[between], ft[between], likely.bears[between])
    kinds = (parts.contact, parts.branch, parts.normal, parts.tangential)
    friction = material.friction_at(contacts.with_wall)
    mobilised = mobilisation(carried, held, friction[bearing])
    tail, plateau = tail_exponent(carried, weight), plateau_ratio(carried, weight)
    strong = strong_network(carried, force[bearing], branch[bearing], weight)
    chains = find_force_chains(contacts, fn, ft, position, present, grains, length)
    return FrameStatistics(
        area=area,
        stress=stress,
        pressure=0.5 * float(np.trace(stress)),
        friction_angle=friction_angle(stress),
        wall_ratio_angle=wall_ratio_angle(walls, sums),
        principal_direction=direction,
        coordination_number=coordination_number(contacts, surely, counted, weight=likely.bears),
        coordination_number_without_rattlers=coordination_number(
            contacts, surely, counted, without_rattlers=True, weight=likely.bears
        ),
        rattler_count=round(expected_rattlers(contacts, likely.bears, counted)),
        contact_count=round(float(weight.sum())),
        sliding_fraction=weighted_mean(slides, weight),
        mean_fn=weighted_mean(carried, weight),
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
        mobilisation=weighted_mean(slides + (1.0 - slides) * np.minimum(mobilised, 1.0), weight),
        mobilisation_density=mobilisation_density(mobilised, weight, slides),
        fn_density=force_density(carried, weight),
        ft_density=force_density(np.abs(held), weight),
        tail_exponent=tail.value,
        tail_exponent_sd=tail.standard_error,
        plateau_ratio=plateau.value,
        plateau_ratio_sd=plateau.standard_error,
        strong_share=strong.contact_share,
        strong_pressure_share=strong.pressure_share,
        strong_deviator_share=strong.deviator_share,
        chain_count=chains.count,
        chain_grain_share=float(np.mean(chains.chain[present] >= 0)) if present.any() else 0.0,
        wall_normal_force=sums[:, 0],
        wall_tangential_force=sums[:, 1],
    )


def no_statistics(wall_count: int) -> FrameStatistics:
    """The statistics of a frame without forces: nothing is counted, and nothing else is known."""
    sizes = {"xy": 2, "axis": 2, "wall": wall_count, "anisotropy": 4}
    sizes |= {"force_bin": len(FORCE_EDGES) - 1, "mobilisation_bin": len(MOBILISATION_EDGES) - 1}
    values: dict[str, Any] = {}
    for each in quantities(FrameStatistics):
        shape = tuple(sizes[name] for name in each.quantity.dims.split())
        values[each.name] = np.full(shape, np.nan) if shape else 0 if each.dtype.kind == "i" else np.nan
    return FrameStatistics(**values)
