"""The keys of the experiment file for documentation and errors: name, kind, unit, default, meaning."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from typing import Any

from .section import Section

ANY = "NAME"  # placeholder of a name chosen by the user, such as that of a wall
MIN_SIMILARITY = 0.7  # of a key that the user may have meant


@dataclass(frozen=True, slots=True)
class Key:
    """One key of the experiment file."""

    name: str  # with its sections: solver.kappa
    kind: str  # its allowed values, in words
    unit: str  # empty: none
    default: str  # as TOML; empty: none, or it must be given
    required: bool
    meaning: str

    @property
    def summary(self) -> str:
        """First sentence of the meaning without the full stop, with the unit."""
        first = self.meaning.partition(". ")[0].rstrip(".")
        return f"{first} [{self.unit}]" if self.unit else first


@dataclass(frozen=True, slots=True)
class KeySection:
    """A table of the experiment file with its keys."""

    name: str  # empty: the file itself
    meaning: str
    keys: tuple[Key, ...]


@cache
def list_sections(file: type[Section]) -> tuple[KeySection, ...]:
    """Return all sections of the model, the file itself first."""
    schema = file.model_json_schema()
    return tuple(_walk(schema, schema, ""))


def list_keys(file: type[Section]) -> list[Key]:
    """Return all keys of the model."""
    return [key for section in list_sections(file) for key in section.keys]


def find_key(file: type[Section], name: str) -> Key | None:
    """Return the key of this name, which may include the name of a wall or an index of a list; None: no such key."""
    keys = {key.name: key for key in list_keys(file)}
    parts = name.split(".")
    while parts:
        for candidate in (".".join(parts), _with_any_name(parts)):
            if candidate in keys:
                return keys[candidate]
        parts = parts[:-1]
    return None


def nearest_key(file: type[Section], name: str) -> str | None:
    """Return the key or section with the most similar name, None where no name is similar."""
    names = [key.name for key in list_keys(file)]
    names += [section.name for section in list_sections(file) if section.name]
    parts = name.split(".")
    if len(parts) == 3:  # the name of a wall is free
        names = [each.replace(ANY, parts[1]) for each in names]
    last = {each.rpartition(".")[2]: each for each in reversed(names)}
    if parts[-1] in last:  # the key of another section
        return last[parts[-1]]
    others = [each for each in names if each != name.rpartition(".")[0]]  # its own section is no other name for a key
    similar = get_close_matches(name, others, n=1, cutoff=MIN_SIMILARITY)
    if similar:
        return similar[0]
    similar = get_close_matches(parts[-1], last, n=1, cutoff=MIN_SIMILARITY)
    return last[similar[0]] if similar else None


def keys_beside(file: type[Section], name: str) -> list[str]:
    """Return the keys of the section that a key, known or not, stands in, without the section's name."""
    section = name.rpartition(".")[0]
    inside = [key.name.removeprefix(f"{section}.") for key in list_keys(file) if key.name.startswith(f"{section}.")]
    return [each for each in inside if "." not in each] if section else []


def _with_any_name(parts: list[str]) -> str:
    return ".".join([parts[0], ANY, *parts[2:]]) if len(parts) > 2 else ""


def _walk(schema: dict[str, Any], part: dict[str, Any], prefix: str) -> Iterator[KeySection]:
    keys, inner = [], []
    for name, entry in part["properties"].items():
        path = f"{prefix}{name}"
        table, repeated = _table(schema, entry)
        if table is not None:
            inner.append((f"{prefix}{ANY}." if repeated else f"{path}.", table))
        else:
            default = _toml(entry["default"]) if entry.get("default") is not None else ""
            required = name in part.get("required", ())
            keys.append(Key(path, _kind(entry), entry.get("unit", ""), default, required, entry["description"]))
    yield KeySection(prefix.rstrip("."), part.get("description", ""), tuple(keys))
    for path, table in inner:
        yield from _walk(schema, table, path)


def _table(schema: dict[str, Any], entry: dict[str, Any]) -> tuple[dict[str, Any] | None, bool]:
    """Return the schema of the table at a key, and whether the table is repeated under names."""
    for choice in entry.get("anyOf", [entry]):
        repeated = isinstance(choice.get("additionalProperties"), dict)
        reference = (choice["additionalProperties"] if repeated else choice).get("$ref")
        if reference is not None:
            return schema["$defs"][reference.rpartition("/")[2]], repeated
    return None, False


def _kind(entry: dict[str, Any]) -> str:
    """Return the allowed values in words."""
    if "anyOf" in entry:
        return " or ".join(_kind(choice) for choice in entry["anyOf"] if choice.get("type") != "null")
    if "const" in entry:
        return f'"{entry["const"]}"'
    if "enum" in entry:
        return " or ".join(f'"{each}"' for each in entry["enum"])
    kind = entry.get("type")
    if kind == "array":
        if "prefixItems" in entry:
            return f"[{', '.join(_kind(item) for item in entry['prefixItems'])}]"
        return f"list of {_kind(entry['items'])}"
    if kind == "object":
        return f"table of {_kind(entry['additionalProperties'])}"
    if kind in ("number", "integer"):
        word = "number" if kind == "number" else "whole number"
        bounds = [f"{sign} {entry[name]:g}" for name, sign in _BOUNDS if name in entry]
        return " ".join([word, ", ".join(bounds)]).strip()
    return {"boolean": "true or false", "string": "text"}[str(kind)]


_BOUNDS = (("minimum", "≥"), ("exclusiveMinimum", ">"), ("maximum", "≤"), ("exclusiveMaximum", "<"))


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    return "{}" if value == {} else str(list(value)) if isinstance(value, list | tuple) else f"{value}"
