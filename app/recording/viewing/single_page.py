"""One file that shows recordings in any browser, opened from a disk: the viewer and the data inside the page.

Nothing is loaded from the network, and the page forbids the viewer to call out. The viewer, most of the file, is in it
once, however many recordings are.
"""

from __future__ import annotations

import base64
import gzip
import html
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from ...atomic import write_atomically
from ..look.texts import printable
from ..parts import parts_of
from .web_viewer import read_web_viewer

TEMPLATE = "single_page.html"
WHAT_TO_DO = (
    "Drag the slider at the bottom to go through the photographs. A click on a contact or a grain shows its numbers. "
    "The tabs above show how far to trust the forces, how they are distributed, and who touches whom."
)
COME_BACK = " Reload the page to come back to this list."


def write_single_page(recordings: Sequence[Path], target: Path | str, *, title: str, cards: Sequence[str] = ()) -> int:
    """Write a page that holds the web viewer and recordings; returns its size [bytes].

    cards: what the page shows of every recording before one is opened, as HTML; none: it opens the first at once. The
    page needs a browser with WebAssembly and WebGL 2 or WebGPU; `?renderer=webgl` after its address forbids the
    latter. Raises FileNotFoundError where there is no recording, RuntimeError where the viewer has no web part.
    """
    write_atomically(Path(target), single_page(recordings, title=title, cards=cards).encode("utf-8"))
    return Path(target).stat().st_size


def single_page(recordings: Sequence[Path], *, title: str, cards: Sequence[str] = ()) -> str:
    """The text of such a page; of a recording in parts all of them are in it, and open as one."""
    packed = [
        f'<script type="application/gzip" id="recording-{k}-{number}">{_packed(part.read_bytes())}</script>'
        for k, recording in enumerate(recordings)
        for number, part in enumerate(parts_of(Path(recording)))
    ]
    viewer = read_web_viewer()
    script = viewer.script.decode("utf-8").replace("</script", "<\\/script")
    page = files(__name__.rpartition(".")[0]).joinpath(TEMPLATE).read_text(encoding="utf-8")
    parts = {
        "@MODULE@": _packed(viewer.module),
        "@RECORDINGS@": "\n".join(packed),
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


def _packed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, 6, mtime=0)).decode("ascii")
