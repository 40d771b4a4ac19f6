"""Display of a recording: below the cell in a notebook, otherwise in the viewer."""

from __future__ import annotations

import html
import sys
from pathlib import Path
from typing import Any

HEIGHT = 720  # [px] of a recording below a cell
MAX_SIZE = 200_000_000  # [bytes] of a recording, all parts: browsers refuse pages of more than some 500 MB
# The viewer's script derives addresses from its own, which a page within a cell does not have.
NO_ADDRESS = ("document.currentScript !== null", "false")


def in_notebook() -> bool:
    """Whether a Jupyter kernel runs this process."""
    shell: Any = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return shell is not None and hasattr(shell, "kernel")


def show_recording(recording: Path) -> Any:
    """Show a recording.

    The viewer and all parts of the recording become part of the notebook, without a server.

    Returns
    -------
    IPython.display.HTML or str or None
        HTML in a notebook; otherwise None after opening the viewer, or a sentence on how to view the recording.
    """
    from ..recording.parts import parts_of

    parts = parts_of(recording)
    size = sum(part.stat().st_size for part in parts)
    if in_notebook() and size > MAX_SIZE:
        return (
            f"This recording is {size / 1e6:.0f} MB, too large for a notebook: `rodsight view {recording.parent}` "
            f"opens it, `rodsight share {recording.parent} --frames 0:100 --html` makes a page of some photographs."
        )
    if in_notebook():
        from IPython.display import HTML  # pyright: ignore[reportMissingImports]

        from ..recording.viewing.single_page import single_page

        page = single_page([recording], title=recording.parent.name).replace(*NO_ADDRESS)
        style = f"width: 100%; height: {HEIGHT}px; border: 0"
        return HTML(f'<iframe srcdoc="{html.escape(page, quote=True)}" style="{style}"></iframe>')
    from ..recording.viewing.open_viewer import open_viewer
    from ..recording.viewing.viewer import ViewerKind

    return open_viewer(recording, ViewerKind.NATIVE, *parts[1:])
