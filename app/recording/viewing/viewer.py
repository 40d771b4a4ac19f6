"""The viewer program of the installed wheel: its binary, its environment, its tools and its ports."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType

import rerun_cli


class ViewerKind(StrEnum):
    NATIVE = "native"
    WEB = "web"
    NONE = "none"


def viewer_binary() -> Path:
    """Return the path of the viewer binary of the installed SDK.

    The `rerun` console script is a wrapper; ending the wrapper leaves the viewer running.
    """
    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    return Path(rerun_cli.__file__).parent / name


def viewer_environment() -> dict[str, str]:
    """Return the environment of every viewer process; with it the viewer collects no usage data.

    Notes
    -----
    The viewer disables its analytics where `CI` is set, whatever its own settings file contains, unless
    `FORCE_RERUN_ANALYTICS` is set.
    """
    forced = "FORCE_RERUN_ANALYTICS"
    return {name: value for name, value in os.environ.items() if name != forced} | {"CI": "1"}


def run_tool(command: str, *arguments: Path | str) -> None:
    """Run `rerun rrd COMMAND` of the installed SDK.

    Raises
    ------
    OSError
        If the tool fails; the message holds the end of its error output.
    """
    done = subprocess.run(
        [viewer_binary(), "rrd", command, *map(str, arguments)],
        env=viewer_environment(), stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace",
    )  # fmt: skip
    if done.returncode:
        raise OSError(f"rerun rrd {command} failed: {' '.join(done.stderr.split())[-300:]}")


def start_viewer(
    *arguments: Path | str,
    stdin: int = subprocess.DEVNULL,
    stays: bool = False,
    environment: Mapping[str, str] = MappingProxyType({}),
) -> subprocess.Popen[bytes]:
    """Start the viewer with further variables of its environment.

    `stays`: it survives this process and an interrupt of it.
    """
    return subprocess.Popen(
        [str(viewer_binary()), *map(str, arguments)], env={**viewer_environment(), **environment},
        start_new_session=stays, stdin=stdin, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def has_display() -> bool:
    """Return whether a window can be opened on this machine."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def free_port() -> int:
    """Return a free TCP port of 127.0.0.1."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
