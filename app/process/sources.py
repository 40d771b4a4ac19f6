"""The program's own source files: which of them a stage or the compiled kernels depend on, and a hash of those.

Results and compiled kernels belong to the sources that they were made by. A file depends on the files that it imports,
and on a data file of its own name (fitted.py, fitted.toml). Sources are read once per process.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path

APP = Path(__file__).resolve().parents[1]
FACE = "__init__.py"
DATA_SUFFIX = ".toml"
WITHOUT_CODE = ("__pycache__", "docs", "page", "pages")  # folders
WITHOUT_KERNELS = ("cli/", "compilation/")  # these watch and call the compiler
SOLVER = "solver"  # its folder below the package, or beside it in a source tree
_IMPORT = re.compile(rb"^[ \t]*from (\.+)([\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
_COMPILED = re.compile(rb"^[ \t]*(?:from|import) numba\b", re.MULTILINE)
_NAME = re.compile(r"\w+")


class Sources:
    """The source files of one tree by their names in the package, such as solver/nlgs/solve.py."""

    def __init__(self, content: Mapping[str, bytes]) -> None:
        self.content = content
        self._imports: dict[str, frozenset[str]] = {}

    @classmethod
    def of(cls, app: Path) -> Sources:
        """Read the sources of a package's folder and of the solver in or beside it."""
        return cls(dict(_files(app)))

    @property
    def compiled(self) -> frozenset[str]:
        """Names of the files with kernels: those that import the compiler, but for parts without kernels."""
        return frozenset(
            name
            for name, text in self.content.items()
            if b"numba" in text and name.endswith(".py") and _COMPILED.search(text)
            if not name.startswith(WITHOUT_KERNELS)
        )

    def needed_by(self, names: Iterable[str]) -> frozenset[str]:
        """Return these files with all files that they import, directly or not."""
        found: set[str] = set()
        waiting = list(names)
        while waiting:
            name = waiting.pop()
            if name not in found:
                found.add(name)
                waiting.extend(self._imported(name))
        return frozenset(found)

    def hash_of(self, names: Iterable[str]) -> str:
        """Return the SHA-256 of files, their names included. Raises KeyError for an unknown one."""
        digest = hashlib.sha256()
        for name in sorted(names):
            digest.update(f"{name} {hashlib.sha256(self.content[name]).hexdigest()}\n".encode())
        return digest.hexdigest()

    def _imported(self, name: str) -> frozenset[str]:
        if name not in self._imports:
            self._imports[name] = frozenset(_imported(name, self.content))
        return self._imports[name]


@cache
def program_sources() -> Sources:
    """Return the sources of this program as they are when they are first used in this process."""
    return Sources.of(APP)


@cache
def hash_of_kernels() -> str:
    """Return the hash of all files that are compiled, and of all that these import."""
    sources = program_sources()
    return sources.hash_of(sources.needed_by(sources.compiled))


@cache
def hash_of_code(roots: tuple[str, ...], alone: tuple[str, ...] = ()) -> str:
    """Return the hash of the code of a stage: files with all that they import, and files alone."""
    sources = program_sources()
    return sources.hash_of(sources.needed_by(roots) | frozenset(alone))


def source_folder(name: str) -> Path:
    """Return the folder of sources by its name in the package, such as solver/nlgs or tracking."""
    first, _, rest = name.partition("/")
    return _solver_beside(APP) / rest if first == SOLVER else APP / name


def _solver_beside(app: Path) -> Path:
    return app / SOLVER if (app / SOLVER).is_dir() else app.parent / SOLVER


def _files(app: Path) -> Iterator[tuple[str, bytes]]:
    solver = _solver_beside(app)
    for place, prefix in ((app, ""), (solver, f"{SOLVER}/")):
        for folder, below, names in os.walk(place):
            below[:] = [each for each in below if each not in WITHOUT_CODE and Path(folder, each) != solver]
            inside = Path(folder).relative_to(place).as_posix()
            start = prefix if inside == "." else f"{prefix}{inside}/"
            for name in names:
                if name.endswith((".py", DATA_SUFFIX)):
                    yield start + name, Path(folder, name).read_bytes()


def _imported(name: str, known: Mapping[str, bytes]) -> Iterator[str]:
    """Yield the files that relative imports of a file load: modules, packages, and modules named in a package."""
    if not name.endswith(".py"):
        return
    data = name.removesuffix(".py") + DATA_SUFFIX
    if data in known:
        yield data
    for dots, path, names in _IMPORT.findall(known[name]):
        above = name.split("/")[: -len(dots)]
        target = "/".join([*above, *filter(None, path.decode().split("."))])
        inside = (f"{target}/{each}".lstrip("/") for each in _NAME.findall(names.decode(errors="replace")))
        for place in filter(None, (target, *inside)):  # not the face of the whole package
            for file in (f"{place}.py", f"{place}/{FACE}"):
                if file in known:
                    yield file
