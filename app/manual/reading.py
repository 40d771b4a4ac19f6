"""Convert the shipped Markdown pages to plain HTML files, which are read offline."""

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

from ..process.atomic import write_atomically
from .contents import CONTENTS, FOLDER, pages

FRONT = re.compile(r"\A---\n.*?\n---\n", re.DOTALL)  # metadata of a page for a journal
# A directive of mkdocstrings: a name below app/, and the public name as its heading.
MEMBER = re.compile(r'^::: app\.([\w.]+)\n +options:\n +heading: "([\w.]+)"$', re.MULTILINE)
SECTION = re.compile(r"^(\w+)\n-{3,}$", re.MULTILINE)  # of a docstring in NumPy's form
LISTS = ("Parameters", "Attributes", "Returns", "Yields", "Raises", "Warns")  # sections of items with indented texts


def write_pages(folder: Path) -> Path:
    """Write every page as HTML, with its pictures, into a folder; return the first page."""
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
    """Return the Markdown of a page, with docstrings in place of mkdocstrings' directives."""
    text = (FOLDER / name).read_text(encoding="utf-8")
    text = FRONT.sub("", text)
    return MEMBER.sub(lambda found: _describe(found[1], found[2]), text)


def reading_folder(version: str) -> Path:
    """Return the folder for pages to read: in the user's cache, or a new temporary folder."""
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
    """Return the HTML id of a heading."""
    plain = re.sub(r"[`*\[\]]", "", heading).lower()
    return re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", plain)).strip("-")


def _describe(path: str, public_name: str) -> str:
    """Return the docstrings of a public Python name and of its members as Markdown."""
    module, _, attribute = path.rpartition(".")
    documented = getattr(import_module(f"{__name__.partition('.')[0]}.{module}"), attribute)
    parts = [f"## {public_name}", _entry(public_name, documented)]
    if inspect.isclass(documented):
        for member, value in vars(documented).items():
            if not member.startswith("_") and (inspect.isfunction(value) or isinstance(value, property)):
                parts.append(_entry(member, value))
    return "\n\n".join(parts)


def _entry(name: str, documented: Any) -> str:
    shown = "" if isinstance(documented, property) or inspect.isclass(documented) else _signature(documented)
    return f"### `{name}{shown}`\n\n{_docstring_markdown(inspect.getdoc(documented) or '')}"


def _docstring_markdown(docstring: str) -> str:
    """Return a docstring in NumPy's form as Markdown."""
    summary, *parts = SECTION.split(docstring)
    shown = [html.escape(summary.strip(), quote=False)]
    for title, body in zip(parts[::2], parts[1::2], strict=True):
        if title == "Examples":
            shown.append(f"```pycon\n{inspect.cleandoc(body)}\n```")
        else:
            text = html.escape(body.strip("\n"), quote=False)
            shown.append(f"**{title}**\n\n{_list_markdown(text) if title in LISTS else text}")
    return "\n\n".join(shown)


def _list_markdown(body: str) -> str:
    """Return the items of a docstring's section as a Markdown list."""
    return re.sub(r"^(\S.*)$", r"- `\1`:", body, flags=re.MULTILINE)


def _signature(documented: Any) -> str:
    """Return the names and defaults of the arguments; the docstring has their types."""
    signature = inspect.signature(documented)
    kept = [each.replace(annotation=inspect.Parameter.empty) for each in signature.parameters.values()]
    shown = str(signature.replace(parameters=kept, return_annotation=inspect.Signature.empty))
    shown = re.sub(r"<function (\w+) at \w+>", r"\1", shown)  # of a default
    return shown.replace("(self, ", "(").replace("(self)", "()")
