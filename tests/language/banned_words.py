"""Find words of a private vocabulary in code and pages; the standard word for each stands beside it.

    python -m tests.language.banned_words [PATH ...]

prints every place, with the word to write. In Python files the identifiers, docstrings, comments and messages are read;
in pages and scripts the whole text.
"""

from __future__ import annotations

import fnmatch
import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
SUFFIXES = (".py", ".md", ".html", ".js", ".css", ".toml", ".cff", ".ipynb")

# Words of prose, as patterns, and what is written instead.
BANNED = {
    r"told|untold|tell|tells|telling": "given, specified, stored (data); report, state (programs)",
    r"say|says|said|saying": "state, report, specify",
    r"ask|asks|asked|asking": "request, requested, query",
    r"hear|hears|heard|unheard|hearing": "fused, combined; on_sweep; ignored",
    r"hangs? on": "depends on",
    r"worth|worths": "weight; value",
    r"witness|witnesses": "evidence source, estimator",
    r"doubt|doubts|doubted|doubting": "uncertainty, penalty, ambiguous",
    r"parted|gained contacts": "lost contacts, new contacts",
    r"carry back|carried back|carries back": "backward pass, smoothing",
    r"dearest": "highest price",
    r"polish|polished|polishing": "project onto equilibrium, refine",
    r"bring into balance|brought into balance": "project onto equilibrium",
    r"strangers?": "false detections; untrusted users",
    r"sift|sifts|sifting|sifted": "coarse-to-fine search",
    r"mend|mends|mended|mending|mender": "correct, repair",
    r"glimpse|glimpses": "thumbnail, preview",
    r"lazily": "on demand",
    r"promise|promises|promised": "predicted accuracy, prediction",
    r"still forces": "motion-free baselines",
    r"likewise": "write the noun",
    r"at length|in full": "n_samples: few, many",
    r"near pairs?": "candidate pairs",
    r"honest|honestly": "coverage factor; calibrated",
    r"shares? of": "fraction of",
    r"one ahead": "prefetch",
    r"beyond doubt": "certain",
}
# Parts of identifiers, and what is written instead.
BANNED_NAMES = {
    "told": "given", "untold": "unspecified", "tell": "describe", "tells": "describes", "say": "report",
    "says": "states", "said": "stated", "ask": "request", "asks": "requests", "asked": "requested",
    "hear": "on_sweep", "heard": "combined", "unheard": "ignored", "worth": "weight", "witness": "evidence_source",
    "doubt": "uncertainty", "doubts": "uncertainties", "share of": "fraction", "parted": "lost_contacts",
    "gained": "new_contacts", "dearest": "highest_price", "wins": "accepted", "polish": "project_onto_equilibrium",
    "polished": "projected", "stranger": "false_detection", "strangers": "false_detections", "sift": "search",
    "sifting": "coarse_to_fine", "mend": "correct", "mended": "corrected", "mender": "pose_editor",
    "mending": "correcting", "understood": "validated", "spoken": "reviewed", "glimpse": "thumbnail",
    "lazily": "lazy_sequence", "promise": "prediction", "promises": "predictions", "promised": "predicted",
    "honest": "coverage_factor", "legs": "contact_jacobian",
}  # fmt: skip
BANNED_IDENTIFIERS = {
    "push_node", "take_products", "take_rows", "take_from_rows", "work_together", "one_ahead", "same_turn",
    "carry_back", "miss_of_wall", "miss_of_pair", "Room", "Roll", "Findings",
}  # fmt: skip
# Places where a word stays, by file and part of the line, with the reason.
EXCEPTIONS = (
    ("*.js", "Promise", "JavaScript's own name"),
    ("*", "new Promise", "JavaScript's own name"),
    ("*", "frames/doubt", "a dataset in files of earlier versions"),
    ("*", "walls/told", "a dataset in files of earlier versions"),
    ("app/docs/schema.md", "(earlier: ", "paths of datasets in files of earlier versions"),
    ("*.py", "formerly=", "paths of datasets in files of earlier versions"),
    ("tests/app/results/test_earlier_files.py", "", "content of files of earlier versions"),
)
COMMENT_OPENS = re.compile(r"#\s*what\b", re.IGNORECASE)

_PROSE = {re.compile(rf"(?<!\w)(?:{pattern})(?!\w)", re.IGNORECASE): word for pattern, word in BANNED.items()}
_ANY = re.compile(rf"(?<!\w)(?:{'|'.join(BANNED)})(?!\w)", re.IGNORECASE)  # one search for most lines
_PARTS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")


class Place(NamedTuple):
    """One banned word where it stands."""

    file: str
    line: int
    word: str
    instead: str
    text: str


def find_banned(paths: Sequence[str] = ()) -> list[Place]:
    """All banned words in the tracked files below these paths (default: the whole tree)."""
    command = ["git", "ls-files", "-co", "--exclude-standard", "--", *paths]
    names = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    read = [name for name in sorted(set(names)) if name.endswith(SUFFIXES) and (ROOT / name).is_file()]
    places = [place for name in read if not name.startswith("tests/language/") for place in _find_in(name)]
    return [place for place in places if not _is_exception(place)]


def _is_exception(place: Place) -> bool:
    return any(fnmatch.fnmatch(place.file, file) and part in place.text for file, part, _ in EXCEPTIONS)


def _find_in(name: str) -> Iterator[Place]:
    text = (ROOT / name).read_text(encoding="utf-8")
    if not name.endswith(".py"):
        for number, line in enumerate(text.splitlines(), 1):
            yield from _in_prose(name, number, line)
        return
    if not _may_have_banned(text):  # most files: to read their tokens takes longest
        return
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.NAME:
            yield from _in_name(name, token.start[0], token.string)
        elif token.type == tokenize.COMMENT:
            if COMMENT_OPENS.match(token.string):
                yield Place(name, token.start[0], "what", "begin with the noun", token.string)
            yield from _in_prose(name, token.start[0], token.string)
        elif token.type == tokenize.STRING:
            for offset, line in enumerate(token.string.splitlines()):
                yield from _in_prose(name, token.start[0] + offset, line)


def _may_have_banned(text: str) -> bool:
    """Whether any word of a text is banned somewhere: in names, in prose, or at the head of a comment."""
    parts = {each.lower() for each in _PARTS.findall(text)}
    words = set(re.findall(r"\w+", text))
    return bool(
        _ANY.search(text) or COMMENT_OPENS.search(text) or parts & set(BANNED_NAMES) or words & BANNED_IDENTIFIERS
    )


def _in_prose(name: str, number: int, line: str) -> Iterator[Place]:
    for pattern, instead in _PROSE.items() if _ANY.search(line) else ():
        for found in pattern.finditer(line):
            yield Place(name, number, found.group(0), instead, line.strip())


def _in_name(name: str, number: int, identifier: str) -> Iterator[Place]:
    for word, instead in _banned_parts(identifier):
        yield Place(name, number, word, instead, identifier)


@cache
def _banned_parts(identifier: str) -> tuple[tuple[str, str], ...]:
    """Banned words in an identifier, with what is written instead."""
    whole = ((identifier, "see words"),) if identifier in BANNED_IDENTIFIERS else ()
    parts = (each.lower() for each in _PARTS.findall(identifier))
    return whole + tuple((part, BANNED_NAMES[part]) for part in parts if part in BANNED_NAMES)


if __name__ == "__main__":
    places = find_banned(sys.argv[1:])
    for each in places:
        print(f"{each.file}:{each.line}: {each.word} → {each.instead}: {each.text[:110]}")
    print(f"{len(places)} banned words")
