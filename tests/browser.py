"""Pages in a real browser without a screen: how it is started, and what is waited for on a picture."""

from __future__ import annotations

import shutil
import time

import cv2
import numpy as np
import pytest
from playwright.sync_api import Error, Page
from rodsight.solver.bodies.grains import Array

# A page draws with WebGL in software.
FLAGS = (
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
    "--disable-gpu-compositing", "--disable-gpu-rasterization", "--disable-accelerated-2d-canvas",
    "--disable-dev-shm-usage", "--disable-features=LocalNetworkAccessChecks",
)  # fmt: skip
SECONDS = 90.0  # for what is drawn in software on a busy machine
PATIENCE = 90.0  # [s] until a server answers
POLLING = 250.0  # [ms] between two looks of the browser at its own picture
DRAWN = 0.003  # least fraction of a page that strong forces cover
LEGEND_FROM = 0.8  # of the page's height: the legend of the forces, which is always drawn, lies below
LIKE = 50  # [grey] within which two colours are about the same

# The canvas of a page keeps what was drawn last, and `seen` looks at it in pixels of the page.
SEEN = """(() => {
  const open = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, wanted) {
    return open.call(this, kind, kind.startsWith("webgl") ? { ...wanted, preserveDrawingBuffer: true } : wanted);
  };
  const pixels = (left, top, width, height) => {
    const canvas = document.querySelector("canvas");
    if (!canvas || !canvas.clientWidth) return new Uint8ClampedArray();
    const scale = canvas.width / canvas.clientWidth;
    const place = [left, top, width, height].map((each) => each * scale);
    const copy = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
    copy.drawImage(canvas, ...place, 0, 0, width, height);
    return copy.getImageData(0, 0, width, height).data;
  };
  const count = (data, test) => {
    let found = 0;
    for (let k = 0; k < data.length; k += 4) found += test(data[k], data[k + 1], data[k + 2]);
    return found;
  };
  let former = "";
  globalThis.seen = {
    warm: (from, to) => {
      const top = Math.round(from * innerHeight), height = Math.round(to * innerHeight) - top;
      return count(pixels(0, top, innerWidth, height), (r, g, b) => r - b > 80) / (innerWidth * height);
    },
    near: ([x, y], reach, colour, like) => count(
      pixels(x - reach, y - reach, 2 * reach, 2 * reach),
      (...rgb) => rgb.every((value, k) => Math.abs(value - colour[k]) < like),
    ),
    colours: () => new Set(new Uint32Array(pixels(0, 0, innerWidth, innerHeight).buffer)).size,
    still: () => {
      const now = String(pixels(0, 0, innerWidth, innerHeight).reduce((sum, value) => (31 * sum + value) | 0, 7));
      const same = now === former;
      former = now;
      return same;
    },
  };
})()"""


def find_chromium() -> str:
    """Path of a Chromium; skips where there is none."""
    for name in ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable"):
        found = shutil.which(name)
        if found:
            return found
    pytest.skip("no chromium: apt-get install chromium")


def open_when_served(page: Page, address: str) -> None:
    """Open a page whose server may still have to start."""
    until = time.monotonic() + PATIENCE
    while True:
        try:
            page.goto(address)
            return
        except Error:  # nobody listens yet
            if time.monotonic() > until:
                raise
            page.wait_for_timeout(POLLING)


def wait_for_forces(page: Page) -> None:
    """Wait until a page with the force network in front shows forces, and not their legend alone."""
    until = time.monotonic() + SECONDS
    while True:
        page.wait_for_function(f"() => seen.warm(0, {LEGEND_FROM}) > {DRAWN}", polling=POLLING)
        if forces_drawn(picture_of(page)):
            return
        # The viewer draws while data come, so that a picture may be taken between two of its own that show forces.
        assert time.monotonic() < until, "the canvas has forces, the page's picture has none"


def wait_for_colour(page: Page, place: Array, colour: tuple[int, int, int], *, least: int, reach: int) -> None:
    """Wait until so many pixels around a place of the page have about a colour."""
    arguments = [[float(each) for each in place], reach, list(colour), LIKE]
    page.wait_for_function("([least, given]) => seen.near(...given) >= least", arg=[least, arguments], polling=POLLING)


def wait_until_still(page: Page) -> None:
    """Wait until two looks at the picture find the same."""
    page.wait_for_function("() => seen.still()", polling=2 * POLLING)


def picture_of(page: Page) -> np.ndarray:
    """What a page shows (h, w, 3), red green blue."""
    return read_picture(page.screenshot())


def read_picture(png: bytes) -> np.ndarray:
    """A picture (h, w, 3), red green blue."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    return cv2.cvtColor(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def warm_fraction(picture: np.ndarray) -> float:
    """Fraction of the picture in the colours of strong forces: red to yellow."""
    return float((picture[..., 0].astype(int) - picture[..., 2] > 80).mean())


def forces_drawn(picture: np.ndarray) -> bool:
    """Whether a page with the force network in front shows forces, and not their legend alone."""
    return warm_fraction(picture[: int(LEGEND_FROM * len(picture))]) > DRAWN
