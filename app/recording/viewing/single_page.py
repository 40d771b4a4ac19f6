"""One file that shows recordings in any browser, opened from a disk: the viewer and the data inside the page.

Nothing is loaded from the network, and the page forbids the viewer to call out. The viewer, most of the file, is in it
once, however many recordings are. A file is written in UTF-16, of which nearly all characters may stand for two bytes
of what is compressed: a quarter less than base64. Its byte order mark tells every browser so, whatever a server says.
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

from ...atomic import write_atomically
from ..look.texts import printable
from ..parts import parts_of
from .web_viewer import read_web_viewer

TEMPLATE = "single_page.html"
WHAT_TO_DO = (
    "Drag the slider at the bottom to go through the photographs. A click on a contact or a grain shows its numbers. "
    "The tabs above show how far to trust the forces, how they are distributed, and who touches whom."
)
SURROGATES = (0xD800, 0xDFFF)  # no characters on their own
ESCAPE, FLIPPED = 0x3D, 0x8000  # before a character that HTML would not leave alone, and what such a one is told with
NOT_LEFT_ALONE = (0x00, 0x0D, ord("<"), ESCAPE)
COME_BACK = " Reload the page to come back to this list."


def write_single_page(recordings: Sequence[Path], target: Path | str, *, title: str, cards: Sequence[str] = ()) -> int:
    """Write a page that holds the web viewer and recordings; returns its size [bytes].

    cards: what the page shows of every recording before one is opened, as HTML; none: it opens the first at once. The
    page needs a browser with WebAssembly and WebGL 2 or WebGPU; `?renderer=webgl` after its address forbids the
    latter. Raises FileNotFoundError where there is no recording, RuntimeError where the viewer has no web part.
    """
    page = _page(recordings, title, cards, as_characters)
    write_atomically(Path(target), BOM_UTF16_LE + page.encode("utf-16-le"))
    return Path(target).stat().st_size


def single_page(recordings: Sequence[Path], *, title: str, cards: Sequence[str] = ()) -> str:
    """The text of such a page, in letters that stay small in UTF-8, too; of a recording in parts all open as one."""
    return _page(recordings, title, cards, _as_letters)


def as_characters(data: bytes) -> str:
    """Bytes, two a character; the page turns them back."""
    units = np.frombuffer(data + b"\0" * (len(data) % 2), "<u2")
    low, high = SURROGATES
    told_otherwise = ((units >= low) & (units <= high)) | np.isin(units, NOT_LEFT_ALONE)
    place = np.arange(len(units)) + np.cumsum(told_otherwise)
    text = np.empty(len(units) + int(told_otherwise.sum()), "<u2")
    text[place] = np.where(told_otherwise, units ^ FLIPPED, units)
    text[place[told_otherwise] - 1] = ESCAPE
    return text.tobytes().decode("utf-16-le")


def _as_letters(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _page(recordings: Sequence[Path], title: str, cards: Sequence[str], written: Callable[[bytes], str]) -> str:
    def packed(name: str, data: bytes) -> str:
        small = gzip.compress(data, 6, mtime=0)
        letters = ' data-letters=""' if written is _as_letters else ""
        return (
            f'<script type="application/gzip" id="{name}" data-size="{len(small)}"{letters}>{written(small)}</script>'
        )

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
    """What is there before the viewer is: a card and a button for every recording, and what to do with them."""
    several = len(cards) > 1
    articles = [
        f'<article>{card}<button data-recording="{k}">Open the recording</button></article>'
        for k, card in enumerate(cards)
    ]
    told = WHAT_TO_DO + (COME_BACK if several else "")
    head = f"<h1>{html.escape(printable(title))}</h1>" if several else ""
    kind = "several" if several else "single"
    return f'<div id="cover" class="{kind}">{head}<p>{told}</p><main>{"".join(articles)}</main></div>'
