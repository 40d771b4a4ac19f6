"""Opens a recording in the viewer, in a window or in a browser, or returns how to open it."""

from __future__ import annotations

import shlex
from pathlib import Path

from .recording_server import IDLE_LIMIT, start_server_process
from .viewer import ViewerKind, has_display, start_viewer


def open_viewer(path: Path | str, kind: ViewerKind | str = ViewerKind.NATIVE, *also: Path | str) -> str | None:
    """Show a recording and return at once; the viewer runs on.

    Parameters
    ----------
    path : Path or str
        The recording.
    kind : ViewerKind or str
        Window, browser or none.
    *also : Path or str
        Side files, shown as one with the recording.

    Returns
    -------
    str or None
        None if a window was opened, else one line with the address or with the command that shows the recording.

    Raises
    ------
    FileNotFoundError
        If there is no recording.
    """
    kind = ViewerKind(kind)
    if not Path(path).is_file():
        raise FileNotFoundError(f"there is no recording {path}")
    shown = shlex.quote(str(path))
    if kind is ViewerKind.NONE:
        return f"To look at it: rodsight view {shown}"
    if kind is ViewerKind.NATIVE and not has_display():
        return f"No display here. In a browser: rodsight view --web {shown}; elsewhere: rerun {shown}"
    if kind is ViewerKind.WEB:
        address = start_server_process([Path(each) for each in (path, *also)], browser=has_display())
        return f"Served at {address} until {IDLE_LIMIT / 3600.0:g} h pass without a request."
    start_viewer(path, *also, stays=True)
    return None
