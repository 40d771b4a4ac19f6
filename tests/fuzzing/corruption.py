"""Corruptions of files, as by editors, spreadsheets, disks and attackers, drawn from a random generator."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

Corruption = Callable[[random.Random, bytes], bytes]

NUMBERS = (
    "nan", "inf", "-inf", "1e400", "-0", "0", "-1", "1e308", "-1e-320", "4294967296", "9" * 30, "9" * 4300, "0x10",
    "1_0", "1,5", "١٢", "true", '"1"', "", " ", "1e", "--1", "1.5.2", "0.1e-400", "NaN ", "null", "[1]", "{}",
    "=1+1", "\x00",
)  # fmt: skip
WORDS = ("", "../../etc/passwd", "/dev/zero", "/dev/full", "/proc/self/mem", "a" * 5000, "\u202egnp", "\ud7ff", "°",
         ".", "..", "con", "top\n", "photos/", "*", "**/*", "[", "experiment.toml")  # fmt: skip
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def flip(rng: random.Random, content: bytes) -> bytes:
    """Flip bits."""
    corrupted = bytearray(content)
    for _ in range(rng.randint(1, 4)):
        if corrupted:
            corrupted[rng.randrange(len(corrupted))] ^= 1 << rng.randrange(8)
    return bytes(corrupted)


def cut(rng: random.Random, content: bytes) -> bytes:
    """Remove the end or the beginning."""
    at = rng.randint(0, len(content))
    return content[:at] if rng.random() < 0.8 else content[at:]


def repeat(rng: random.Random, content: bytes) -> bytes:
    """Repeat a part."""
    a, b = sorted(rng.randint(0, len(content)) for _ in range(2))
    return content[:b] + content[a:b] + content[b:]


def stuff(rng: random.Random, content: bytes) -> bytes:
    """Insert foreign bytes."""
    at = rng.randint(0, len(content))
    inserted = rng.choice(
        (b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\x1a", b"\x85", b"[" * 3000, b"{" * 3000, b'"""')
    )
    return content[:at] + inserted + content[at:]


def empty(rng: random.Random, content: bytes) -> bytes:
    """Replace the content by nothing or white space."""
    return rng.choice((b"", b"\n", b" \t\n", b"\x00" * 100, b"\xef\xbb\xbf"))


def renumber(rng: random.Random, content: bytes) -> bytes:
    """Replace a number by another one or by text."""
    found = list(NUMBER.finditer(content))
    if not found:
        return flip(rng, content)
    match = rng.choice(found)
    return content[: match.start()] + rng.choice(NUMBERS).encode("utf-8") + content[match.end() :]


def rescale(rng: random.Random, content: bytes) -> bytes:
    """Scale a number by powers of ten, or change its sign."""
    found = list(NUMBER.finditer(content))
    if not found:
        return flip(rng, content)
    match = rng.choice(found)
    value = float(match[0]) * rng.choice((-1.0, 10.0, 1e3, 1e-3, 1e6, 1e-6, 1e15))
    return content[: match.start()] + repr(value).encode() + content[match.end() :]


def spreadsheet(rng: random.Random, content: bytes) -> bytes:
    """Change byte order mark, line ends, separators and decimal marks, as spreadsheets do."""
    text = content.decode("utf-8", "replace")
    if rng.random() < 0.5:
        text = text.replace(",", rng.choice((";", "\t", ", ", "|")))
    if rng.random() < 0.4:
        text = text.replace(".", ",")
    if rng.random() < 0.5:
        text = text.replace("\n", rng.choice(("\r\n", "\r")))
    return text.encode(rng.choice(("utf-8-sig", "utf-8", "utf-16", "latin-1")), "replace")


def relines(rng: random.Random, content: bytes) -> bytes:
    """Remove, repeat, exchange or extend lines."""
    lines = content.split(b"\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(4)
    if kind == 0:
        del lines[a]
    elif kind == 1:
        lines.insert(b, lines[a])
    elif kind == 2:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        lines[a] = lines[a] + rng.choice((b",1", b",", b";", b" #", b' "', b"\t"))
    return b"\n".join(lines)


def rename(rng: random.Random, content: bytes) -> bytes:
    """Replace a word."""
    found = list(re.finditer(rb"[A-Za-z_.]{3,}", content))
    if not found:
        return flip(rng, content)
    match = rng.choice(found)
    other = rng.choice((rng.choice(WORDS).encode("utf-8", "replace"), rng.choice(found)[0]))
    return content[: match.start()] + other + content[match.end() :]


TEXT: tuple[Corruption, ...] = (flip, cut, repeat, stuff, empty, renumber, renumber, rescale, rescale, relines, rename)
TABLE: tuple[Corruption, ...] = (*TEXT, spreadsheet, spreadsheet, relines)
BYTES: tuple[Corruption, ...] = (flip, flip, cut, repeat, stuff, empty)


def corrupt_store(rng: random.Random, file: Path) -> None:
    """Change the content of an HDF5 file so that the library still opens it."""
    with h5py.File(file, "r+") as store:
        names: list[str] = []
        store.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
        name = rng.choice(names)
        data = store[name][()]
        kind = rng.randrange(9)
        if kind == 0:
            del store[name]
            return
        if kind == 1:
            store.attrs[rng.choice(list(store.attrs))] = rng.choice((0, -1, 3.5, "x", np.arange(5), 2**62))
            return
        if kind == 2:
            del store.attrs[rng.choice(list(store.attrs))]
            return
        del store[name]
        if kind == 3:
            store[name] = h5py.ExternalLink(rng.choice(("/etc/passwd", "/dev/zero", "results.h5")), "/forces/fn")
        elif kind == 4:
            store[name] = h5py.SoftLink(rng.choice(("/", f"/{name}", "/nowhere", "/forces/fn")))
        elif kind == 5:
            store[name] = np.array([b"x", b"y"]) if np.ndim(data) else "x"
        elif kind == 6:
            store[name] = np.asarray(data)[..., None]
        elif kind == 7 and np.asarray(data).dtype.kind in "iuf" and np.size(data):
            flat = np.array(data).ravel()
            value = (
                rng.choice((-1, 0, 2**31 - 1, 255)) if flat.dtype.kind in "iu" else rng.choice((np.nan, np.inf, -1e300))
            )
            with np.errstate(all="ignore"):
                flat[rng.randrange(len(flat))] = np.array(value).astype(flat.dtype)
            store[name] = flat.reshape(np.shape(data))
        else:
            store.create_dataset(name, (2**40,), np.float64, chunks=(1024,))  # eight terabytes by its shape
