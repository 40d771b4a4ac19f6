"""The contact problem of one frame, assembled and validated once.

The unknown forces act on bodies of *impedance* Z [N s/m]: forces produce the velocity v = v_measured + ΣF / Z. The
paper's scheme has Z = m / ((1−η) δt). Measured grain velocities then do not influence the forces, because this Z is
some nine orders of magnitude too small. The kinematic number κ sets Z = κ f₀ / v_rms · m / m̄ / (1−η) instead, with
f₀ = σ L d: forces of κ f₀ cancel the whole measured motion. The rotational impedance is ½ Z R², as of solid rods.

The motion of a boundary rod is imposed, but known with an error only: a rod between two of them, whose distance seems
to shrink by that error, would bear any force. A change of f₀ of its reaction therefore moves it by the error of its
displacement, √2 σ: Z = f₀ δt / (√2 σ). The reaction that it had before moves it by nothing.
"""

from __future__ import annotations

from math import prod
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int32, Int64
from numpy.typing import NDArray

from ..bodies.grains import Array, GrainMotion, Grains
from ..bodies.packing import Material
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts
from ..grain_records import RECORD
from .sweeping.ordering import GROUP, VisitingOrder, order_contacts

PLATE_IMPEDANCE = 30.0  # of a loaded plate, in mean grain impedances
CACHE_LINE = 64  # bytes


class ContactProblem(NamedTuple):
    """Packed records in visiting order for the kernels: p contacts between grains, then q contacts with walls.

    Contacts between grains are stored in blocks of L = GROUP, one row per quantity, so that a block is read as vectors.
    The last block is padded with zeros. The first `grouped` contacts are in groups that share no grain. The dispatch of
    numba slows beyond ten fields.
    """

    body: Float[Array, "n 4"]  # free velocity vx, vy, ω R [m/s] and 1/Z [m/(N s)]
    plate: Float[Array, "w 2"]  # free normal velocity beyond the measured one [m/s] and 1/Z, 0 where motion is imposed
    pair_body: Int32[np.ndarray, "blocks 2 L"]  # grains i, j: the places of their records in body, read flat
    # nx, ny, 1/W_nn, offset of u_n [m/s] (closing velocity and motion of the cell between both grains); offset of u_t
    # with a cell
    pair: Float[Array, "blocks rows L"]
    grouped: int  # a multiple of L, at most p
    wall_body: Int32[np.ndarray, "q 2"]  # grain, and the plate that the wall belongs to or the wall itself
    # nx, ny, 1/W_nn, 1/W_tt, offsets of u_n, u_t [m/s]: motion of the wall, closing velocity; n·p, t·p with p the
    # direction in which the plate is free
    wall: Float[Array, "q 8"]
    friction: Float[Array, "2"]  # between grains, with walls
    external: Float[Array, "n 3"]  # [N] weight of the grains; 1 of those whose forces must balance, else 0
    rows: Int64[np.ndarray, " c"]  # c = p + q: record → row of Contacts


def kinematic_impedance(
    grains: Grains, *, kappa: float, force_scale: float, velocity_scale: float, formal_weight: float = 0.0
) -> Array:
    """Compute the impedance of every grain for a kinematic number.

    Parameters
    ----------
    kappa : float
        Kinematic number κ.
    force_scale : float
        f₀ = σ L d [N].
    velocity_scale : float
        v_rms [m/s].
    formal_weight : float
        η.

    Returns
    -------
    (n,)
        Impedance [N s/m].

    Raises
    ------
    ValueError
        If κ or a scale is not positive.

    Notes
    -----
    Z = κ f₀ / v_rms / (1−η) · m / m̄
    """
    if not (kappa > 0 and force_scale > 0 and velocity_scale > 0):
        raise ValueError("κ, the force scale and the velocity scale must be positive")
    mean = kappa * force_scale / velocity_scale / (1.0 - formal_weight)
    return mean * grains.mass / grains.mass.mean()


def inertial_impedance(grains: Grains, *, interval: float, formal_weight: float = 0.0) -> Array:
    """Compute the impedance of every grain (n,) [N s/m] from the paper's time step: Z = m / ((1−η) δt)."""
    if not interval > 0:
        raise ValueError("the interval must be positive")
    return grains.mass / interval / (1.0 - formal_weight)


def with_boundary(impedance: Array, grains: Grains, *, force_scale: float, error: float) -> Array:
    """Replace the impedances (n,) [N s/m] of boundary grains, whose velocity is known with this error [m/s].

    Notes
    -----
    Z = f₀ / error; infinite without an error.
    """
    if grains.boundary is None:
        return impedance
    return np.where(grains.boundary, force_scale / error if error > 0.0 else np.inf, impedance)


class PreparedContacts(NamedTuple):
    """What is known of contacts before a problem is assembled."""

    # Velocity (c,) at which a contact must close before it carries force [m/s]: the extra gap of an ambiguous contact
    # over the time of the step; None: zero.
    closing: Array | None = None
    order: VisitingOrder | None = None  # result of `order_contacts`


def assemble(
    grains: Grains,
    motion: GrainMotion,
    walls: Walls,
    contacts: Contacts,
    material: Material,
    impedance: Array,
    prepared: PreparedContacts | None = None,
) -> ContactProblem:
    """Assemble the contact problem of one frame or sub-step.

    Parameters
    ----------
    impedance : (n,)
        Impedance of every grain [N s/m]; infinite: no force moves it.
    prepared : PreparedContacts, optional
        What is known of the contacts beforehand.

    Raises
    ------
    ValueError
        If a contact refers to a grain that is not present.
    """
    n = grains.count
    if np.any(~motion.present[contacts.i]) or np.any(~motion.present[contacts.j[contacts.j < n]]):
        raise ValueError("a contact names a grain that is not present")
    body, plate, weight = _free_motion(grains, motion, walls, material, impedance)
    compliance = body[:, 3]
    closing, order = prepared or PreparedContacts()
    rows_pair, rows_wall, grouped = order_contacts(contacts) if order is None else order
    point, i, j = contacts.point, contacts.i, contacts.j
    closing = np.zeros(contacts.count) if closing is None else closing

    pair_w = compliance[i[rows_pair]] + compliance[j[rows_pair]]
    pair = [contacts.normal[rows_pair], _inverse(pair_w), closing[rows_pair]]
    if walls.cell is not None and contacts.shift is not None:
        drift = walls.cell.drift(contacts.shift[rows_pair])
        pair[-1] = pair[-1] + np.einsum("ij,ij->i", drift, contacts.normal[rows_pair])
        pair.append(np.einsum("ij,ij->i", drift, contacts.tangent[rows_pair]))

    of_wall = j[rows_wall] - n
    carrier, along_normal, along_tangent = walls.plate_components(of_wall, contacts.normal[rows_wall])
    wall_body = np.stack([i[rows_wall], carrier], axis=1)
    velocity = walls.velocity_at(of_wall, point[rows_wall])
    wall = np.column_stack([
        contacts.normal[rows_wall],
        *_effective_impedances(body, plate, wall_body, along_normal, along_tangent),
        np.einsum("ij,ij->i", velocity, contacts.normal[rows_wall]) + closing[rows_wall],
        np.einsum("ij,ij->i", velocity, contacts.tangent[rows_wall]),
        along_normal,
        along_tangent,
    ])  # fmt: skip

    return ContactProblem(
        body,
        plate,
        _blocks(np.stack([i[rows_pair], j[rows_pair]], axis=1) * np.int32(RECORD)),
        _blocks(np.column_stack(pair)),
        grouped,
        wall_body,
        wall,
        np.array([material.friction, material.wall_friction]),
        weight,
        np.concatenate([rows_pair, rows_wall]),
    )


def with_impedance(
    problem: ContactProblem, grains: Grains, motion: GrainMotion, walls: Walls, material: Material, impedance: Array
) -> ContactProblem:
    """Assemble the problem of the same contacts and motion for another impedance (n,) [N s/m]."""
    body, plate, weight = _free_motion(grains, motion, walls, material, impedance)
    compliance, pair, wall = body[:, 3], aligned_zeros(problem.pair.shape), problem.wall.copy()
    pair[:] = problem.pair
    first, second = problem.pair_body[:, 0] // RECORD, problem.pair_body[:, 1] // RECORD
    # Zero are rows of padding, and of two bodies with imposed motion.
    pair[:, 2] = np.where(pair[:, 2] > 0.0, _inverse(compliance[first] + compliance[second]), 0.0)
    wall[:, 2], wall[:, 3] = _effective_impedances(body, plate, problem.wall_body, wall[:, 6], wall[:, 7])
    return problem._replace(body=body, plate=plate, pair=pair, wall=wall, external=weight)


def moved_before(problem: ContactProblem, change: Array) -> ContactProblem:
    """Add changes (n, 3) [m/s] to the velocities vx, vy, ω R without contact forces."""
    body = aligned_zeros(problem.body.shape)
    body[:] = problem.body
    body[:, :3] += change
    return problem._replace(body=body)


def _free_motion(
    grains: Grains, motion: GrainMotion, walls: Walls, material: Material, impedance: Array
) -> tuple[Array, Array, Array]:
    """Motion of bodies (n, 4) and plates (w, 2) without contact forces, and `external` (n, 3), see `ContactProblem`."""
    moved = motion.present & grains.free  # by their weight, too
    compliance = 1.0 / impedance
    weight = grains.weight(material.gravity)
    weight[~moved] = 0.0
    external = np.column_stack([weight, moved.astype(np.float64)])
    body = np.zeros((grains.count, 4))
    body[:, :2] = motion.velocity + weight * compliance[:, None]
    body[:, 2] = motion.spin * grains.radius
    if grains.moment is not None:  # of half the inertia of the mass at the rim
        body[moved, 2] += 2.0 * (compliance * grains.moment / grains.radius)[moved]
    body[:, 3] = compliance
    body[~motion.present] = 0.0

    plate = np.zeros((walls.count, 2))
    if walls.loaded.any():
        plate_compliance = 1.0 / (PLATE_IMPEDANCE * impedance[moved].mean())
        plate[walls.loaded, 0] = -walls.load[walls.loaded] * plate_compliance
        plate[walls.loaded, 1] = plate_compliance
    return body, plate, external


def _effective_impedances(
    body: Array, plate: Array, wall_body: NDArray[np.integer], along_normal: Array, along_tangent: Array
) -> tuple[Array, Array]:
    """Normal and tangential force over a change of relative velocity (c,) [N s/m], of contacts with walls."""
    grain_w, plate_w = body[wall_body[:, 0], 3], plate[wall_body[:, 1], 1]
    return _inverse(grain_w + along_normal**2 * plate_w), _inverse(3.0 * grain_w + along_tangent**2 * plate_w)


def _inverse(value: Array) -> Array:
    """1 / value (c,), and 0 where value is 0: forces do not change the motion of two bodies with imposed motion."""
    return np.divide(1.0, value, out=np.zeros_like(value), where=value > 0.0)


def aligned_zeros(shape: tuple[int, ...], kind: type = np.float64) -> NDArray:
    """Allocate zeros aligned to a cache line, so that no vector crosses two lines."""
    size = prod(shape) * np.dtype(kind).itemsize
    buffer = np.zeros(size + CACHE_LINE, np.uint8)
    start = -buffer.ctypes.data % CACHE_LINE
    return buffer[start : start + size].view(kind).reshape(shape)


def _blocks(record: NDArray) -> NDArray:
    """Arrange records (p, k) in blocks (ceil(p / GROUP), k, GROUP), the last one padded with zeros."""
    count, width = record.shape
    blocks = -(-count // GROUP)
    padded = np.zeros((blocks * GROUP, width), record.dtype)
    padded[:count] = record
    result = aligned_zeros((blocks, width, GROUP), record.dtype.type)
    result[:] = padded.reshape(blocks, GROUP, width).transpose(0, 2, 1)
    return result
