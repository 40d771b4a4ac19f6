"""Opens a recording in the viewer of the installed wheel, or says how to."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import webbrowser
from enum import StrEnum
from pathlib import Path

import rerun_cli


class ViewerKind(StrEnum):
    NATIVE = "native"
    WEB = "web"
    NONE = "none"


def viewer_binary() -> Path:
    """The viewer that belongs to the installed SDK: the binary itself.

    The `rerun` console script only wraps it, and ending the wrapper leaves the viewer running.
    """
    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    return Path(rerun_cli.__file__).parent / name


def viewer_environment() -> dict[str, str]:
    """What every viewer is started with: it then counts nothing of its use, and tells nobody.

    On a machine that tests programs it does neither, whatever its own file of settings says.
    """
    forced = "FORCE_RERUN_ANALYTICS"
    return {name: value for name, value in os.environ.items() if name != forced} | {"CI": "1"}


def run_tool(command: str, *arguments: Path | str) -> None:
    """Run `rerun rrd COMMAND` of the installed SDK; raises OSError with what it says where it fails."""
    done = subprocess.run(
        [viewer_binary(), "rrd", command, *map(str, arguments)],
        env=viewer_environment(), stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace",
    )  # fmt: skip
    if done.returncode:
        raise OSError(f"rerun rrd {command} failed: {' '.join(done.stderr.split())[-300:]}")


def view_command(path: Path | str, *also: Path | str) -> list[str]:
    """The command that shows a recording, with its side files, in a window."""
    return [str(viewer_binary()), *map(str, (path, *also))]


def has_display() -> bool:
    """Whether a window can be opened here."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_viewer(path: Path | str, kind: ViewerKind | str = ViewerKind.NATIVE, *also: Path | str) -> str | None:
    """Show a recording, with its side files, and return at once; the viewer lives on.

    Returns None where a window was opened, else one line that says how to look at the recording, or where.
    Raises FileNotFoundError where there is no recording.
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
        from .recording_server import IDLE, serve_apart

        address = serve_apart([Path(each) for each in (path, *also)])
        if has_display():
            webbrowser.open(address)
        return f"At {address} until nobody has asked for {IDLE / 3600.0:g} h."
    subprocess.Popen(
        view_command(path, *also),
        env=viewer_environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # survives this process, and an interrupt meant for it
    )
    return None
