"""Conversion of settings given in Python to the strings of `--set`."""

from __future__ import annotations

from collections.abc import Mapping

import tomli_w


def as_strings(settings: Mapping[str, object]) -> list[str]:
    """Return KEY=VALUE of every setting, the value as TOML."""
    return [f"{key}={_as_toml(value)}" for key, value in settings.items()]


def _as_toml(value: object) -> str:
    return tomli_w.dumps({"value": value}).partition("=")[2].strip()
