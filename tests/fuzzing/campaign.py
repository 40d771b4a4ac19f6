"""The campaign of spoiled inputs in pieces: one that was stopped goes on, and several processes may share it."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterable
from pathlib import Path

from .attempt import try_all
from .cases import Originals, make_cases
from .table import MUTATIONS

SEED = 20  # the quick set has it, the campaign the next
PIECE = 500  # cases


def try_pieces(originals: Originals, file: Path, part: int = 0, parts: int = 1) -> None:
    """Try every `parts`-th piece, and write each down as it is done; those in the file are not tried again."""
    done = {piece["first"] for piece in _read(file)}
    for first in range(part * PIECE, MUTATIONS, parts * PIECE):
        if first in done:
            continue
        since = time.monotonic()
        cases = list(make_cases(originals, first + PIECE, SEED + 1))[first:]
        tried, wrong = try_all(cases)
        with file.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps({"first": first, "tried": tried, "wrong": wrong}) + "\n")
        print(f"{first}: {tried} tried, {len(wrong)} wrong, {time.monotonic() - since:.0f} s", file=sys.stderr)


def gather(files: Iterable[Path]) -> tuple[int, list[str]]:
    """How many were tried in all pieces, the last word on each, and what was wrong."""
    pieces = {piece["first"]: piece for file in files for piece in _read(file)}
    return sum(each["tried"] for each in pieces.values()), [text for each in pieces.values() for text in each["wrong"]]


def _read(file: Path) -> list[dict]:
    return [json.loads(line) for line in file.read_text("utf-8").splitlines()] if file.exists() else []
