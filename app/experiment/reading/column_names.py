"""Columns under other names: refused with the name that is meant, since an ignored column is a lost quantity."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ...process.errors import InputError

# Names that other programs use for a column.
OTHER_NAMES = {
    "theta": ("angle", "rotation", "orientation", "phi", "alpha", "rot", "yaw", "rz", "heading"),
    "frame": ("t", "image", "photo", "photograph", "step", "index"),
    "id": ("grain", "particle", "rod", "disc", "label", "track", "particle_id", "track_id"),
    "x": ("xc", "posx", "pos_x", "cx", "x_center", "x_centre"),
    "y": ("yc", "posy", "pos_y", "cy", "y_center", "y_centre"),
    "radius": ("r", "rad"),
    "time": ("t", "seconds", "timestamp"),
    "wall": ("name", "plate", "bar"),
}
UNITS = {"theta": " (in rad, counter-clockwise)", "time": " (in s)"}
UNIT = re.compile(r"[\s_]*(?:\[[^\]]*\]|\([^)]*\)|_?(?:m|mm|px|rad|deg|degrees))$")


def refuse_likely_names(file: Path, header: Sequence[str], columns: Sequence[str], optional: Sequence[str]) -> None:
    """Raise InputError where a column is missing and another one is likely to be meant."""
    for name in (*columns, *optional):
        if name in header:
            continue
        found = likely_name(name, [each for each in header if each not in (*columns, *optional)])
        if found is not None:
            cure = f"rename it to {name}{UNITS.get(name, '')}"
            if name in optional:
                cure += f"; where {name} is unknown, add an empty column {name}"
            raise InputError(file, f"column {found}", f"looks like {name}, which is missing: {cure}")


def likely_name(name: str, others: Sequence[str]) -> str | None:
    """Return the one of other names that is likely to stand for a name; None: none is."""
    known = (name, *OTHER_NAMES.get(name, ()))
    for other in others:
        plain = other.strip().casefold()
        if plain in known or UNIT.sub("", plain) in known:
            return other
    return None
