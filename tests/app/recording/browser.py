"""A real browser without a screen, driven through a pipe: pages are opened and pictured as a person would see them."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any

import cv2
import numpy as np
import pytest

FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run", "--use-gl=angle",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--remote-debugging-pipe",
)  # fmt: skip


def find_chromium() -> str:
    for name in ("chromium", "chromium-browser", "google-chrome"):
        found = shutil.which(name)
        if found:
            return found
    pytest.skip("no chromium: apt-get install chromium")


class Browser:
    """One page of one browser, which ends with the `with` block."""

    def __init__(self, width: int = 1000, height: int = 700) -> None:
        self._size = width, height
        self._number = 0
        self._rest = b""
        self.messages: list[str] = []  # errors on the page's console

    def __enter__(self) -> Browser:
        chromium = find_chromium()
        self._profile = tempfile.mkdtemp(prefix="browser-")
        there, self._write = os.pipe()
        self._read, back = os.pipe()

        def pipes() -> None:  # the browser reads from descriptor 3 and writes to 4
            os.dup2(there, 3)
            os.dup2(back, 4)

        # Descriptors 3 and 4 may be the very ones that the pipes got: move ours out of the way first.
        there, back = (os.dup(each) if each > 4 else _above(each) for each in (there, back))
        self._process = subprocess.Popen(
            [chromium, *FLAGS, f"--user-data-dir={self._profile}", f"--window-size={self._size[0]},{self._size[1]}"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            preexec_fn=pipes, close_fds=False,
        )  # fmt: skip
        os.close(there)
        os.close(back)
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self._on_page("Runtime.enable")
        self._on_page("Page.enable")
        width, height = self._size
        self._on_page(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.terminate()
        self._process.wait(20)
        os.close(self._read)
        os.close(self._write)
        shutil.rmtree(self._profile, ignore_errors=True)

    def open(self, address: str, seconds: float = 30.0) -> None:
        """Open a page, waiting for its server to answer."""
        end = time.monotonic() + seconds
        while "errorText" in self._on_page("Page.navigate", url=address):
            assert time.monotonic() < end, f"{address} does not answer"
            time.sleep(0.2)

    def evaluate(self, script: str) -> Any:
        return self._on_page("Runtime.evaluate", expression=script, awaitPromise=True).get("result", {}).get("value")

    def wait_for(self, script: str, seconds: float = 90.0) -> None:
        """Wait until a script is true."""
        end = time.monotonic() + seconds
        while not self.evaluate(script):
            assert time.monotonic() < end, f"{script} did not come true; the page says: {self.messages[-3:]}"
            time.sleep(0.3)

    def picture(self) -> np.ndarray:
        """What the page shows (h, w, 3), red green blue."""
        for _ in range(50):
            try:
                png = base64.b64decode(self._on_page("Page.captureScreenshot", format="png")["data"])
                break
            except AssertionError:  # between two pages there is nothing to picture
                time.sleep(0.2)
        else:
            raise AssertionError("the browser takes no picture")
        return cv2.cvtColor(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)

    def shows(self, test: Callable[[np.ndarray], bool], seconds: float = 90.0) -> bool:
        """Whether what the page shows passes a test before the time is up."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if test(self.picture()):
                return True
            time.sleep(0.3)
        return False

    def _on_page(self, method: str, **parameters: Any) -> dict[str, Any]:
        return self._call(method, session=self._session, **parameters)

    def _call(self, method: str, *, session: str | None = None, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if session is not None:
            message["sessionId"] = session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._write, data) :]
        while True:
            answer = self._message()
            if answer.get("method") == "Runtime.exceptionThrown":
                self.messages.append(str(answer["params"]["exceptionDetails"])[:300])
            if answer.get("id") == self._number:
                assert "error" not in answer, answer["error"]
                return answer["result"]

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            part = os.read(self._read, 1 << 20)
            assert part, "the browser ended"
            self._rest += part
        message, self._rest = self._rest.split(b"\0", 1)
        return json.loads(message)


DRAWN = 0.003  # least share of a page that strong forces cover
LEGEND_FROM = 0.8  # of the page's height: the legend of the forces, which is always drawn, lies below


def warm_share(picture: np.ndarray) -> float:
    """Share of the picture in the colours of strong forces: red to yellow."""
    return float((picture[..., 0].astype(int) - picture[..., 2] > 80).mean())


def forces_drawn(picture: np.ndarray) -> bool:
    """Whether a page with the force network in front shows forces, and not their legend alone."""
    return warm_share(picture[: int(LEGEND_FROM * len(picture))]) > DRAWN


def _above(descriptor: int) -> int:
    """A copy of a descriptor above 4."""
    copies = []
    while (copy := os.dup(descriptor)) <= 4:
        copies.append(copy)
    for each in copies:
        os.close(each)
    return copy
