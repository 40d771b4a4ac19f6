"""Rodsight: contact forces inside a granular packing of rods, from photographs.

This folder is installed as the package `rodsight`, the one import that is promised. Imports inside it are relative,
so that a user's own app.py is never taken for it.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .kernel_cache import find_room_for_kernels

if TYPE_CHECKING:
    __version__: str
    from .errors import InputError
    from .notebook.run import Run, run
    from .notebook.run import open_run as open
    from .notebook.solve import solve

__all__ = ["InputError", "Run", "__version__", "open", "run", "solve"]


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
find_room_for_kernels(Path(sys.modules["solver"].__file__ or "").parent)

# Public names, loaded when they are first asked for: their module, and what they are called there.
_LAZY = {
    "InputError": ("errors", "InputError"),
    "Run": ("notebook.run", "Run"),
    "open": ("notebook.run", "open_run"),
    "run": ("notebook.run", "run"),
    "solve": ("notebook.solve", "solve"),
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from .version import version_in_use

        value = version_in_use()
    elif name in _LAZY:
        module, attribute = _LAZY[name]
        value = getattr(import_module(f".{module}", __name__), attribute)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
