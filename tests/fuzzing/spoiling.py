"""Ways to spoil a file: what editors, spreadsheets, disks and strangers do to it. Every draw comes from a generator."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

Spoil = Callable[[random.Random, bytes], bytes]

NUMBERS = (
    "nan", "inf", "-inf", "1e400", "-0", "0", "-1", "1e308", "-1e-320", "4294967296", "9" * 30, "9" * 4300, "0x10",
    "1_0", "1,5", "١٢", "true", '"1"', "", " ", "1e", "--1", "1.5.2", "0.1e-400", "NaN ", "null", "[1]", "{}",
    "=1+1", "\x00",
)  # fmt: skip
WORDS = ("", "../../etc/passwd", "/dev/zero", "/dev/full", "/proc/self/mem", "a" * 5000, "\u202egnp", "\ud7ff", "°",
         ".", "..", "con", "top\n", "photos/", "*", "**/*", "[", "experiment.toml")  # fmt: skip
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def flip(chance: random.Random, content: bytes) -> bytes:
    """Bits turn."""
    spoiled = bytearray(content)
    for _ in range(chance.randint(1, 4)):
        if spoiled:
            spoiled[chance.randrange(len(spoiled))] ^= 1 << chance.randrange(8)
    return bytes(spoiled)


def cut(chance: random.Random, content: bytes) -> bytes:
    """The end is missing, or the beginning."""
    at = chance.randint(0, len(content))
    return content[:at] if chance.random() < 0.8 else content[at:]


def repeat(chance: random.Random, content: bytes) -> bytes:
    """A part stands twice."""
    a, b = sorted(chance.randint(0, len(content)) for _ in range(2))
    return content[:b] + content[a:b] + content[b:]


def stuff(chance: random.Random, content: bytes) -> bytes:
    """Bytes that do not belong there."""
    at = chance.randint(0, len(content))
    what = chance.choice(
        (b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\x1a", b"\x85", b"[" * 3000, b"{" * 3000, b'"""')
    )
    return content[:at] + what + content[at:]


def nothing(chance: random.Random, content: bytes) -> bytes:
    """It is empty, or white."""
    return chance.choice((b"", b"\n", b" \t\n", b"\x00" * 100, b"\xef\xbb\xbf"))


def renumber(chance: random.Random, content: bytes) -> bytes:
    """Another number, or something that is none."""
    found = list(NUMBER.finditer(content))
    if not found:
        return flip(chance, content)
    place = chance.choice(found)
    return content[: place.start()] + chance.choice(NUMBERS).encode("utf-8") + content[place.end() :]


def rescale(chance: random.Random, content: bytes) -> bytes:
    """A number is off by powers of ten, or has the other sign."""
    found = list(NUMBER.finditer(content))
    if not found:
        return flip(chance, content)
    place = chance.choice(found)
    value = float(place[0]) * chance.choice((-1.0, 10.0, 1e3, 1e-3, 1e6, 1e-6, 1e15))
    return content[: place.start()] + repr(value).encode() + content[place.end() :]


def spreadsheet(chance: random.Random, content: bytes) -> bytes:
    """As spreadsheets save tables: a mark at the beginning, other ends of lines, separators and commas."""
    text = content.decode("utf-8", "replace")
    if chance.random() < 0.5:
        text = text.replace(",", chance.choice((";", "\t", ", ", "|")))
    if chance.random() < 0.4:
        text = text.replace(".", ",")
    if chance.random() < 0.5:
        text = text.replace("\n", chance.choice(("\r\n", "\r")))
    return text.encode(chance.choice(("utf-8-sig", "utf-8", "utf-16", "latin-1")), "replace")


def relines(chance: random.Random, content: bytes) -> bytes:
    """Lines are lost, stand twice, or elsewhere."""
    lines = content.split(b"\n")
    a, b = chance.randrange(len(lines)), chance.randrange(len(lines))
    way = chance.randrange(4)
    if way == 0:
        del lines[a]
    elif way == 1:
        lines.insert(b, lines[a])
    elif way == 2:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        lines[a] = lines[a] + chance.choice((b",1", b",", b";", b" #", b' "', b"\t"))
    return b"\n".join(lines)


def rename(chance: random.Random, content: bytes) -> bytes:
    """A word is another one."""
    found = list(re.finditer(rb"[A-Za-z_.]{3,}", content))
    if not found:
        return flip(chance, content)
    place = chance.choice(found)
    other = chance.choice((chance.choice(WORDS).encode("utf-8", "replace"), chance.choice(found)[0]))
    return content[: place.start()] + other + content[place.end() :]


TEXT: tuple[Spoil, ...] = (flip, cut, repeat, stuff, nothing, renumber, renumber, rescale, rescale, relines, rename)
TABLE: tuple[Spoil, ...] = (*TEXT, spreadsheet, spreadsheet, relines)
BYTES: tuple[Spoil, ...] = (flip, flip, cut, repeat, stuff, nothing)


def spoil_store(chance: random.Random, file: Path) -> None:
    """Change what stands in an HDF5 file as a stranger might, so that the library still opens it."""
    with h5py.File(file, "r+") as store:
        names: list[str] = []
        store.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
        name = chance.choice(names)
        data = store[name][()]
        way = chance.randrange(9)
        if way == 0:
            del store[name]
            return
        if way == 1:
            store.attrs[chance.choice(list(store.attrs))] = chance.choice((0, -1, 3.5, "x", np.arange(5), 2**62))
            return
        if way == 2:
            del store.attrs[chance.choice(list(store.attrs))]
            return
        del store[name]
        if way == 3:
            store[name] = h5py.ExternalLink(chance.choice(("/etc/passwd", "/dev/zero", "results.h5")), "/forces/fn")
        elif way == 4:
            store[name] = h5py.SoftLink(chance.choice(("/", f"/{name}", "/nowhere", "/forces/fn")))
        elif way == 5:
            store[name] = np.array([b"x", b"y"]) if np.ndim(data) else "x"
        elif way == 6:
            store[name] = np.asarray(data)[..., None]
        elif way == 7 and np.asarray(data).dtype.kind in "iuf" and np.size(data):
            flat = np.array(data).ravel()
            value = (
                chance.choice((-1, 0, 2**31 - 1, 255))
                if flat.dtype.kind in "iu"
                else chance.choice((np.nan, np.inf, -1e300))
            )
            with np.errstate(all="ignore"):
                flat[chance.randrange(len(flat))] = np.array(value).astype(flat.dtype)
            store[name] = flat.reshape(np.shape(data))
        else:
            store.create_dataset(name, (2**40,), np.float64, chunks=(1024,))  # a promise of eight terabytes
