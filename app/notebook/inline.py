"""Where Python runs: in a notebook a recording is shown below the cell, elsewhere in the viewer."""

from __future__ import annotations

import html
import sys
from pathlib import Path
from typing import Any

HEIGHT = 720  # [px] of a recording below a cell
GREATEST = 200_000_000  # [bytes] of a recording, all parts: browsers refuse pages of more than some 500 MB
# The viewer's script takes its own address for a part of one, and a page within a cell has none.
NO_ADDRESS = ("document.currentScript !== null", "false")


def in_notebook() -> bool:
    """Whether a Jupyter kernel runs this process."""
    shell: Any = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return shell is not None and hasattr(shell, "kernel")


def show_recording(recording: Path) -> Any:
    """Show a recording: what a notebook displays below the cell; elsewhere None, and the viewer opens.

    Where neither is possible, the sentence that says how to look at it. Viewer and recording, all of its parts, become
    part of the notebook: no server is asked, and other pages may not frame those that Rodsight serves.
    """
    from ..recording.parts import parts_of

    parts = parts_of(recording)
    size = sum(part.stat().st_size for part in parts)
    if in_notebook() and size > GREATEST:
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
    from ..recording.viewing.viewer import ViewerKind, open_viewer

    return open_viewer(recording, ViewerKind.NATIVE, *parts[1:])
