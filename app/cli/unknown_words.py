"""Unknown commands and kinds of export: refused with what the user probably means."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from typing import get_args

from ..exported_files import ExportKind
from ..process.errors import InputError

# Names of programs and formats for which there is another word.
EXPORTS = {
    **dict.fromkeys(("csv", "table", "excel", "pandas", "dataframe"), "tables RESULTS"),
    **dict.fromkeys(("parquet", "arrow", "feather"), "tables RESULTS --kind parquet"),
    **dict.fromkeys(("paraview", "vtp", "vtm", "pyvista"), "vtk RESULTS"),
    **dict.fromkeys(("graphml", "networkx", "gephi", "igraph"), "graph RESULTS"),
    **dict.fromkeys(("png", "picture", "images"), "pictures RESULTS"),
    **dict.fromkeys(("mp4", "movie", "film", "webm", "gif"), "video RESULTS"),
    **dict.fromkeys(("pdf", "svg", "figure", "plots"), "figures RESULTS"),
}
STORED = ("hdf5", "h5", "netcdf", "xarray")  # formats that results.h5 has already
OPTIONS = ("-h", "--help", "--version", "--completion")  # of the program itself
COMMANDS = {
    "gui": "open", "workbench": "open", "start": "run", "new": "init", "setup": "init", "create": "init",
    "sample": "synth my_test", "demo": "synth my_test", "example": "synth my_test",
    "validate": "check", "plot": "export figures", "diff": "compare", "config": "settings", "manual": "docs",
    "simulate": "synth", "batch": "campaign", "watch": "run EXPERIMENT --follow", "follow": "run EXPERIMENT --follow",
}  # fmt: skip


def refuse_unknown_words(arguments: Sequence[str], commands: Sequence[str]) -> None:
    """Raise InputError where the first argument is no command, or that of `export` no kind of file."""
    word = arguments[0]
    if word.startswith("-") and word not in OPTIONS and not word.startswith("--tyro-"):
        near = get_close_matches(word, OPTIONS, 1)
        hint = f": did you mean `rodsight {near[0]}`?" if near else f": there are {', '.join(OPTIONS)}"
        raise InputError("rodsight", word, f"is not an option without a command{hint}")
    if not word.startswith("-") and word not in commands:
        raise InputError("rodsight", word, f"is not a command{_hint(word, commands, COMMANDS, 'rodsight')}")
    if word != "export" or len(arguments) < 2 or arguments[1].startswith("-"):
        return
    kind, kinds = arguments[1], get_args(ExportKind)
    if kind.lower() in STORED:
        raise InputError("export", kind, "is not needed: results.h5 is HDF5, which xarray.open_datatree opens")
    if kind not in kinds:
        raise InputError("export", kind, f"is not a kind{_hint(kind, kinds, EXPORTS, 'rodsight export')}")


def _hint(word: str, known: Sequence[str], others: dict[str, str], before: str) -> str:
    """Return what is probably meant, or all that exists, to append to an error."""
    other = others.get(word.lower())
    if other is None:
        near = get_close_matches(word.lower(), known, 1)
        other = near[0] if near else None
    return f": did you mean `{before} {other}`?" if other else f": there are {', '.join(known)}"
