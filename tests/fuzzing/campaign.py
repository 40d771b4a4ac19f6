"""The campaign of corrupted inputs in pieces, which can be resumed and divided among processes."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterable
from pathlib import Path

from .attempt import run_all
from .cases import Originals, make_cases
from .table import MUTATIONS

SEED = 20  # of the quick set; the campaign has the next
PIECE = 500  # cases


def run_pieces(originals: Originals, file: Path, part: int = 0, parts: int = 1) -> None:
    """Run every `parts`-th piece and append each to the file; pieces in the file are not run again."""
    done = {piece["first"] for piece in _read(file)}
    for first in range(part * PIECE, MUTATIONS, parts * PIECE):
        if first in done:
            continue
        since = time.monotonic()
        cases = list(make_cases(originals, first + PIECE, SEED + 1))[first:]
        tried, problems = run_all(cases)
        with file.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps({"first": first, "tried": tried, "wrong": problems}) + "\n")
        print(f"{first}: {tried} tried, {len(problems)} wrong, {time.monotonic() - since:.0f} s", file=sys.stderr)


def gather(files: Iterable[Path]) -> tuple[int, list[str]]:
    """Count the cases of all pieces, the last result of each, and collect the problems."""
    pieces = {piece["first"]: piece for file in files for piece in _read(file)}
    return sum(each["tried"] for each in pieces.values()), [text for each in pieces.values() for text in each["wrong"]]


def _read(file: Path) -> list[dict]:
    return [json.loads(line) for line in file.read_text("utf-8").splitlines()] if file.exists() else []
