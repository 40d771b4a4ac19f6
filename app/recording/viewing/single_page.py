"""One HTML file that shows recordings in any browser, opened from a disk: it contains the viewer and the data.

Nothing is loaded from the network, and the content policy of the page forbids requests. The viewer, most of the file,
is included once for all recordings. The file is written in UTF-16: nearly every character encodes two bytes of the
compressed data, a quarter less than base64. Its byte order mark declares the encoding to every browser.
"""

from __future__ import annotations

import base64
import gzip
import html
from codecs import BOM_UTF16_LE
from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path

import numpy as np

from ...process.atomic import write_atomically
from ..look.printable_text import printable
from ..parts import parts_of
from .web_viewer import read_web_viewer

TEMPLATE = "pages/single_page.html"
INSTRUCTIONS = (
    "Drag the slider at the bottom to go through the photographs. A click on a contact or a grain shows its numbers. "
    "The tabs above show the trust in the forces, their distribution, and which bodies are in contact."
)
SURROGATES = (0xD800, 0xDFFF)  # not characters by themselves
ESCAPE, FLIPPED_BIT = 0x3D, 0x8000  # the mark before a character that HTML would alter, and the bit flipped in it
UNSAFE_UNITS = (0x00, 0x0D, ord("<"), ESCAPE)
RELOAD_HINT = " Reload the page to come back to this list."


def write_single_page(recordings: Sequence[Path], target: Path | str, *, title: str, cards: Sequence[str] = ()) -> int:
    """Write a page that contains the web viewer and recordings.

    The page needs a browser with WebAssembly and WebGL 2 or WebGPU; `?renderer=webgl` after its address selects WebGL.

    Parameters
    ----------
    recordings : sequence of Path
        The recordings; one in parts opens as one.
    target : Path or str
        The HTML file.
    title : str
        Title of the page.
    cards : sequence of str
        HTML shown for every recording before one is opened; empty: the first opens at once.

    Returns
    -------
    int
        Size of the file [bytes].

    Raises
    ------
    FileNotFoundError
        If a recording does not exist.
    RuntimeError
        If the viewer does not serve its web files.
    """
    page = _page(recordings, title, cards, as_characters)
    write_atomically(Path(target), BOM_UTF16_LE + page.encode("utf-16-le"))
    return Path(target).stat().st_size


def single_page(recordings: Sequence[Path], *, title: str) -> str:
    """Return the text of such a page, with base64 data, which stay small in UTF-8 as well."""
    return _page(recordings, title, (), _as_base64)


def as_characters(data: bytes) -> str:
    """Encode bytes as characters of two bytes each; the script of the page decodes them."""
    units = np.frombuffer(data + b"\0" * (len(data) % 2), "<u2")
    low, high = SURROGATES
    escaped = ((units >= low) & (units <= high)) | np.isin(units, UNSAFE_UNITS)
    place = np.arange(len(units)) + np.cumsum(escaped)
    text = np.empty(len(units) + int(escaped.sum()), "<u2")
    text[place] = np.where(escaped, units ^ FLIPPED_BIT, units)
    text[place[escaped] - 1] = ESCAPE
    return text.tobytes().decode("utf-16-le")


def _as_base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _page(recordings: Sequence[Path], title: str, cards: Sequence[str], encode: Callable[[bytes], str]) -> str:
    def packed(name: str, data: bytes) -> str:
        small = gzip.compress(data, 6, mtime=0)
        mark = ' data-base64=""' if encode is _as_base64 else ""
        return f'<script type="application/gzip" id="{name}" data-size="{len(small)}"{mark}>{encode(small)}</script>'

    viewer = read_web_viewer()
    script = viewer.script.decode("utf-8").replace("</script", "<\\/script")
    page = files(__name__.rpartition(".")[0]).joinpath(TEMPLATE).read_text(encoding="utf-8")
    parts = {
        "@MODULE@": packed("module", viewer.module),
        "@RECORDINGS@": "\n".join(
            packed(f"recording-{k}-{number}", part.read_bytes())
            for k, recording in enumerate(recordings)
            for number, part in enumerate(parts_of(Path(recording)))
        ),
        "@SCRIPT@": script,
        "@COVER@": _cover(title, cards) if cards else "",
        "@TITLE@": html.escape(printable(title)),
    }
    for mark, content in parts.items():
        page = page.replace(mark, content)
    return page


def _cover(title: str, cards: Sequence[str]) -> str:
    """Return the content shown before the viewer starts: a card and a button for every recording, and instructions."""
    several = len(cards) > 1
    articles = [
        f'<article>{card}<button data-recording="{k}">Open the recording</button></article>'
        for k, card in enumerate(cards)
    ]
    instructions = INSTRUCTIONS + (RELOAD_HINT if several else "")
    head = f"<h1>{html.escape(printable(title))}</h1>" if several else ""
    kind = "several" if several else "single"
    return f'<div id="cover" class="{kind}">{head}<p>{instructions}</p><main>{"".join(articles)}</main></div>'
