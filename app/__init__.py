"""Rodsight: contact forces inside a granular packing of rods, from photographs.

The folder app/ is installed as the package `rodsight` and solver/ as `rodsight.solver`. All imports inside are
relative, so a user's own app.py or solver.py can neither replace them nor be replaced by them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .process.kernel_cache import choose_kernel_cache

if TYPE_CHECKING:
    __version__: str
    from .notebook.comparisons import compare, review, score
    from .notebook.experiments import check, follow, init, track
    from .notebook.files import export, import_table
    from .notebook.made_runs import open_run as open
    from .notebook.made_runs import run
    from .notebook.run import Run
    from .notebook.solve import solve
    from .notebook.studies import campaign, sensitivity
    from .notebook.what_if import what_if
    from .process.errors import InputError, RunError

__all__ = [
    "InputError", "Run", "RunError", "__version__", "campaign", "check", "compare", "export", "follow", "import_table",
    "init", "open", "review", "run", "score", "sensitivity", "solve", "track", "what_if",
]  # fmt: skip


choose_kernel_cache()

# Public names, loaded at first access: their module, and their name there.
_LAZY = {
    "InputError": ("process.errors", "InputError"),
    "Run": ("notebook.run", "Run"),
    "RunError": ("process.errors", "RunError"),
    "campaign": ("notebook.studies", "campaign"),
    "check": ("notebook.experiments", "check"),
    "compare": ("notebook.comparisons", "compare"),
    "export": ("notebook.files", "export"),
    "follow": ("notebook.experiments", "follow"),
    "import_table": ("notebook.files", "import_table"),
    "init": ("notebook.experiments", "init"),
    "open": ("notebook.made_runs", "open_run"),
    "review": ("notebook.comparisons", "review"),
    "run": ("notebook.made_runs", "run"),
    "score": ("notebook.comparisons", "score"),
    "sensitivity": ("notebook.studies", "sensitivity"),
    "solve": ("notebook.solve", "solve"),
    "track": ("notebook.experiments", "track"),
    "what_if": ("notebook.what_if", "what_if"),
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from .process.version import version_in_use

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
