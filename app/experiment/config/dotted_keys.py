"""Values of an experiment file by dotted keys, such as walls.top.pressure."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any


def leaves(data: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Return every value that is no table, by its dotted key."""
    found: dict[str, Any] = {}
    for name, value in data.items():
        found |= leaves(value, f"{before}{name}.") if isinstance(value, Mapping) else {f"{before}{name}": value}
    return found


def with_values(data: dict[str, Any], keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of the values of a file with dotted keys set; a value None removes its key."""
    data = deepcopy(data)
    for key, value in keys.items():
        *path, last = key.split(".")
        place = data
        for part in path:
            place = place.setdefault(part, {})
        if value is None:
            place.pop(last, None)
        else:
            place[last] = value
    return data
