"""Every dataset of results.h5: path, dimensions, type, unit and meaning, generated from the fields of the results.

A field with a `Quantity` becomes a dataset. This module declares only what has no field: the first and last rows of a
frame, the names of dimensions, the attributes of the file.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass
from functools import cache
from typing import Any, get_type_hints

import numpy as np

from ..solver.assessment.fringe_pressures import FringePressures
from ..solver.bodies.grains import Array, Grains
from ..solver.boundary.boundary_correction import Boundary
from ..solver.boundary.camera_distortion import TERMS, CameraDistortion
from ..solver.calibration.calibrate import Calibration
from ..solver.contacts.radius_tuning import RadiusTuning
from ..solver.convex.friction_check import FrictionCheck
from ..solver.frame_forces import ERROR_PARTS, MEMBERS, FrameForces
from ..solver.kinematics.mean_field import FLUCTUATION_EDGES
from ..solver.kinematics.sequence_kinematics import SequenceKinematics
from ..solver.kinematics.spatial_correlation import DISTANCE_EDGES
from ..solver.nlgs.start_residuals import COLD_SWEEPS
from ..solver.quantity import DeclaredField, Quantity, quantities
from ..solver.statistics.force_statistics import FORCE_EDGES, MOBILISATION_EDGES
from ..solver.statistics.frame_statistics import FrameStatistics
from ..tracks import Tracks, WallTracks

SCHEMA_VERSION = 2
SCHEMA = "schema_version"
RAGGED = (
    "contact",
    "sweep",
    "kept_sweep",
)  # dimensions whose length differs between frames: their rows are concatenated over frames

# The class behind each part of a file.
PARTS: dict[str, type] = {
    "tracks": Tracks,
    "walls": WallTracks,
    "grains": Grains,
    "frames": FrameForces,
    "statistics": FrameStatistics,
    "calibration": Calibration,
    "boundary": Boundary,
    "lens": CameraDistortion,
    "friction_check": FrictionCheck,
    "radius_tuning": RadiusTuning,
    "kinematics": SequenceKinematics,
    "fringes": FringePressures,
}
PER_FRAME = ("frames", "statistics")  # parts with one object per frame
GROUP_OF_PART = {"contacts": "contacts", "history": "sweeps"}  # nested parts of a frame: attribute and group


@dataclass(frozen=True, slots=True)
class Entry:
    """One dataset."""

    path: str
    dims: tuple[str, ...]
    dtype: np.dtype  # object: text
    quantity: Quantity
    absent: Any  # value where a file has no such dataset, or None
    part: str  # of PARTS; empty: offsets of rows
    attribute: str  # of the part's class, dotted where it is nested

    @property
    def name(self) -> str:
        return self.attribute.rsplit(".", 1)[-1]


@dataclass(frozen=True, slots=True)
class Dimension:
    """The meaning of a dimension's rows, and their labels: fixed, those of a dataset, or none."""

    meaning: str
    labels: tuple[str, ...] | Array | None = None
    labelled_by: str = ""  # path of a dataset


def _middles(edges: Array) -> Array:
    return 0.5 * (edges[1:] + edges[:-1])


DIMENSIONS = {
    "frame": Dimension("frames of the run, from 0"),
    "frame_edge": Dimension("limits of frames: the rows of frame k are offset[k] : offset[k + 1]"),
    "grain": Dimension("grains, labelled by their names", labelled_by="grains/id"),
    "wall": Dimension("walls, labelled by their names", labelled_by="walls/name"),
    "contact": Dimension("contacts, frame after frame; contacts/offset has the rows of each frame"),
    "sweep": Dimension("measured sweeps, frame after frame; sweeps/offset has the rows of each frame"),
    "kept_sweep": Dimension(
        "sweeps with stored forces, frame after frame; sweeps/recorded_offset has the rows of each frame"
    ),
    "kept_force": Dimension("contacts of each stored sweep, sweep after sweep, frame after frame"),
    "xy": Dimension("components of a vector", ("x", "y")),
    "axis": Dimension("second components of a tensor", ("x", "y")),
    "end": Dimension("ends of a wall"),
    "lattice": Dimension("vectors of the periodic cell", ("a", "b")),
    "member": Dimension("ensemble members: chains and convex programs", MEMBERS),
    "component": Dimension("components of a contact's force", ("fn", "ft")),
    "anisotropy": Dimension("kinds of anisotropy", ("contact", "branch", "normal", "tangential")),
    "error_part": Dimension("sources of the error of the forces", ERROR_PARTS),
    "force_bin": Dimension("bins of f / ⟨f⟩, labelled by their middles", _middles(FORCE_EDGES)),
    "mobilisation_bin": Dimension("bins of |f_t| / (μ f_n), labelled by their middles", _middles(MOBILISATION_EDGES)),
    "strain_window": Dimension("windows of 1, 2, 4 … photographs"),
    "fluctuation_bin": Dimension(
        "bins of fluctuations over their rms, labelled by middles", _middles(FLUCTUATION_EDGES)
    ),
    "distance_bin": Dimension(
        "bins of distances in mean diameters, labelled by their middles", _middles(DISTANCE_EDGES)
    ),
    "lens_term": Dimension("terms of the camera's distortion", TERMS),
    "fringe_knot": Dimension("points of the curve from the fringes to the forces on a disc, ascending"),
    "size_class": Dimension("sizes of the grains, ascending, where their radii have classes"),
    "radius_change": Dimension("tested changes of radius"),
    "friction_trial": Dimension("tested coefficients of friction"),
    "cold_sweep": Dimension("sweeps from zero forces", COLD_SWEEPS.astype(np.float64)),
}


def _rows(path: str, dims: str, meaning: str) -> Entry:
    quantity = Quantity(meaning, dims=dims, essential=path == "contacts/offset", absent=None)
    return Entry(path, tuple(dims.split()), np.dtype(np.int64), quantity, None, "", path)


CONTACT_OFFSET = _rows("contacts/offset", "frame_edge", "rows of contacts")
SWEEP_COUNT = _rows("sweeps/count", "frame", "number of sweeps")
SWEEP_OFFSET = _rows("sweeps/offset", "frame_edge", "rows of measured sweeps")
SWEEP_NUMBER = _rows("sweeps/number", "sweep", "index of the sweep in its frame, from 0")
KEPT_OFFSET = _rows("sweeps/recorded_offset", "frame_edge", "rows of sweeps with stored forces")
ROWS = (CONTACT_OFFSET, SWEEP_COUNT, SWEEP_OFFSET, SWEEP_NUMBER, KEPT_OFFSET)


@cache
def entries(*parts: str) -> tuple[Entry, ...]:
    """Return the datasets of parts (default: all); where two parts have the same path, that of the later part."""
    found: dict[str, Entry] = {} if parts else {each.path: each for each in ROWS}
    for part in parts or PARTS:
        for each in _gather(part, PARTS[part], part, ""):
            unknown = [name for name in each.dims if name not in DIMENSIONS]
            if unknown:
                raise ValueError(f"dimension {unknown[0]} of {each.path} is not among DIMENSIONS")
            found[each.path] = each
    return tuple(found.values())


def _gather(part: str, kind: type, group: str, prefix: str) -> Iterator[Entry]:
    for declared in quantities(kind):
        dims = tuple(declared.quantity.dims.split())
        if part in PER_FRAME:
            dims = _dims_over_frames(dims)
        path = declared.quantity.path or f"{_group(declared, group)}/{declared.name}"
        attribute = f"{prefix}{declared.name}"
        yield Entry(path, dims, declared.dtype, declared.quantity, declared.absent, part, attribute)
    for name, below in _nested(kind):
        yield from _gather(part, below, GROUP_OF_PART.get(name, f"{group}/{name}"), f"{prefix}{name}.")


@cache
def _nested(kind: type) -> tuple[tuple[str, type], ...]:
    return tuple((name, hint) for name, hint in get_type_hints(kind).items() if is_dataclass(hint))  # type: ignore[misc]


def _group(declared: DeclaredField, group: str) -> str:
    """Return the group of a field: columns of contacts go to `contacts`, those in newtons to `forces`."""
    if group != "frames" or declared.quantity.dims.split()[:1] != ["contact"]:
        return group
    return "forces" if declared.quantity.unit == "N" else "contacts"


def _dims_over_frames(dims: tuple[str, ...]) -> tuple[str, ...]:
    """Return the dimensions of a field over all frames."""
    if dims == ("kept_sweep", "contact"):
        return ("kept_force",)
    return dims if dims[:1] and dims[0] in RAGGED else ("frame", *dims)


@dataclass(frozen=True, slots=True)
class Attribute:
    """An attribute of the file, or of one of its datasets."""

    name: str
    kind: str
    meaning: str
    of: tuple[str, ...] = ()  # paths of datasets; empty: the file
    since: int = 1


DEVIATIONS = ("forces/fn_sd", "forces/ft_sd")
ATTRIBUTES = (
    Attribute(SCHEMA, "integer", "version of this table"),
    Attribute("rodsight_version", "text", "version of Rodsight that wrote the file"),
    Attribute("created", "text", "time of writing, ISO 8601, UTC"),
    Attribute("name", "text", "name of the experiment"),
    Attribute(
        "fingerprint",
        "text",
        "SHA-256 of the input, of the settings that affect the results, of the code and of the libraries",
    ),
    Attribute("inputs", "text", "SHA-256 of the input and the settings alone, whatever the code"),
    Attribute("code", "text", "SHA-256 of all sources of the program that the results depend on"),
    Attribute("libraries", "text", "versions of numpy, numba, scipy, OpenCV and h5py by name, JSON"),
    Attribute("experiment", "text", "name of the experiment file"),
    Attribute("frames", "two integers", "frames of the experiment in the file: first, and end or −1"),
    Attribute("configuration", "text", "the resolved configuration, TOML"),
    Attribute("friction", "number", "coefficient of friction used"),
    Attribute("base_friction", "number", "coefficient of friction of the base that was used, 0: none", since=2),
    Attribute("diagnosis", "text", "causes of wrong forces that the evidence supports, JSON", since=2),
    Attribute("source", "text", "method of the standard deviation", DEVIATIONS),
    Attribute("ensemble_size", "integer", "number of resampled sequences behind it, 0: none", DEVIATIONS),
    Attribute("member", "texts", "names of the ensemble members", ("members/force",)),
)


def unit_of(path: str) -> str:
    """Return the unit of a dataset; empty: none."""
    return _BY_PATH[path].quantity.unit


_BY_PATH = {each.path: each for each in entries()}
