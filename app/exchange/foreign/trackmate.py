"""Spots of TrackMate: its CSV table with four header rows, its session file, and its simple tracks.

Lengths are in the picture's calibrated unit, y down. A spot without a track is not a tracked grain.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from ...experiment.reading.tables import Table
from ...process.errors import InputError
from .foreign_table import read_foreign, read_text
from .observations import Observations
from .tracker_tables import observe_table

COLUMNS = {"frame": "FRAME", "id": "TRACK_ID", "x": "POSITION_X", "y": "POSITION_Y", "radius": "RADIUS"}
METRES = {
    "micron": 1e-6, "microns": 1e-6, "µm": 1e-6, "μm": 1e-6, "um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "nm": 1e-9,
    "inch": 0.0254, "inches": 0.0254,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Spots:
    """Spots and their unit of length."""

    observed: Observations
    unit: float | None  # [m]; None: a pixel, or unknown


def read_trackmate(file: Path, columns: Mapping[str, str]) -> Spots:
    """Read any of the three formats. Raises InputError naming file, row and value."""
    chosen = {**COLUMNS, **columns}
    text = read_text(file)
    if text.lstrip()[:1] == "<":
        return _read_xml(file, text, chosen)
    table = read_foreign(file, [chosen[role] for role in ("frame", "id", "x", "y")], [chosen["radius"]])
    if chosen["radius"] not in table.names:
        del chosen["radius"]
    written = table.text(chosen["frame"])
    units, extra = "", 0
    while extra < min(len(table), 3) and not written[extra].lstrip("+-").replace(".", "").isdigit():
        units = table.text(chosen["x"])[extra].strip("() ") or units
        extra += 1
    body = table.select([row >= extra for row in range(len(table))])
    if not len(body):
        raise InputError(file, "", "has a header but no spots")
    return Spots(_unbranched(file, observe_table(body, chosen)), METRES.get(units))


def _read_xml(file: Path, text: str, chosen: dict[str, str]) -> Spots:
    if "<!ENTITY" in text:
        raise InputError(file, "", "declares entities, which TrackMate does not: it is refused")
    try:
        root = ElementTree.fromstring(text.encode("utf-8"))
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # the last: of an encoding
        raise InputError(file, "", f"is not XML: {error}") from None
    if root.tag == "Tracks":
        return _simple_tracks(file, root)
    model = root.find("Model")
    if model is None:
        raise InputError(file, "", f"is XML of <{root.tag}>, not of TrackMate")
    track_of: dict[str, str] = {}
    for track in model.iterfind("AllTracks/Track"):
        for edge in track.iterfind("Edge"):
            for end in ("SPOT_SOURCE_ID", "SPOT_TARGET_ID"):
                track_of[edge.get(end, "")] = track.get("TRACK_ID", "")
    kept = {each.get("TRACK_ID", "") for each in model.iterfind("FilteredTracks/TrackID")}
    rows = [
        {**spot.attrib, "TRACK_ID": track if (track := track_of.get(spot.get("ID", ""), "")) in kept else ""}
        for spot in model.iterfind("AllSpots/SpotsInFrame/Spot")
        if spot.get("VISIBILITY", "1") != "0"
    ]
    return Spots(_observe(file, rows, chosen), METRES.get(model.get("spatialunits", "")))


def _simple_tracks(file: Path, root: ElementTree.Element) -> Spots:
    """Read tracks without features of spots: particles are numbered and have no radius."""
    rows = [
        {
            "FRAME": each.get("t", ""),
            "TRACK_ID": str(k),
            "POSITION_X": each.get("x", ""),
            "POSITION_Y": each.get("y", ""),
        }
        for k, particle in enumerate(root.iterfind("particle"))
        for each in particle.iterfind("detection")
    ]
    return Spots(_observe(file, rows, dict(COLUMNS)), METRES.get(root.get("spaceUnits", "")))


def _observe(file: Path, rows: Iterable[Mapping[str, str]], chosen: dict[str, str]) -> Observations:
    rows = list(rows)
    if not rows:
        raise InputError(file, "", "has no spots")
    if not any(chosen["radius"] in row for row in rows):
        del chosen["radius"]
    for number, row in enumerate(rows, start=1):
        missing = [name for name in (chosen["frame"], chosen["x"], chosen["y"]) if not row.get(name)]
        if missing:
            raise InputError(file, f"spot {number}", f"has no {missing[0]}")
    columns = {name: [row.get(name, "") for row in rows] for name in chosen.values()}
    table = Table(file, columns, list(range(1, len(rows) + 1)), of="spot")
    return _unbranched(file, observe_table(table, chosen))


def _unbranched(file: Path, observed: Observations) -> Observations:
    """Return the observations; raises InputError for a track with two spots in a frame, such as dividing cells."""
    known: set[tuple[int, str]] = set()
    for frame, name in zip(observed.frame.tolist(), observed.name, strict=True):
        if (frame, name) in known:
            raise InputError(
                file, f"track {name}",
                f"has two spots in frame {frame}: it splits or merges, which rods do not. Track without splitting, "
                "or unlink them in TrackScheme",
            )  # fmt: skip
        known.add((frame, name))
    return observed
