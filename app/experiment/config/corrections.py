"""What to write instead of a wrong value or line of experiment.toml."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from difflib import get_close_matches
from typing import Any

from .keys import MIN_SIMILARITY

# Factors to the units of the keys; spellings without superscripts are compared (kg/m3 for kg/m³).
_LENGTH = {"km": 1e3, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6, "um": 1e-6, "nm": 1e-9}
_PRESSURE = {
    "pa": 1.0, "n/m2": 1.0, "hpa": 1e2, "mbar": 1e2, "kpa": 1e3, "kn/m2": 1e3, "bar": 1e5, "mpa": 1e6, "n/mm2": 1e6,
    "gpa": 1e9,
}  # fmt: skip
_DENSITY = {"kg/m3": 1.0, "g/cm3": 1e3, "g/ml": 1e3, "kg/l": 1e3, "t/m3": 1e3}
_TIME = {"ms": 1e-3, "s": 1.0, "sec": 1.0, "min": 60.0, "h": 3600.0}
FACTORS = {
    "m": _LENGTH, "Pa": _PRESSURE, "kg/m³": _DENSITY, "s": _TIME, "m/s²": {"m/s2": 1.0, "g": 9.80665}, "px": {"px": 1.0}
}  # fmt: skip
_NUMBER = re.compile(r"([+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?)\s*([^\d\s.,].*)?")
_LINE = re.compile(r"at line (\d+)")
_ASSIGNMENT = re.compile(r"\s*([\w.-]+)\s*[:=]*=[=\s]*([^#]*?)\s*(?:#.*)?")
SOLID_DENSITIES = (10.0, 2.3e4)  # [kg/m³] the lightest foams for packaging; osmium has 22 590
GREATEST_RADIUS = 0.5  # [m] of a rod
DENSITIES_IN_OTHER_UNITS = (1e3, 1e-3)  # g/cm³ and g/m³, as factors to kg/m³
DIGITS = 12  # of a converted number


def read_quantity(text: str, unit: str) -> float | None:
    """Return the number in a text, converted to the key's unit; None: there is none, or its unit is another one."""
    found = _NUMBER.fullmatch(text.strip())
    if found is None:
        return None
    number, spelt = float(found[1].replace(",", ".")), found[2]
    if spelt is None:
        return number
    plain = spelt.strip().replace("^", "").replace("²", "2").replace("³", "3").replace("μ", "µ").replace(" ", "")
    factors = FACTORS.get(unit, {})
    factor = factors.get(plain if unit == "m" else plain.lower())
    return None if factor is None else float(f"{number * factor:.{DIGITS}g}")


def look_like_millimetres(radius: float) -> bool:
    """Whether a radius, which should be in metres, is larger than that of any rod, and plausible in millimetres."""
    return GREATEST_RADIUS < radius < 1e3 * GREATEST_RADIUS


def correct_value(name: str, value: Any, kind: str, unit: str) -> str | None:
    """Return the line to write instead of a wrong value; None: it cannot be guessed.

    Parameters
    ----------
    name
        Key without its section.
    value
        Value that was given.
    kind
        Allowed values in words, as `keys.Key` states them.
    unit
        Unit of the key; empty: none.
    """
    if isinstance(value, bool):
        return None
    if isinstance(value, str):
        choices = {each.lower(): each for each in re.findall(r'"([^"]*)"', kind)}
        near = get_close_matches(value.strip().lower(), choices, n=1, cutoff=MIN_SIMILARITY)
        if near:
            return f'{name} = "{choices[near[0]]}"'
    if kind.startswith("number") and isinstance(value, list) and len(value) == 1:
        return correct_value(name, value[0], kind, unit) or f"{name} = {value[0]!r}"
    number = read_quantity(value, unit) if isinstance(value, str) else value
    if kind.startswith("list of number"):
        numbers = _read_list(value, unit)
        return None if numbers is None else f"{name} = [{', '.join(f'{each!r}' for each in numbers)}]"
    low, high = SOLID_DENSITIES
    if kind.startswith("number") and isinstance(value, str) and number is not None:
        return f"{name} = {number!r}"
    if unit == "kg/m³" and isinstance(number, int | float) and not low <= number <= high:
        right = (float(f"{number * factor:.{DIGITS}g}") for factor in DENSITIES_IN_OTHER_UNITS)
        return next((f"{name} = {each!r}" for each in right if low <= each <= high), None)
    if kind == "text" and name == "name" and isinstance(value, int | float):
        return f'{name} = "{value}"'
    return None


def _read_list(value: Any, unit: str) -> list[float] | None:
    """Return the numbers of a list that is written as a text, perhaps with one unit at its end, or as one number."""
    parts = re.split(r"[,;]\s+", value) if isinstance(value, str) else [value]
    end = re.search(r"[^\d\s.,]+$", parts[-1]) if isinstance(parts[-1], str) else None
    own = "" if end is None else end[0]  # 7, 8, 11 mm
    numbers = [
        read_quantity(each if each.endswith(own) else each + own, unit) if isinstance(each, str) else each
        for each in parts
    ]
    known: list[float] = [each for each in numbers if isinstance(each, float | int)]
    return known if len(known) == len(parts) else None


def explain_line(text: str, error: ValueError | RecursionError, unit_of: Callable[[str], str]) -> str:
    """Describe the fault of a text that is not TOML, with its line and what to write instead.

    Parameters
    ----------
    text
        The file.
    error
        What tomllib raised.
    unit_of
        Function that returns the unit of a key, given with its section.
    """
    place = _LINE.search(str(error))
    lines = text.splitlines()
    row = min(int(place[1]), len(lines)) if place else 0
    if not row:
        return str(error)
    line = lines[row - 1].strip()
    return f"line {row}: {line!r}: {_correct_line(lines, row, line, str(error), unit_of)}"


def _correct_line(lines: list[str], row: int, line: str, error: str, unit_of: Callable[[str], str]) -> str:
    if "Cannot overwrite" in error:
        return "this key is given twice: keep one of both"
    if "Cannot declare" in error:
        return "this section is given twice: write its keys below one heading"
    if line.startswith("["):
        return f"write {line.rstrip(']') + ']'!s}" if line.count("[") > line.count("]") else _plain(error)
    split = _ASSIGNMENT.fullmatch(line)
    if split is None:
        apart = re.fullmatch(r"([\w.-]+)\s*[:\s]\s*(.+)", line)
        return f"write {apart[1]} = {apart[2]}" if apart and _is_toml(f"{apart[1]} = {apart[2]}") else _plain(error)
    name, value = split.groups()
    section = next((each.strip().strip("[]") for each in reversed(lines[: row - 1]) if each.strip()[:1] == "["), "")
    unit = unit_of(f"{section}.{name}".strip("."))
    number = read_quantity(value, unit)
    lines_to_write = [f"{name} = {value}", *([] if number is None else [f"{name} = {number!r}"])]
    if not unit and value[:1] not in "[{" and not set("\"'=") & set(value):  # a quantity with a unit is no text
        lines_to_write.append(f'{name} = "{value}"')
    for right in lines_to_write if value else ():
        if right != line and _is_toml(right):
            return f"write {right}"
    return _plain(error)


def _plain(error: str) -> str:
    text = re.sub(r"\s*\(at [^)]*\)", "", error)
    return text[:1].lower() + text[1:]


def _is_toml(line: str) -> bool:
    try:
        tomllib.loads(line)
    except ValueError:
        return False
    return True
