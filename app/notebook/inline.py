"""Where Python runs: in a notebook a recording is shown below the cell, elsewhere in the viewer."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

WIDTH, HEIGHT = "100%", 720  # [px] of a recording below a cell


def in_notebook() -> bool:
    """Whether a Jupyter kernel runs this process."""
    shell: Any = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return shell is not None and hasattr(shell, "kernel")


def show_recording(recording: Path) -> Any:
    """Show a recording: a frame of the page to be displayed in a notebook; elsewhere None, and the viewer opens.

    Where neither is possible, the sentence that says how to look at it.
    """
    if in_notebook():
        from IPython.display import IFrame  # pyright: ignore[reportMissingImports]

        from ..recording.viewing.recording_server import serve_apart

        return IFrame(serve_apart([recording]), WIDTH, HEIGHT)
    from ..recording.viewing.viewer import open_viewer

    return open_viewer(recording)
