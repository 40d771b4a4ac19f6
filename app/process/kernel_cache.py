"""The folder of the compiled kernels of exactly these sources, this compiler and this level of processors.

The compiler itself knows only the file of a compiled function, not those of the functions that it calls: kernels kept
beside the sources would stay as they are after an edit of a function that is inlined into them.

A wheel brings kernels with it, in archives that are named by the same key as the folder: they are unpacked where the
key of the installed sources, the compiler and the processor is theirs, and ignored otherwise.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import stat
import sys
import sysconfig
import time
from collections.abc import Iterable
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from .machine.processor import FEATURES, described_processor, processor_level
from .sources import APP, hash_of_kernels, source_folder

CACHE_VARIABLE = "NUMBA_CACHE_DIR"
NAME_VARIABLE, FEATURES_VARIABLE = "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"
# Options that change the compiled code, though not the names of its files.
OPTION_VARIABLES = ("NUMBA_OPT", "NUMBA_BOUNDSCHECK", "NUMBA_DEBUGINFO", "NUMBA_ENABLE_AVX", "NUMBA_DISABLE_INTEL_SVML")
SHIPPED = "shipped_kernels"  # folder of a wheel's archives in the package
COMPILERS = ("numba", "llvmlite")
PREFIX = "rodsight-kernels-"
KEY_LENGTH = 16  # hexadecimal digits
KEPT = 30 * 86400.0  # [s] after the last use of the kernels of other sources until they are removed
MOST = 1 << 30  # [bytes] of all kernels, beyond which those of other sources go, the longest unused first …
RECENT = 7200.0  # [s] … except those used since then: a process that lacks them compiles them again
TOUCHED = 3600.0  # [s] at least between two notes that a folder is used
SEARCHED = 86400.0  # [s] after the last use of a folder until old ones are looked for; a new folder looks at once


def choose_kernel_cache() -> None:
    """Make the compiler keep kernels in the folder of these sources: below NUMBA_CACHE_DIR, else the user's caches.

    The folder is closed to others, because the compiler executes the code it reads there.
    """
    _choose_processor()
    key = kernel_key()
    for parent in _parents():
        folder = parent / f"{PREFIX}{key}"
        if _make_private(folder):
            _set(CACHE_VARIABLE, "CACHE_DIR", str(folder))
            archive = APP / SHIPPED / archive_name(key)
            if archive.is_file() and not _unpacked_mark(folder).exists():
                _UnpackBeforeCompiler(archive, folder).wait()
            _note_use(folder)
            return


def kernel_key() -> str:
    """Return the name of everything that compiled kernels depend on: sources, compiler, processor."""
    facts = [hash_of_kernels(), sysconfig.get_platform(), str(sys.implementation.cache_tag)]
    facts += [*map(_version, COMPILERS), *_processor()]
    facts += [f"{name}={os.environ[name]}" for name in OPTION_VARIABLES if name in os.environ]
    return hashlib.sha256("\n".join(facts).encode()).hexdigest()[:KEY_LENGTH]


def archive_name(key: str) -> str:
    """Return the name of a wheel's archive of kernels with this key."""
    return f"{key}.zip"


def has_shipped_kernels() -> bool:
    """Whether a wheel brought all kernels for these sources, this compiler and this processor."""
    return (APP / SHIPPED / archive_name(kernel_key())).is_file()


def kernel_folder() -> Path | None:
    """Return the chosen folder of kernels, or None where the compiler keeps none."""
    chosen = os.environ.get(CACHE_VARIABLE)
    return Path(chosen) if chosen and Path(chosen).name.startswith(PREFIX) else None


def folder_of_sources(source: str) -> str:
    """Return the name that the compiler gives to the folder of the kernels of a folder of sources, such as solver/nlgs.

    It contains a hash of the place where the package is installed, see numba's `get_suitable_cache_subpath`.
    """
    place = source_folder(source)
    return f"{place.name}_{hashlib.sha1(str(place).encode()).hexdigest()}"


def unpack_shipped(archive: Path, folder: Path) -> None:
    """Unpack a wheel's archive of kernels into the folders of the place where the package is installed."""
    import tempfile  # most starts need no temporary folder
    import zipfile

    with (
        suppress(OSError),  # a kernel that cannot be written is compiled
        zipfile.ZipFile(archive) as kernels,
        tempfile.TemporaryDirectory(dir=folder) as part,
    ):
        for name in kernels.namelist():
            source, _, file = name.rpartition("/")
            target = folder / folder_of_sources(source)
            target.mkdir(exist_ok=True)
            (Path(part) / file).write_bytes(kernels.read(name))
            os.replace(Path(part) / file, target / file)
        _unpacked_mark(folder).touch()


class _UnpackBeforeCompiler:
    """A finder of modules that unpacks a wheel's kernels when the compiler is imported: many commands never do."""

    def __init__(self, archive: Path, folder: Path) -> None:
        self._archive, self._folder = archive, folder

    def wait(self) -> None:
        """Unpack at once where the compiler is imported already, else when it is."""
        if "numba" in sys.modules:
            unpack_shipped(self._archive, self._folder)
        else:
            sys.meta_path.insert(0, self)

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        """Find nothing, as other finders do that do not know a module."""
        if name == "numba":
            sys.meta_path.remove(self)
            unpack_shipped(self._archive, self._folder)


def _unpacked_mark(folder: Path) -> Path:
    """Return the file that states that the kernels of this installation are unpacked."""
    return folder / f"unpacked-{hashlib.sha256(str(APP).encode()).hexdigest()[:KEY_LENGTH]}"


def _choose_processor() -> None:
    """Make the compiler write code for all processors of this one's level, unless the user chose a processor."""
    level = None if NAME_VARIABLE in os.environ or _has_begun() else processor_level()
    if level is not None:
        _set(NAME_VARIABLE, "CPU_NAME", level)
        _set(FEATURES_VARIABLE, "CPU_FEATURES", FEATURES[level])


def _has_begun() -> bool:
    """Whether the compiler has chosen the processor already, for kernels of the user's own."""
    registry = sys.modules.get("numba.core.registry")
    return registry is not None and "_toplevel_target_context" in vars(registry.cpu_target)


def _set(variable: str, name: str, value: str) -> None:
    """Set an option of the compiler, also where it has read its variables already."""
    os.environ[variable] = value
    compiler = sys.modules.get("numba")
    if compiler is not None:
        setattr(compiler.config, name, value)


def remove_old(parent: Path, now: float) -> None:
    """Remove kernels of other sources that were not used for a while, or that are too many.

    Every edit of a kernel makes others, of 10 to 200 MB: a developer's disk would fill within weeks.

    now: time [s] since the epoch.
    """
    used = []
    for folder in parent.glob(f"{PREFIX}*"):
        with suppress(OSError):
            used.append((folder.stat().st_mtime, folder))
    size = 0
    for last, folder in sorted(used, reverse=True):
        if now - last > KEPT or (now - last > RECENT and size > MOST):
            shutil.rmtree(folder, ignore_errors=True)
        elif size <= MOST:
            size += _size_of(folder)


def _size_of(folder: Path) -> int:
    """Return the bytes of all files below a folder; those that vanish meanwhile do not count."""
    size = 0
    for place, _, names in os.walk(folder):
        for name in names:
            with suppress(OSError):
                size += os.lstat(os.path.join(place, name)).st_size
    return size


def _parents() -> Iterable[Path]:
    """Yield folders to try: the one that is set, the user's caches, a temporary one."""
    given = os.environ.get(CACHE_VARIABLE)
    if given:
        place = Path(given)
        yield place.parent if place.name.startswith(PREFIX) else place  # this program's own choice, inherited
    yield Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "rodsight"
    import tempfile  # most starts need no temporary folder

    user = os.getuid() if hasattr(os, "getuid") else "user"
    yield Path(tempfile.gettempdir()) / f"rodsight-{user}"
    with suppress(OSError):  # no folder can be made: the compiler reports it
        yield Path(tempfile.mkdtemp(prefix="rodsight-"))


def _make_private(folder: Path) -> bool:
    """Make a folder, and report whether it can be written to and no other user can put anything into it."""
    try:
        for each in (folder.parent, folder):
            each.parent.mkdir(parents=True, exist_ok=True)
            each.mkdir(mode=0o700, exist_ok=True)
        return all(map(_is_private, (folder.parent, folder))) and os.access(folder, os.W_OK)
    except OSError:
        return False


def _is_private(folder: Path) -> bool:
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode):
        return False
    return not hasattr(os, "getuid") or (status.st_uid == os.getuid() and not status.st_mode & 0o022)


def _note_use(folder: Path) -> None:
    """Note that a folder is used, at most once an hour; where it is new, or was unused for a day, remove old ones."""
    now = time.time()
    with suppress(OSError):
        new, unused = not any(folder.iterdir()), now - folder.stat().st_mtime
        if new or unused > TOUCHED:
            os.utime(folder, (now, now))
        if new or unused > SEARCHED:
            remove_old(folder.parent, now)


def _version(name: str) -> str:
    """Return the version of an installed package by the name of its folder of facts, without importing anything."""
    spec = find_spec(name)
    if spec is None or spec.origin is None:
        return ""
    place = Path(spec.origin).parents[1]
    found = (re.fullmatch(rf"{name}-(.+)\.(?:dist|egg)-info", each) for each in os.listdir(place))
    stated = sorted(each[1] for each in found if each)
    return " ".join(stated) if stated else _imported_version(name)


def _imported_version(name: str) -> str:
    return str(import_module(name).__version__)


def _processor() -> list[str]:
    """Return what kernels are compiled for: a level, or this processor alone."""
    if NAME_VARIABLE in os.environ:
        return [os.environ[NAME_VARIABLE], os.environ.get(FEATURES_VARIABLE, "as this processor")]
    return described_processor()
