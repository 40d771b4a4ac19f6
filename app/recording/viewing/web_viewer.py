"""The two files of the web viewer, read out of the installed package: no port that another user may take is involved.

The viewer's program holds both files one after the other, as they are served. The program is compared with the hash
that its package states.
"""

from __future__ import annotations

import base64
import hashlib
import mmap
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from .viewer import viewer_binary

PACKAGE = "rerun-sdk"
SCRIPT_START = b"let wasm_bindgen = (function(exports) {"
MODULE_START = b"\0asm\x01\0\0\0"  # WebAssembly, version 1
LAST_SECTION = 13  # greatest number of a section of a module
LARGEST_SCRIPT = 4_000_000  # [bytes] more than the script has ever had


@dataclass(frozen=True, slots=True)
class WebViewer:
    """The web viewer as bytes."""

    script: bytes  # defines wasm_bindgen
    module: bytes  # WebAssembly


def read_web_viewer(program: Path | None = None) -> WebViewer:
    """Read the files out of the viewer's program in the installed package.

    Parameters
    ----------
    program : Path, optional
        The program; default: that of the installed package, which must have the hash that the package states.

    Raises
    ------
    RuntimeError
        If the program differs from its package, or does not hold the two files.
    """
    if program is None:
        program = viewer_binary()
        _refuse_changed(program)
    with program.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
        script = content.find(SCRIPT_START)
        module = content.find(MODULE_START, script, script + LARGEST_SCRIPT) if script >= 0 else -1
        if module < 0:
            raise RuntimeError("the viewer of the installed rerun-sdk does not hold its page: reinstall rerun-sdk")
        return WebViewer(content[script:module], content[module : _end_of_module(content, module)])


def _end_of_module(content: mmap.mmap, start: int) -> int:
    """Return the end of a WebAssembly module: its sections, each a number and a length, follow one another."""
    end = start + len(MODULE_START)
    while end < len(content) and content[end] <= LAST_SECTION:
        length, place = _unsigned(content, end + 1)
        if place + length > len(content):
            break
        end = place + length
    return end


def _unsigned(content: mmap.mmap, place: int) -> tuple[int, int]:
    """Return a number in LEB128, seven bits a byte, and the place after it."""
    value = shift = 0
    while True:
        byte = content[place]
        place += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, place
        shift += 7


def _refuse_changed(program: Path) -> None:
    """Raise RuntimeError where the program has another hash than its package states."""
    try:
        listed = distribution(PACKAGE).files or []
    except PackageNotFoundError:  # installed in another way, without a list of its files
        return
    for file in listed:
        if file.hash is None or file.name != program.name or Path(str(file.locate())).resolve() != program.resolve():
            continue
        with program.open("rb") as stream:
            digest = hashlib.file_digest(stream, file.hash.mode).digest()
        if base64.urlsafe_b64encode(digest).rstrip(b"=").decode() != file.hash.value:
            raise RuntimeError(f"{program} differs from its package: reinstall {PACKAGE}")
