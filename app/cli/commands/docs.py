"""The command that opens the documentation: docs."""

from __future__ import annotations

import webbrowser
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from ...process.errors import InputError
from ..arguments import Flag


def docs(
    page: Annotated[str | None, Positional, arg(metavar="PAGE", help="to open, such as troubleshooting")] = None,
    /,
    text: Annotated[Flag, arg(help="print the page here instead of opening it")] = False,
    find: Annotated[str | None, arg(metavar="WORDS", help="list the sections that contain these words")] = None,
    out: Annotated[Path | None, arg(metavar="DIR", help="write the pages there")] = None,
) -> int:
    """Open the documentation in the browser: the installed pages, without a network.

    To search: rodsight docs --find "plot P(f)"

    Example: rodsight docs troubleshooting --text
    """
    from rich.console import Console

    from ... import __version__
    from ...manual.contents import pages
    from ...manual.reading import page_text, reading_folder, write_pages
    from ...recording.viewing.viewer import has_display
    from ..terminal import print_line

    if find is not None:
        return _find(find)
    names = {file.removesuffix(".md"): file for file in pages()}
    name = (page or "index").removesuffix(".md").replace("-", "_")
    if name not in names:
        near = get_close_matches(name, names, 1)
        hint = f"did you mean {near[0]}?" if near else f"the pages are {', '.join(names)}"
        raise InputError("docs", str(page), f"is not a page: {hint}")
    console = Console()
    if text:
        from rich.markdown import Markdown

        console.print(Markdown(page_text(names[name])))
        return 0
    first = write_pages(reading_folder(__version__) if out is None else out)
    shown = first.with_name(f"{name}.html")
    if out is None and has_display():
        webbrowser.open(shown.resolve().as_uri())
    print_line(console, f"{shown}; in this terminal: rodsight docs {name} --text")
    return 0


def _find(words: str) -> int:
    """List the sections that contain the words, with the command that shows each."""
    from rich.console import Console

    from ...manual.finding import find_sections

    sections = find_sections(words)
    if not sections:
        raise InputError("--find", repr(words), "occurs in no section: try fewer words, or parts of them")
    console = Console(highlight=False, markup=False)
    for section in sections:
        console.print(f"{section.title}: {section.heading}", style="bold")
        console.print(f"  rodsight docs {section.page.removesuffix('.md')}")
    return 0
