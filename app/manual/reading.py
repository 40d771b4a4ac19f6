"""The documentation as plain HTML files, made of the shipped Markdown: read from the disk, nothing is loaded."""

from __future__ import annotations

import html
import inspect
import os
import re
import shutil
import tempfile
from importlib import import_module
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

from ..atomic import write_atomically
from .contents import CONTENTS, FOLDER, pages

# What mkdocstrings fills in: a name below this folder, and the name that users know it by.
FRONT = re.compile(r"\A---\n.*?\n---\n", re.DOTALL)  # what a journal is told of a page
MEMBER = re.compile(r'^::: app\.([\w.]+)\n +options:\n +heading: "([\w.]+)"$', re.MULTILINE)


def write_pages(folder: Path) -> Path:
    """Write every page as HTML, with its pictures, into a folder; returns the first page."""
    from jinja2 import Environment

    source = files(__name__.rpartition(".")[0]).joinpath("page.html").read_text(encoding="utf-8")
    template = Environment(autoescape=True, trim_blocks=True).from_string(source)
    folder.mkdir(parents=True, exist_ok=True)
    for name, title in pages().items():
        body = _html(page_text(name))
        page = template.render(title=title, here=name, contents=CONTENTS, body=body)
        write_atomically((folder / name).with_suffix(".html"), page.encode())
    for part in ("pictures", "notebooks"):
        if (FOLDER / part).is_dir():
            shutil.copytree(FOLDER / part, folder / part, dirs_exist_ok=True)
    return folder / "index.html"


def page_text(name: str) -> str:
    """The Markdown of a page, with what the code says of itself in its place."""
    text = (FOLDER / name).read_text(encoding="utf-8")
    text = FRONT.sub("", text)
    return MEMBER.sub(lambda found: _describe(found[1], found[2]), text)


def reading_folder(version: str) -> Path:
    """Where the pages are put for reading: the user's cache, or a new folder for temporary files."""
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    folder = Path(base) / "rodsight" / f"docs-{version}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return Path(tempfile.mkdtemp(prefix="rodsight-docs-"))
    return folder


def _html(text: str) -> str:
    from markdown_it import MarkdownIt

    parser = MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"])
    tokens = parser.parse(text)
    for token, following in pairwise(tokens):
        if token.type == "heading_open":
            token.attrSet("id", anchor(following.content))
    for token in tokens:
        for child in token.children or ():
            target = child.attrGet("href")
            if isinstance(target, str) and "://" not in target:
                child.attrSet("href", re.sub(r"\.md(?=#|$)", ".html", target))
    rendered: str = parser.renderer.render(tokens, parser.options, {})
    return rendered.replace("<table>", '<div class="scroll"><table>').replace("</table>", "</table></div>")


def anchor(heading: str) -> str:
    """The name by which a heading is linked to."""
    plain = re.sub(r"[`*\[\]]", "", heading).lower()
    return re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", plain)).strip("-")


def _describe(place: str, known_as: str) -> str:
    """What a name of the Python interface says of itself, as Markdown."""
    module, _, attribute = place.rpartition(".")
    thing = getattr(import_module(f"{__name__.partition('.')[0]}.{module}"), attribute)
    parts = [f"## {known_as}", _entry(known_as, thing)]
    if inspect.isclass(thing):
        for member, value in vars(thing).items():
            if not member.startswith("_") and (inspect.isfunction(value) or isinstance(value, property)):
                parts.append(_entry(member, value))
    return "\n\n".join(parts)


def _entry(name: str, thing: Any) -> str:
    shown = "" if isinstance(thing, property) or inspect.isclass(thing) else _signature(thing)
    text, _, example = (inspect.getdoc(thing) or "").partition("\nExamples:\n")
    code = f"\n\n```pycon\n{inspect.cleandoc(example)}\n```" if example else ""
    return f"### `{name}{shown}`\n\n{html.escape(text, quote=False)}{code}"


def _signature(thing: Any) -> str:
    """Names and defaults of the arguments; their types are in the text."""
    signature = inspect.signature(thing)
    kept = [each.replace(annotation=inspect.Parameter.empty) for each in signature.parameters.values()]
    told = str(signature.replace(parameters=kept, return_annotation=inspect.Signature.empty))
    told = re.sub(r"<function (\w+) at \w+>", r"\1", told)  # of a default
    return told.replace("(self, ", "(").replace("(self)", "()")
