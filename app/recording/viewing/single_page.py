"""One file that shows a recording in any browser, opened from a disk: the viewer and the data inside the page.

Nothing is loaded from the network, and the page forbids the viewer to call out.
"""

from __future__ import annotations

import base64
import gzip
import html
from importlib.resources import files
from pathlib import Path

from ...atomic import write_atomically
from ..look.texts import printable
from .web_viewer import read_web_viewer

TEMPLATE = "single_page.html"


def write_single_page(recording: Path | str, target: Path | str, *, title: str) -> int:
    """Write a page that holds the web viewer and a recording; returns its size [bytes].

    The page needs a browser with WebAssembly and WebGL 2 or WebGPU; `?renderer=webgl` after its address forbids the
    latter. Raises FileNotFoundError where there is no recording, RuntimeError where the viewer has no web part.
    """
    write_atomically(Path(target), single_page(recording, title=title).encode("utf-8"))
    return Path(target).stat().st_size


def single_page(recording: Path | str, *, title: str) -> str:
    """The text of such a page."""
    data = Path(recording).read_bytes()
    viewer = read_web_viewer()
    script = viewer.script.decode("utf-8").replace("</script", "<\\/script")
    page = files(__name__.rpartition(".")[0]).joinpath(TEMPLATE).read_text(encoding="utf-8")
    parts = {
        "@TITLE@": html.escape(printable(title)),
        "@MODULE@": _packed(viewer.module),
        "@RECORDING@": _packed(data),
        "@SCRIPT@": script,
    }
    for mark, content in parts.items():
        page = page.replace(mark, content)
    return page


def _packed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, 6, mtime=0)).decode("ascii")
