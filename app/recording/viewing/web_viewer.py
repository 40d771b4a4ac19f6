"""The web viewer's two files, taken from the installed wheel: always the version of the SDK, and no network."""

from __future__ import annotations

import socket
import subprocess
import time
import urllib.request
from dataclasses import dataclass

from .viewer import viewer_binary, viewer_environment

START_SECONDS = 30.0


@dataclass(frozen=True, slots=True)
class WebViewer:
    script: bytes  # defines wasm_bindgen
    module: bytes  # WebAssembly


def read_web_viewer() -> WebViewer:
    """Read the files from the wheel's own viewer, which serves them to this machine for a moment.

    Raises RuntimeError where it does not start.
    """
    web_port, data_port = _free_port(), _free_port()
    command = [
        str(viewer_binary()), "--serve-web", "--bind", "127.0.0.1", "--web-viewer-port", str(web_port), "--port",
        str(data_port),
    ]  # fmt: skip
    viewer = subprocess.Popen(
        command, env=viewer_environment(), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    try:
        give_up = time.monotonic() + START_SECONDS
        while True:
            try:
                return WebViewer(_read(web_port, "re_viewer.js"), _read(web_port, "re_viewer_bg.wasm"))
            except OSError:
                if viewer.poll() is not None or time.monotonic() > give_up:
                    raise RuntimeError("the viewer of the installed rerun-sdk did not serve its files") from None
                time.sleep(0.02)
    finally:
        viewer.terminate()
        viewer.wait(10)


def _read(port: int, name: str) -> bytes:
    # No proxy of the environment stands between this machine and itself.
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with opener.open(f"http://127.0.0.1:{port}/{name}", timeout=START_SECONDS) as answer:
        return answer.read()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
