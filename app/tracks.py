"""Tracks: position, rotation and precision of every grain and wall in every frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .process.counts import state_count
from .solver.bodies.grains import Array
from .solver.bodies.wall_shapes import STRAIGHT, all_sides, circle_parameters, outlines
from .solver.bodies.walls import Walls
from .solver.quantity import Quantity, quantities

BAR, CORNER, UNSPECIFIED = 0, 1, -1  # meaning of the two points of a wall


class TrackStatus(IntEnum):
    """How a pose was found. Stored with its names."""

    OK = 0  # correlation converged from the predicted pose
    RESCUED = 1  # found again by an exhaustive search
    ROBUST = 2  # a part of the patch was ignored (occlusion, damage)
    SUSPECT = 3  # converged, but unreliable
    LOST = 4  # no pose
    OUT_OF_FRAME = 5  # its patch reaches beyond the photograph: no pose
    GIVEN = 6  # read from a table
    INFERRED = 7  # no photograph shows this rod: its position is inferred from its neighbours
    INTERPOLATED = 8  # lost in this photograph: interpolated between those before and after

    @property
    def has_pose(self) -> bool:
        return self not in (TrackStatus.LOST, TrackStatus.OUT_OF_FRAME)


@dataclass(frozen=True, slots=True)
class Tracks:
    """Poses of n grains in f frames. Poses of grains without one are NaN."""

    id: Annotated[NDArray[np.int64], Quantity("name of the grain", dims="grain", essential=True, path="grains/id")]
    radius: Annotated[Array, Quantity("radius as it was used", "m", "grain", essential=True, path="grains/radius")]
    time: Annotated[Array, Quantity("time of the frame, ascending", "s", "frame", essential=True, path="frames/time")]
    position: Annotated[Array, Quantity("centre; NaN: lost", "m", "frame grain xy", essential=True)]
    rotation: Annotated[
        Array,
        Quantity("angle, counter-clockwise, not wrapped; NaN: lost, or unknown", "rad", "frame grain", essential=True),
    ]
    sigma: Annotated[Array, Quantity("standard deviation of a position component", "m", "frame grain")]
    zncc: Annotated[Array, Quantity("correlation with the reference patch, NaN: unknown", dims="frame grain")]
    status: Annotated[
        NDArray[np.uint8],
        Quantity("how the pose was found", dims="frame grain", absent=TrackStatus.GIVEN, names=TrackStatus),
    ]
    centre_sigma: Annotated[Array | None, Quantity("standard deviation of a centre's constant error", "m", "grain")] = (
        None
    )
    second_zncc: Annotated[
        Array | None, Quantity("correlation of the best other place, NaN: not searched", dims="frame grain")
    ] = None
    reference_frame: Annotated[
        NDArray[np.int32] | None, Quantity("photograph it is compared with", dims="frame grain")
    ] = None
    failed_reason: Annotated[
        tuple[str, ...] | None,
        Quantity("why a photograph could not be tracked; empty otherwise", dims="frame", since=2),
    ] = None

    inferred: Annotated[
        NDArray[np.bool_] | None,
        Quantity("whether no photograph shows the rod", dims="grain", since=2, path="grains/inferred"),
    ] = None

    boundary: Annotated[
        NDArray[np.bool_] | None,
        Quantity(
            "whether the grain is a boundary grain: its measured motion is imposed, and it need not be in equilibrium",
            dims="grain",
            since=2,
            path="grains/boundary",
        ),
    ] = None  # no boundary grains

    fringes: Annotated[
        Array | None,
        Quantity(
            "squared brightness gradient integrated over the disc, G², over the squared light; NaN: not read",
            dims="frame grain",
            since=2,
        ),
    ] = None  # no photoelastic photographs

    given_id: Annotated[
        NDArray[np.int64] | None,
        Quantity("name of the grain in the given table, where it confuses names", dims="frame grain", since=2),
    ] = None  # everywhere its id

    def __post_init__(self) -> None:
        f, n = len(self.time), len(self.id)
        if self.position.shape != (f, n, 2):
            raise ValueError(f"position must be ({f}, {n}, 2), not {self.position.shape}")
        for name in ("rotation", "sigma", "zncc", "status"):
            if getattr(self, name).shape != (f, n):
                raise ValueError(f"{name} must be ({f}, {n}), not {getattr(self, name).shape}")
        for name in ("second_zncc", "reference_frame", "fringes", "given_id"):
            value = getattr(self, name)
            if value is not None and value.shape != (f, n):
                raise ValueError(f"{name} must be ({f}, {n}), not {value.shape}")
        if self.failed_reason is not None and len(self.failed_reason) != f:
            raise ValueError(f"failed_reason must have {f} entries, not {len(self.failed_reason)}")
        if self.boundary is not None and self.boundary.shape != (n,):
            raise ValueError(f"boundary must be ({n},), not {self.boundary.shape}")
        if self.radius.shape != (n,):
            raise ValueError(f"radius must be ({n},), not {self.radius.shape}")

    @property
    def frame_count(self) -> int:
        return len(self.time)

    @property
    def grain_count(self) -> int:
        return len(self.id)

    @property
    def position_sigma(self) -> Array:
        """Standard deviation of a position component with the centre's constant error (f,) [m].

        Notes
        -----
        √(⟨σ²⟩ + ⟨σ_c²⟩), σ over the grains that were measured, σ_c the standard deviation of a centre's constant error.
        """
        fixed = 0.0 if self.centre_sigma is None else float(np.mean(self.centre_sigma**2))
        measured = self.present & ~self.interpolated
        variance = np.where(measured, self.sigma**2, 0.0).sum(axis=1)
        return np.sqrt(variance / np.maximum(measured.sum(axis=1), 1) + fixed)

    @property
    def failed(self) -> dict[int, str]:
        """Frames whose photographs could not be tracked, with the reason."""
        return {k: reason for k, reason in enumerate(self.failed_reason or ()) if reason}

    @property
    def renewal_count(self) -> int:
        """Number of damaged grains that are compared with a later photograph than the first."""
        if self.reference_frame is None:
            return 0
        return int((self.reference_frame > 0).any(axis=0).sum())

    @property
    def present(self) -> NDArray[np.bool_]:
        """Whether a grain has a pose (f, n)."""
        return np.isfinite(self.position[..., 0]) & np.isfinite(self.position[..., 1])

    def present_in(self, k: int) -> NDArray[np.bool_]:
        """Whether a grain has a pose in frame k (n,)."""
        return np.isfinite(self.position[k]).all(axis=1)

    @property
    def lost(self) -> NDArray[np.bool_]:
        """Whether a visible grain was not found (f, n), interpolated or not; inferred grains are not counted."""
        missing = (~self.present & ~self.out_of_frame) | self.interpolated
        return missing if self.inferred is None else missing & ~self.inferred

    @property
    def interpolated(self) -> NDArray[np.bool_]:
        """Whether a lost pose was interpolated (f, n): it is none that was measured."""
        return self.present & (self.status == TrackStatus.INTERPOLATED)

    @property
    def out_of_frame(self) -> NDArray[np.bool_]:
        """Whether the border of the photograph cuts a grain (f, n), which is no failure of the tracker."""
        return ~self.present & (self.status == TrackStatus.OUT_OF_FRAME)

    def describe_missing(self) -> str:
        """Describe the missing poses in words: lost, cut and inferred ones."""
        cut = self.out_of_frame
        parts = [f"{_counted(self.lost, 'pose')} lost"]
        if self.interpolated.any():
            parts[0] += f" ({int(self.interpolated.sum())} of them interpolated)"
        if cut.any():
            parts.append(f"{_counted(cut.any(axis=0), 'rod')} cut by the picture's border ({_counted(cut, 'pose')})")
        if self.inferred is not None and self.inferred.any():
            parts.append(f"{_counted(self.inferred, 'rod')} inferred")
        return ", ".join(parts)

    def frame(self, k: int) -> Tracks:
        """Return one frame: its properties cost nothing for all others."""
        return self.frames(k, k + 1)

    def frames(self, start: int, stop: int, step: int = 1) -> Tracks:
        """Return every step-th of the frames start … stop − 1."""
        part = slice(start, stop, step)
        return replace(self, **{name: values[part] for name, values in self._with_dims("frame").items()})

    def rearranged(self, row: NDArray[np.int64]) -> Tracks:
        """Return the tracks with the poses of frame k that the rows `row[k]` (f, n) hold now."""
        taken = {
            name: np.take_along_axis(values, row.reshape(*row.shape, *[1] * (values.ndim - 2)), axis=1)
            for name, values in self._with_dims("frame grain").items()
        }
        return replace(self, **taken)

    def _with_dims(self, first: str) -> dict[str, Any]:
        """Values of the fields that there are and whose dimensions begin so, by name."""
        return {
            each.name: values
            for each in quantities(Tracks)
            if each.quantity.dims.startswith(first) and (values := getattr(self, each.name)) is not None
        }


def held_once(column: NDArray[Any]) -> NDArray[Any]:
    """Return a column whose values are all the same as a view of one of them, which takes no memory; others as given.

    The view is read-only. Of tables, the precision and the status of poses are such columns, and correlations are NaN.
    """
    if not column.size:
        return column
    first = column.flat[0]
    same = np.isnan(column) if column.dtype.kind == "f" and np.isnan(first) else column == first
    return np.broadcast_to(first, column.shape) if same.all() else column


def _counted(marked: ArrayLike, noun: str) -> str:
    return state_count(int(np.sum(marked)), noun)


@dataclass(frozen=True, slots=True)
class WallTracks:
    """The walls of f frames, with the pressure or load on some of them."""

    name: Annotated[tuple[str, ...], Quantity("name of the wall", dims="wall", essential=True)]
    endpoints: Annotated[
        Array,
        Quantity(
            "ends; packing to the left of 0 → 1; of a circle the ends of a diameter, which rotates with it; in a "
            "failed frame interpolated between its neighbours",
            "m",
            "frame wall end xy",
            essential=True,
        ),
    ]
    pressure: Annotated[
        Array, Quantity("pressure on the wall, NaN where its motion is imposed", "Pa", "wall", essential=True)
    ]
    force: Annotated[
        Array | None, Quantity("recorded force of the packing on the wall, NaN: none", "N", "frame wall xy")
    ] = None
    # (f, w) [m] standard deviation of a tracked wall's endpoint along its normal, relative to frame 0, rms over its two
    # endpoints; NaN in frames where a table gives the wall, None where tables give all
    sigma: Annotated[
        Array | None, Quantity("standard deviation of an end along the normal; NaN: given", "m", "frame wall")
    ] = None

    end_kind: Annotated[
        NDArray[np.int8] | None,
        Quantity(
            "specified meaning of its ends; 0: points of the bar, 1: corners, −1: unspecified",
            dims="wall",
            since=2,
            formerly="walls/told",
        ),
    ] = None
    side: Annotated[
        NDArray[np.int8] | None,
        Quantity(
            "shape of the wall; 0: straight, 1: a circle around the packing, −1: one within it", dims="wall", since=2
        ),
    ] = None
    load: Annotated[
        Array | None, Quantity("specified normal load on the wall, NaN: none", "N", "frame wall", since=2)
    ] = None
    plate: Annotated[
        NDArray[np.int32] | None,
        Quantity(
            "loaded wall that this one is fixed to: both have one motion and share its load; −1: none",
            dims="wall",
            since=2,
        ),
    ] = None
    # Derived from the endpoints, whatever values are passed.
    centre: Annotated[Array | None, Quantity("centre of a circle; NaN: straight", "m", "frame wall xy", since=2)] = None
    radius: Annotated[Array | None, Quantity("radius of a circle; NaN: straight", "m", "frame wall", since=2)] = None

    def __post_init__(self) -> None:
        centre, radius, _ = circle_parameters(self.endpoints)
        straight = self.sides == STRAIGHT
        circular = self.side is not None
        object.__setattr__(self, "centre", np.where(straight[:, None], np.nan, centre) if circular else None)
        object.__setattr__(self, "radius", np.where(straight, np.nan, radius) if circular else None)

    cell: Annotated[
        Array | None,
        Quantity(
            "vectors a and b of the periodic cell, instead of walls; positions are not wrapped into it",
            "m",
            "frame lattice xy",
            since=2,
            path="cell/vectors",
        ),
    ] = None

    @property
    def count(self) -> int:
        return len(self.name)

    @property
    def sides(self) -> NDArray[np.int8]:
        """Shape of each wall (w,): STRAIGHT, or a circle with the packing IN or OUT of it."""
        return all_sides(self.side, self.count)

    @property
    def straight(self) -> list[int]:
        """Numbers of the straight walls."""
        return np.flatnonzero(self.sides == STRAIGHT).tolist()

    @property
    def loaded(self) -> NDArray[np.bool_]:
        """Whether a wall is a plate under a pressure or a load (w,)."""
        measured = False if self.load is None else np.isfinite(self.load).any(axis=0)
        return np.isfinite(self.pressure) | measured

    def force_unit(self, weight: Array) -> str:
        """Return the unit of forces: arbitrary where neither a load nor the weight (n, 2) [N] sets their scale."""
        return "N" if self.loaded.any() or weight.any() else "a.u."

    def at_rest(self, frame: int, load: Array | None = None) -> Walls:
        """Return the walls, or the cell, of a frame for measurements, with loads (w,) [N] if given."""
        cell = None if self.cell is None else self.cell[frame]
        return Walls.at_rest(self.endpoints[frame], load, self.side, cell)

    def outlines(self, frame: int) -> list[Array]:
        """Return the lines (p, 2) [m] that draw the walls of a frame."""
        return outlines(self.endpoints[frame], self.side)

    def load_at(self, frame: int) -> Array | None:
        """Return the measured load on the walls in a frame (w,) [N], NaN: none; None: no wall has one."""
        return None if self.load is None else self.load[frame]

    def usual_pressure(self, length: float) -> Array:
        """Return the pressure on the walls (w,) [Pa], NaN where the motion is imposed.

        The pressure of a wall with a measured load is the mean over the frames of load / (face · length), where face is
        the length of a straight wall or the circumference of a circle [m].

        Parameters
        ----------
        length
            Length of the rods [m].
        """
        if self.load is None:
            return self.pressure
        ends = self.endpoints[..., 1, :] - self.endpoints[..., 0, :]
        face = np.where(self.sides == STRAIGHT, 1.0, np.pi) * np.linalg.norm(ends, axis=-1)
        pressed = self.load / (face * length)
        known = np.isfinite(pressed)
        mean = np.where(known, pressed, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        return np.where(known.any(axis=0), mean, self.pressure)

    @property
    def end_kinds(self) -> NDArray[np.int8]:
        """Specified meaning of the ends of each wall (w,): BAR, CORNER or UNSPECIFIED."""
        return np.full(self.count, UNSPECIFIED, np.int8) if self.end_kind is None else self.end_kind

    def select(self, rows: NDArray[np.intp]) -> WallTracks:
        """Return the walls of these rows."""
        plate = None
        if self.plate is not None:
            at = np.append(np.full(self.count, -1), -1)
            at[rows] = np.arange(len(rows))
            plate = at[self.plate[rows]].astype(np.int32)
        return WallTracks(
            tuple(self.name[row] for row in rows), self.endpoints[:, rows], self.pressure[rows],
            None if self.force is None else self.force[:, rows],
            None if self.sigma is None else self.sigma[:, rows],
            None if self.end_kind is None else self.end_kind[rows],
            None if self.side is None else self.side[rows],
            None if self.load is None else self.load[:, rows],
            plate=plate,
        )  # fmt: skip

    def frames(self, start: int, stop: int, step: int = 1) -> WallTracks:
        """Return every step-th of the frames start … stop − 1."""
        part = slice(start, stop, step)
        force = None if self.force is None else self.force[part]
        sigma = None if self.sigma is None else self.sigma[part]
        cell = None if self.cell is None else self.cell[part]
        load = None if self.load is None else self.load[part]
        return WallTracks(
            self.name, self.endpoints[part], self.pressure, force, sigma, self.end_kind, self.side, load, cell=cell,
            plate=self.plate,
        )  # fmt: skip
