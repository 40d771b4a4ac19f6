"""Change values of an experiment file, and keep everything else of it: comments, order, blank lines, writing."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, MutableMapping
from typing import Any

import tomli_w
import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Table

from ...experiment.config.dotted_keys import with_values

MISSING = object()  # value of a key that is not there


def set_values(content: str, keys: Mapping[str, Any]) -> str:
    """Return an experiment file with dotted keys set; a value None removes its key.

    Everything else in the file stays, character by character. Where its way of writing does not allow that, all of
    it is written anew, below its first comment.
    """
    wanted = with_values(tomllib.loads(content), keys)
    try:
        document = tomlkit.parse(content)
        for key, value in keys.items():
            *path, last = key.split(".")
            _set(_place(document, path), last, value)
        edited = tomlkit.dumps(document)
        if tomllib.loads(edited) == wanted:
            return edited
    except (TOMLKitError, ValueError, KeyError, TypeError, AttributeError, IndexError):
        pass
    return _first_comment(content) + tomli_w.dumps(wanted)


def _first_comment(content: str) -> str:
    """Return the comment with which a file begins."""
    lines = content.splitlines(keepends=True)
    count = next((k for k, line in enumerate(lines) if not line.startswith("#")), len(lines))
    return "".join(lines[:count])


def _place(document: MutableMapping[str, Any], path: list[str]) -> MutableMapping[str, Any]:
    place = document
    for part in path:
        if part not in place:
            place[part] = tomlkit.table()
        place = place[part]
    return place


def _set(place: MutableMapping[str, Any], key: str, value: Any) -> None:
    """Set one value; of a table, only what differs."""
    if value is None:
        place.pop(key, None)
        return
    former = place.get(key, MISSING)
    if former == value:
        return
    if isinstance(value, Mapping) and isinstance(former, MutableMapping):
        for name in [name for name in former if name not in value]:
            del former[name]
        for name, each in value.items():
            _set(former, name, each)
    elif former is MISSING and isinstance(place, Table) and not isinstance(value, Mapping):
        _append(place, key, value)
    else:
        place[key] = value


def _append(table: Table, key: str, value: Any) -> None:
    """Add a key after the last one of a table, not below the blank lines that separate it from the next."""
    names = [name for name, each in table.value.body if name is not None and not isinstance(each, Table)]
    insert = getattr(table.value, "_insert_after", None)
    if names and insert is not None:
        insert(names[-1], key, value)
    else:
        table[key] = value
