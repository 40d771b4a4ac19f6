"""Fitted constants of the assessment, read from fitted.toml, which names command, data and date of every fit."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

FILE = Path(__file__).with_name("fitted.toml")


def load_fitted() -> dict[str, dict[str, Any]]:
    """Read all tables.

    Returns
    -------
    dict
        Constants by table and name: ``load_fitted()["trust"]["disagreement"]``.
    """
    return tomllib.loads(FILE.read_text(encoding="utf-8"))


FITTED = load_fitted()
