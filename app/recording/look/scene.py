"""The scene: the data of the whole run that the writers need before its first frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...results.results import TruthContacts, grain_weight, setting
from ...solver.assessment.fringe_pressures import FringePressures
from ...solver.bodies.cell import Cell
from ...solver.bodies.grains import Array, Grains
from ...solver.contacts.contacts import Contacts
from ...solver.contacts.radius_tuning import RadiusTuning
from ...solver.kinematics.sequence_kinematics import SequenceKinematics
from ...tracks import Tracks, WallTracks
from .canvas import Canvas
from .force_style import ForceStyle
from .printable_text import printable

USUAL_ROD_LENGTH = 0.06  # [m] drawn if the configuration gives no length


@dataclass(frozen=True, slots=True)
class Scene:
    """Bodies, canvas and style of forces of one run."""

    name: str
    tracks: Tracks
    walls: WallTracks
    grains: Grains
    friction: float
    configuration: str  # TOML
    canvas: Canvas
    style: ForceStyle
    truth: TruthContacts | None = None
    tolerance: float | None = None  # stopping level of the residual
    radius_tuning: RadiusTuning | None = None
    diagnosis: tuple[str, ...] = ()  # sentences
    camera: str = ""  # its distortion with intervals, a sentence; empty: not sought
    kinematics: Callable[[slice], SequenceKinematics | None] | None = None  # of some frames; None: not measured
    fringes: FringePressures | None = None  # beside photoelastic photographs

    @property
    def rod_length(self) -> float:
        """Length of the rods [m]: `material.length` of the configuration."""
        length = setting(self.configuration, "material", "length")
        return float(length) if isinstance(length, (int, float)) and length > 0 else USUAL_ROD_LENGTH

    @property
    def force_unit(self) -> str:
        """Unit of the forces, see `WallTracks.force_unit`."""
        return self.walls.force_unit(self.weight)

    @property
    def weight(self) -> Array:
        """Weight of every grain (n, 2) [N], from `material.gravity` of the configuration; zero if that is not set."""
        return grain_weight(self.grains, self.configuration)

    def body_names(self, bodies: NDArray[np.integer]) -> list[str]:
        """Return the names of bodies by row: the id of a grain, the name of a wall."""
        n = self.grains.count
        return [printable(self.walls.name[b - n]) if b >= n else str(self.tracks.id[b]) for b in bodies.tolist()]

    def branches(self, frame: int, contacts: Contacts) -> NDArray[np.float32]:
        """Return the lines of contacts (c, 2, 2) in [px]."""
        return self.canvas.points(self.lines(frame, contacts)).astype(np.float32)

    def lines(self, frame: int, contacts: Contacts) -> Array:
        """Return lines (c, 2, 2) [m] from centre to centre; at a wall or the edge of a cell, to the contact point."""
        position = self.tracks.position[frame]
        wall = contacts.with_wall
        ends = np.empty((contacts.count, 2, 2))
        ends[:, 0] = position[contacts.i]
        ends[~wall, 1] = position[contacts.j[~wall]]
        ends[wall, 1] = contacts.point[wall]
        across = self.across(frame, contacts)
        ends[across, 1] = self.contact_points(frame, contacts)[across]
        return ends

    def far_halves(self, frame: int, contacts: Contacts) -> tuple[NDArray[np.intp], Array]:
        """Return the contacts across the edge of a cell (a,), and lines (a, 2, 2) [m] from j to the contact point."""
        rows = np.flatnonzero(self.across(frame, contacts))
        start = self.tracks.position[frame][contacts.j[rows]]
        reach = self.grains.radius[contacts.j[rows]] + 0.5 * contacts.gap[rows]
        return rows, np.stack([start, start - reach[:, None] * contacts.normal[rows]], axis=1)

    def across(self, frame: int, contacts: Contacts) -> NDArray[np.bool_]:
        """Return which contacts cross the edge of the cell as it is drawn (c,)."""
        if self.walls.cell is None:
            return np.zeros(contacts.count, np.bool_)
        apart = self.tracks.position[frame][contacts.j] - self.tracks.position[frame][contacts.i]
        return np.linalg.norm(apart, axis=1) > 2.0 * self.grains.radius.max() + np.abs(contacts.gap)

    def contact_points(self, frame: int, contacts: Contacts) -> Array:
        """Return the points at which contacts are drawn (c, 2) [m]: in a cell at the rim of i as wrapped."""
        if self.walls.cell is None:
            return contacts.point
        reach = self.grains.radius[contacts.i] + 0.5 * contacts.gap
        return self.tracks.position[frame][contacts.i] + reach[:, None] * contacts.normal

    def outline(self, frame: int) -> Array:
        """Return corners (k, 2) [m] of the boundary in a frame: walls, the cell, or a box around all grains."""
        if self.walls.cell is not None:
            return cell_corners(self.walls.cell[frame])
        if self.walls.count:
            return self.walls.endpoints[frame].reshape(-1, 2)
        seen = self.tracks.position[self.tracks.present]
        (left, bottom), (right, top) = seen.min(axis=0), seen.max(axis=0)
        return np.array([[left, bottom], [right, bottom], [right, top], [left, top]])


def cell_corners(vectors: Array) -> Array:
    """Return the corners (4, 2) [m] of a cell of vectors (2, 2) [m]."""
    a, b = vectors
    return np.array([np.zeros(2), a, a + b, b])


def tracks_in_cell(tracks: Tracks, walls: WallTracks) -> Tracks:
    """Return the tracks as they are drawn: wrapped into the cell if there is one."""
    if walls.cell is None:
        return tracks
    inside = np.stack([
        Cell.at_rest(cell).wrapped(place) for cell, place in zip(walls.cell, tracks.position, strict=True)
    ])  # fmt: skip
    return replace(tracks, position=inside)
