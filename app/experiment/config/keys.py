"""The keys of the experiment file as a person looks them up: name, kind, unit, default, meaning."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from typing import Any

from .section import Section

ANY = "NAME"  # stands for a name that the user chooses, such as that of a wall
LIKE = 0.7  # similarity from which on a key may have been meant


@dataclass(frozen=True, slots=True)
class Key:
    """One key of the experiment file."""

    name: str  # with its sections: solver.kappa
    kind: str  # what may stand there, in words
    unit: str  # empty: none
    default: str  # as TOML; empty: none, or it must be given
    required: bool
    meaning: str

    @property
    def section(self) -> str:
        return self.name.rpartition(".")[0]

    @property
    def summary(self) -> str:
        """The first sentence of its meaning, without the full stop, with its unit."""
        first = self.meaning.partition(". ")[0].rstrip(".")
        return f"{first} [{self.unit}]" if self.unit else first


@dataclass(frozen=True, slots=True)
class KeySection:
    """A table of the experiment file with the keys that stand in it."""

    name: str  # empty: the file itself
    meaning: str
    keys: tuple[Key, ...]


@cache
def list_sections(file: type[Section]) -> tuple[KeySection, ...]:
    """Every section of the model, the file itself first."""
    schema = file.model_json_schema()
    return tuple(_walk(schema, schema, ""))


def list_keys(file: type[Section]) -> list[Key]:
    """Every key of the model."""
    return [key for section in list_sections(file) for key in section.keys]


def find_key(file: type[Section], name: str) -> Key | None:
    """The key of this name, a wall's own name or a place in a list included; None: there is none."""
    keys = {key.name: key for key in list_keys(file)}
    parts = name.split(".")
    while parts:
        for candidate in (".".join(parts), _with_any_name(parts)):
            if candidate in keys:
                return keys[candidate]
        parts = parts[:-1]
    return None


def nearest_key(file: type[Section], name: str) -> str | None:
    """The key, or the section, that was probably meant."""
    names = [key.name for key in list_keys(file)]
    names += [section.name for section in list_sections(file) if section.name]
    parts = name.split(".")
    if len(parts) == 3:  # a wall's own name is nobody's mistake
        names = [each.replace(ANY, parts[1]) for each in names]
    last = {each.rpartition(".")[2]: each for each in reversed(names)}
    if parts[-1] in last:  # of another section
        return last[parts[-1]]
    near = get_close_matches(name, names, n=1, cutoff=LIKE)
    if near:
        return near[0]
    near = get_close_matches(parts[-1], last, n=1, cutoff=LIKE)
    return last[near[0]] if near else None


def _with_any_name(parts: list[str]) -> str:
    return ".".join([parts[0], ANY, *parts[2:]]) if len(parts) > 2 else ""


def _walk(schema: dict[str, Any], part: dict[str, Any], prefix: str) -> Iterator[KeySection]:
    keys, inner = [], []
    for name, told in part["properties"].items():
        path = f"{prefix}{name}"
        table, repeated = _table(schema, told)
        if table is not None:
            inner.append((f"{prefix}{ANY}." if repeated else f"{path}.", table))
        else:
            default = _toml(told["default"]) if told.get("default") is not None else ""
            required = name in part.get("required", ())
            keys.append(Key(path, _kind(told), told.get("unit", ""), default, required, told["description"]))
    yield KeySection(prefix.rstrip("."), part.get("description", ""), tuple(keys))
    for path, table in inner:
        yield from _walk(schema, table, path)


def _table(schema: dict[str, Any], told: dict[str, Any]) -> tuple[dict[str, Any] | None, bool]:
    """The schema of the table that a key stands for, and whether there are many of it by name."""
    for choice in told.get("anyOf", [told]):
        repeated = isinstance(choice.get("additionalProperties"), dict)
        reference = (choice["additionalProperties"] if repeated else choice).get("$ref")
        if reference is not None:
            return schema["$defs"][reference.rpartition("/")[2]], repeated
    return None, False


def _kind(told: dict[str, Any]) -> str:
    """What may stand there, in words."""
    if "anyOf" in told:
        return " or ".join(_kind(choice) for choice in told["anyOf"] if choice.get("type") != "null")
    if "enum" in told:
        return " or ".join(f'"{each}"' for each in told["enum"])
    what = told.get("type")
    if what == "array":
        if "prefixItems" in told:
            return f"[{', '.join(_kind(item) for item in told['prefixItems'])}]"
        return f"list of {_kind(told['items'])}"
    if what == "object":
        return f"table of {_kind(told['additionalProperties'])}"
    if what in ("number", "integer"):
        word = "number" if what == "number" else "whole number"
        bounds = [f"{sign} {told[name]:g}" for name, sign in _BOUNDS if name in told]
        return " ".join([word, ", ".join(bounds)]).strip()
    return {"boolean": "true or false", "string": "text"}[str(what)]


_BOUNDS = (("minimum", "≥"), ("exclusiveMinimum", ">"), ("maximum", "≤"), ("exclusiveMaximum", "<"))


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    return "{}" if value == {} else str(list(value)) if isinstance(value, list | tuple) else f"{value}"
