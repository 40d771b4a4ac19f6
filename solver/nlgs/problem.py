"""One frame's contact problem, assembled and validated once.

The unknown forces act on bodies that resist with an *impedance* Z [N s/m]: the velocity that forces f
produce is v = v_measured + ΣF / Z. The paper's scheme has Z = m / ((1−η) δt). Measured grain velocities then
do not influence the forces at all, because that Z is some nine orders too small; the kinematic number κ
sets Z = κ f₀ / v_rms · m / m̄ / (1−η) instead, with f₀ = σ L d, so that undoing the whole measured motion costs
forces of κ f₀. Rotation resists with ½ Z R², as solid rods do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int32, Int64
from numpy.typing import NDArray

from solver.bodies.grains import Array, GrainMotion, Grains
from solver.bodies.packing import Material
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts
from solver.nlgs.sweeping.ordering import GROUP, VisitingOrder, order_contacts

PLATE_IMPEDANCE = 30.0  # of a loaded plate, in mean grain impedances
CACHE_LINE = 64  # bytes


class ContactProblem(NamedTuple):
    """What the kernels read: packed records in visiting order, p contacts between grains first, then q with walls.

    Contacts between grains lie in blocks of L = GROUP, one row per quantity, so that a block is read as vectors; the
    last block is filled up with zeros. The first `grouped` of them are in groups that share no grain.
    At most ten fields: numba's dispatch slows beyond.
    """

    body: Float[Array, "n 4"]  # free velocity vx, vy, ω R [m/s] and 1/Z [m/(N s)]
    plate: Float[Array, "w 2"]  # free normal velocity beyond the measured one [m/s] and 1/Z, 0 where motion is imposed
    pair_body: Int32[np.ndarray, "blocks 2 L"]  # grains i, j
    # nx, ny, 1/W_nn, and what is added to u_n [m/s]: gap to close and motion of the cell between both; to u_t: where
    # there is a cell
    pair: Float[Array, "blocks rows L"]
    grouped: int  # a multiple of L, at most p
    wall_body: Int32[np.ndarray, "q 2"]  # grain, wall
    # nx, ny, 1/W_nn, 1/W_tt, and what is added to u_n, u_t [m/s]: motion of the wall, gap to close
    wall: Float[Array, "q 6"]
    friction: Float[Array, "2"]  # between grains, with walls
    external: Float[Array, "n 2"]  # [N] weight of the grains
    rows: Int64[np.ndarray, " c"]  # c = p + q: record → row of Contacts


def kinematic_impedance(
    grains: Grains, *, kappa: float, force_scale: float, velocity_scale: float, formal_weight: float = 0.0
) -> Array:
    """Impedance of every grain (n,) [N s/m] for a kinematic number κ.

    force_scale: f₀ = σ L d [N]; velocity_scale: v_rms [m/s].
    """
    if not (kappa > 0 and force_scale > 0 and velocity_scale > 0):
        raise ValueError("κ, the force scale and the velocity scale must be positive")
    mean = kappa * force_scale / velocity_scale / (1.0 - formal_weight)
    return mean * grains.mass / grains.mass.mean()


def inertial_impedance(grains: Grains, *, interval: float, formal_weight: float = 0.0) -> Array:
    """Impedance of every grain (n,) [N s/m] as the paper's time step gives it: m / ((1−η) δt)."""
    if not interval > 0:
        raise ValueError("the interval must be positive")
    return grains.mass / interval / (1.0 - formal_weight)


def assemble(
    grains: Grains,
    motion: GrainMotion,
    walls: Walls,
    contacts: Contacts,
    material: Material,
    impedance: Array,
    *,
    closing: Array | None = None,
    order: VisitingOrder | None = None,
) -> ContactProblem:
    """Assemble the contact problem of one frame (or sub-step).

    impedance (n,) [N s/m]; closing (c,) [m/s], the velocity at which a contact must close before it bears force
    (a doubtful contact's extra gap over the time of the step), 0 if absent; order: of `order_contacts`, if it is known.
    """
    n = grains.count
    if np.any(~motion.present[contacts.i]) or np.any(~motion.present[contacts.j[contacts.j < n]]):
        raise ValueError("a contact names a grain that is not present")
    moved = motion.present & grains.free  # by forces; the others move as they were seen
    compliance = np.where(grains.free, 1.0 / impedance, 0.0)
    weight = grains.weight(material.gravity)
    weight[~moved] = 0.0
    body = np.zeros((n, 4))
    body[:, :2] = motion.velocity + weight * compliance[:, None]
    body[:, 2] = motion.spin * grains.radius
    body[:, 3] = compliance
    body[~motion.present] = 0.0

    plate = np.zeros((walls.count, 2))
    if walls.loaded.any():
        plate_compliance = 1.0 / (PLATE_IMPEDANCE * impedance[motion.present].mean())
        plate[walls.loaded, 0] = -walls.load[walls.loaded] * plate_compliance
        plate[walls.loaded, 1] = plate_compliance

    rows_pair, rows_wall, grouped = order_contacts(contacts) if order is None else order
    point, i, j = contacts.point, contacts.i, contacts.j
    closing = np.zeros(contacts.count) if closing is None else closing

    pair_w = compliance[i[rows_pair]] + compliance[j[rows_pair]]
    pair = [contacts.normal[rows_pair], _inverse(pair_w), closing[rows_pair]]
    if walls.cell is not None and contacts.shift is not None:
        drift = walls.cell.drift(contacts.shift[rows_pair])
        pair[-1] = pair[-1] + np.einsum("ij,ij->i", drift, contacts.normal[rows_pair])
        pair.append(np.einsum("ij,ij->i", drift, contacts.tangent[rows_pair]))

    wall_body = np.stack([i[rows_wall], j[rows_wall] - n], axis=1)
    wall_w = compliance[wall_body[:, 0]]
    velocity = walls.velocity_at(wall_body[:, 1], point[rows_wall])
    wall = np.column_stack([
        contacts.normal[rows_wall],
        _inverse(wall_w + plate[wall_body[:, 1], 1]),
        _inverse(3.0 * wall_w),
        np.einsum("ij,ij->i", velocity, contacts.normal[rows_wall]) + closing[rows_wall],
        np.einsum("ij,ij->i", velocity, contacts.tangent[rows_wall]),
    ])  # fmt: skip

    return ContactProblem(
        body,
        plate,
        _blocks(np.stack([i[rows_pair], j[rows_pair]], axis=1)),
        _blocks(np.column_stack(pair)),
        grouped,
        wall_body,
        wall,
        np.array([material.friction, material.wall_friction]),
        weight,
        np.concatenate([rows_pair, rows_wall]),
    )


def _inverse(value: Array) -> Array:
    """1 / value (c,); 0 where that is 0: between two bodies whose motion is imposed, forces change nothing."""
    return np.divide(1.0, value, out=np.zeros_like(value), where=value > 0.0)


def aligned_zeros(shape: tuple[int, ...], kind: type = np.float64) -> NDArray:
    """Zeros on the bounds of a cache line, which no vector then straddles."""
    size = int(np.prod(shape)) * np.dtype(kind).itemsize
    room = np.zeros(size + CACHE_LINE, np.uint8)
    start = -room.ctypes.data % CACHE_LINE
    return room[start : start + size].view(kind).reshape(shape)


def _blocks(record: NDArray) -> NDArray:
    """Records (p, k) in blocks (ceil(p / GROUP), k, GROUP), the last one filled up with zeros."""
    count, width = record.shape
    blocks = -(-count // GROUP)
    padded = np.zeros((blocks * GROUP, width), record.dtype)
    padded[:count] = record
    result = aligned_zeros((blocks, width, GROUP), record.dtype.type)
    result[:] = padded.reshape(blocks, GROUP, width).transpose(0, 2, 1)
    return result
