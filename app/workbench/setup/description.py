"""Walls, rods and tables of an experiment as the page shows them."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from ...drawing.wall_marks import wall_mark
from ...experiment.experiment import GrainGuess
from .edits import TABLES
from .validation import ValidationResult
from .walls.circles import corner_names, discs_of


def table_names(data: dict[str, Any]) -> list[str]:
    """Return the names of the tables in an experiment file, valid or not."""
    names = []
    for section in data.values():
        if isinstance(section, dict):
            names += [value for value in section.values() if isinstance(value, str) and value.endswith(".csv")]
    return names


def describe_walls(found: ValidationResult) -> list[dict[str, Any]]:
    """List the walls of the first photograph, places in pixels."""
    if found.walls is None or found.scale is None:
        return []
    ends = found.scale.to_pixels(found.walls.endpoints[0])
    plates = found.data.get("walls", {})
    circles, corners = {each.name: asdict(each) for each in discs_of(found)}, corner_names(found)
    listed = []
    walls = zip(found.walls.name, ends.tolist(), found.walls.pressure.tolist(), strict=True)
    for wall, (name, line, pressure) in enumerate(walls):
        plate, mark = plates.get(name), wall_mark(wall)
        listed.append({
            "name": name, "line": line, "circle": circles.get(name), "corner": name in corners,
            "pressure": None if pressure != pressure else pressure,
            "ends": plate.get("ends", "auto") if isinstance(plate, dict) else "auto",
            "colour": f"#{bytes(mark.colour).hex()}", "dash": mark.dash,
        })  # fmt: skip
    return listed


def coarse_size(rods: GrainGuess | None) -> tuple[int, int] | None:
    """Return number and size of the rods, coarse: a measurement on some of them stays valid when a rod moves."""
    return None if rods is None or not len(rods.id) else (len(rods.id) // 10, round(float(np.median(rods.radius))))


def describe_tables(found: ValidationResult) -> dict[str, Any]:
    """Return the tables of other programs that the experiment names, by their content; None: no such table."""
    sections = {section: found.data.get(section) for section, *_ in TABLES.values()}
    return {
        name: given.get(name) if isinstance(given := sections[section], dict) else None
        for name, (section, *_) in TABLES.items()
    }


def describe_rods(found: ValidationResult) -> dict[str, Any] | None:
    """Return the rods of the first photograph by columns, in pixels; None: there are none."""
    rods = found.rods
    if rods is None:
        return None
    return {
        "id": rods.id.tolist(), "x": np.round(rods.x, 2).tolist(), "y": np.round(rods.y, 2).tolist(),
        "r": np.round(rods.radius, 3).tolist(),
    }  # fmt: skip
