"""Rodsight: contact forces inside a granular packing of rods, from photographs.

This folder is installed as the package `rodsight`, the one import that is promised. Imports inside it are relative,
so that a user's own app.py is never taken for it.
"""

from __future__ import annotations

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

__version__ = "0.1.0"


def _load_own_solver() -> None:
    """Load the solver that lies beside this folder: a user's own solver.py must not be taken for it."""
    room = Path(__file__).resolve().parent.parent / "solver"
    known = sys.modules.get("solver")
    if known is not None and Path(known.__file__ or "").resolve().parent != room:
        raise ImportError(f"another module is loaded as 'solver' ({known.__file__}): import rodsight before it")
    if known is None:
        spec = spec_from_file_location("solver", room / "__init__.py", submodule_search_locations=[str(room)])
        assert spec is not None
        assert spec.loader is not None
        sys.modules["solver"] = solver = module_from_spec(spec)
        spec.loader.exec_module(solver)


_load_own_solver()
