"""Response times of the workbench: every interaction in a real Chromium, and its requests.

    python -m tests.benchmarks.workbench_steps FOLDER     # one with an experiment of photographs and its finished run

The folder is copied and not changed. An interaction ends when the page has drawn its result and no request is pending;
on a shared machine the least of the rounds is the best estimate.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, expect, sync_playwright

from tests.app.workbench.hand import on_screen, opened
from tests.browser import SECONDS, find_chromium

ROUNDS = 3
FLAGS = ("--disable-gpu", "--disable-dev-shm-usage")  # drawn by the processor, as on a machine without a graphics card
STEPS = ("photographs", "scale", "walls", "rods", "material", "run", "inspect", "review", "correct", "share")
LIMIT = 300.0  # [ms]
PAUSE = 1.0  # [s] before the next interaction
WATCH = """(() => {
  const request = globalThis.fetch;
  globalThis.waits = { open: 0, took: [] };
  globalThis.fetch = async (address, ...rest) => {
    const since = performance.now(), name = String(address).split("?")[0] + (String(address).includes("size=20000") ? " (all pixels)" : "");
    const counts = name !== "/api/quality" && rest[0]?.priority !== "low"; // background requests
    waits.open += counts;
    try { const answer = await request(address, ...rest); const bytes = await answer.clone().arrayBuffer(); waits.took.push([name, performance.now() - since, bytes.byteLength]); return answer; }
    finally { waits.open -= counts; }
  };
  const drawn = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  globalThis.settled = async () => {
    for (;;) {
      await workbench.busy; await drawn();
      if (!waits.open && !workbench.stage.pending && [...document.images].every((each) => each.complete)) { await drawn(); if (!waits.open) return; }
    }
  };
})()"""  # noqa: E501  a page's script


class Clock:
    """Times of interactions by name [ms]."""

    def __init__(self, tab: Page) -> None:
        self.tab = tab
        self.took: dict[str, list[float]] = defaultdict(list)

    def time(self, name: str, work: Callable[[], object]) -> None:
        self.tab.evaluate("settled()")
        time.sleep(PAUSE)
        self.tab.evaluate("settled()")
        since = time.perf_counter()
        work()
        self.tab.evaluate("settled()")
        self.took[name].append(1e3 * (time.perf_counter() - since))

    def press(self, name: str, key: str) -> None:
        self.time(name, lambda: self.tab.keyboard.press(key))

    def click(self, name: str, selector: str) -> None:
        self.time(name, lambda: self.tab.locator(selector).first.click())


def go_through(clock: Clock) -> None:
    """Perform every step once."""
    tab = clock.tab
    clock.time("the first page", lambda: tab.click("#brand"))
    clock.time("open the experiment", lambda: tab.locator(".tile").first.click())
    for key, step in enumerate(STEPS, 1):
        clock.press(f"to step {step}", str(key % 10))
    tab.keyboard.press("1")
    clock.press("photographs: the next one", "ArrowRight")
    clock.time("zoom by the wheel", lambda: zoom(tab))
    clock.press("the whole picture", "f")
    set_up(clock)
    correct(clock)
    inspect(clock)
    review(clock)


def zoom(tab: Page) -> None:
    tab.mouse.move(500, 350)
    tab.mouse.wheel(0, -300)


def set_up(clock: Clock) -> None:
    tab = clock.tab
    tab.keyboard.press("2")
    tab.get_by_role("button", name="The number").click()
    size = 1e3 * tab.evaluate("workbench.project.pixel")
    tab.fill("#field-pixel-size", f"{size * 1.001:.7g}")
    clock.time("scale: a number", lambda: tab.locator("#field-pixel-size").press("Enter"))
    clock.press("undo", "Control+z")
    tab.locator("#canvas").focus()
    tab.keyboard.press("3")
    tab.fill("#field-pressure-top", "51")
    clock.time("walls: a pressure", lambda: tab.locator("#field-pressure-top").press("Enter"))
    line = tab.evaluate("workbench.project.walls[0].line")
    clock.time("walls: drag an end", lambda: pull(tab, line[1], (-9.0, 2.0)))
    tab.locator("#canvas").focus()
    tab.keyboard.press("4")
    if not tab.evaluate("Boolean(workbench.project.rods)"):
        clock.click("rods: detect them (with a progress bar)", "#detect")
        tab.wait_for_function("Boolean(workbench.project.rods)")
        tab.evaluate("settled()")
    x, y = tab.evaluate("[workbench.project.rods.x[600], workbench.project.rods.y[600]]")
    clock.time("rods: choose one", lambda: tab.mouse.click(*on_screen(tab, (x, y))))
    clock.press("rods: move it", "Shift+ArrowRight")
    clock.press("rods: make it larger", "]")
    clock.press("rods: delete it", "Delete")
    clock.time("rods: add one", lambda: tab.mouse.click(*on_screen(tab, (x, y))))
    tab.keyboard.press("5")
    clock.time("material: a preset", lambda: tab.get_by_role("button", name="brass").click())


def pull(tab: Page, start: list[float], by: tuple[float, float]) -> None:
    tab.mouse.move(*on_screen(tab, (start[0], start[1])))
    tab.mouse.down()
    tab.mouse.move(*on_screen(tab, (start[0] + by[0], start[1] + by[1])), steps=3)
    tab.mouse.up()


def correct(clock: Clock) -> None:
    tab = clock.tab
    tab.keyboard.press("9")
    expect(tab.locator("#next-uncertain")).to_be_visible()
    tab.evaluate("workbench.show(3)")
    tab.evaluate("settled()")
    clock.press("correct: the next photograph", "ArrowRight")
    rods = tab.evaluate("workbench.step.rods()")
    place = rods["x"][500], rods["y"][500]
    clock.time("correct: choose a rod", lambda: tab.mouse.click(*on_screen(tab, place)))
    clock.press("correct: move it, correlated again", "Shift+ArrowRight")
    clock.press("correct: keep", "Enter")
    clock.press("correct: undo", "Control+z")


def inspect(clock: Clock) -> None:
    tab = clock.tab
    tab.keyboard.press("7")
    tab.wait_for_selector("#colour-by")
    tab.evaluate("workbench.show(4)")
    tab.evaluate("settled()")
    clock.press("inspect: the next photograph", "ArrowRight")
    clock.press("inspect: the previous one", "ArrowLeft")
    clock.time("inspect: colour by", lambda: tab.select_option("#colour-by", "ft"))
    tab.locator("#canvas").focus()
    tab.keyboard.press("Escape")
    tab.keyboard.press("f")
    clock.time("inspect: click a rod", lambda: tab.mouse.click(*on_screen(tab, middle(tab))))
    clock.time("inspect: one of its contacts", lambda: tab.locator("#card .list button").first.click())
    clock.press("inspect: without the contact", "w")


def review(clock: Clock) -> None:
    tab = clock.tab
    tab.keyboard.press("8")
    tab.wait_for_selector("#next")
    tab.fill("#reviewer", "anna")
    tab.locator("#reviewer").press("Enter")
    tab.evaluate("settled()")
    tab.locator("#canvas").focus()
    clock.press("review: the next pair", "Space")
    clock.press("review: a verdict", "n")
    clock.press("review: undo", "z")
    clock.press("review: blind", "b")
    clock.press("review: not blind", "b")
    clock.press("review: the next photograph", "]")


def middle(tab: Page) -> tuple[float, float]:
    rods = tab.evaluate("workbench.step.rodsOfFrame()")
    return rods[3 * 500], rods[3 * 500 + 1]


def table(rows: dict[str, list[float]], title: str) -> str:
    lines = [f"{title:<40} median   least [ms]"]
    for name, took in rows.items():
        mark = "" if min(took) <= LIMIT else f"   over {LIMIT:g}"
        lines.append(f"{name:<40} {np.median(took):6.0f}  {min(took):6.0f}{mark}")
    return "\n".join(lines)


def measure(folder: Path) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
    """Measure interactions and requests of several rounds."""
    with sync_playwright() as driver, tempfile.TemporaryDirectory() as place:
        copy = Path(shutil.copytree(folder, Path(place) / "lab"))
        browser = driver.chromium.launch(executable_path=find_chromium(), args=FLAGS, chromium_sandbox=False)
        expect.set_options(timeout=1e3 * SECONDS)
        page = browser.new_context(color_scheme="dark").new_page()
        page.add_init_script(WATCH)
        page.set_default_timeout(1e3 * SECONDS)
        with opened(page, copy) as tab:
            clock = Clock(tab)
            for _ in range(ROUNDS):
                go_through(clock)
            requests: dict[str, list[float]] = defaultdict(list)
            for name, took, size in tab.evaluate("waits.took"):
                requests[f"{name} ({size / 1e3:.0f} kB)" if name == "/api/network" else name].append(took)
        browser.close()
    return clock.took, requests


if __name__ == "__main__":
    interactions, requested = measure(Path(sys.argv[1]))
    print(f"{os.cpu_count()} cores, {os.getloadavg()[0]:.1f} processes at work\n")
    print(table(interactions, "interaction"))
    print()
    print(table(dict(sorted(requested.items())), "request"))
