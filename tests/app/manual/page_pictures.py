"""The manual's pictures of the workbench: the sample, with a reflection painted on a rod, in a headless browser."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
from PIL import Image
from playwright.sync_api import Page, sync_playwright
from rodsight.solver.bodies.grains import Array

from tests.app.workbench.hand import drag, go, idle, on_screen, opened
from tests.browser import FLAGS
from tests.program import ROOT

CHROMIUM = "/usr/bin/chromium"
PIXEL, DAZZLED, FRAME, REFLECTION = 2.5e-4, 7, 11, 0.62  # [m]; photographs; radius over that of the rod
JUDGED = 3
REPORT = {"width": 1280, "height": 1000}


def draw_page(folder: Path, target: Path, run: Callable[..., None]) -> None:
    """Write the pictures of a correction, a judged contact that a second run applies, and the review."""
    folder.mkdir()
    shutil.copytree(ROOT / "sample_data/shear", folder / "shear")
    place = _paint_reflection(folder / "shear")
    with sync_playwright() as engine:
        browser = engine.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", *FLAGS])
        results = folder / "runs/shear"
        run("run", folder / "shear", "--out", results, "--quiet")
        page = browser.new_page(color_scheme="dark")
        with opened(page, folder) as tab:
            _enter(tab, "correct", DAZZLED)
            tab.mouse.click(*on_screen(tab, (place[0], place[1])))
            idle(tab)
            tab.evaluate("([x, y]) => workbench.stage.centre(x, y, 4)", list(place))
            idle(tab)
            x, y, _ = tab.evaluate("workbench.step.ghost()")
            drag(tab, (x, y), (x + 3.0, y - 2.0))
            _save(tab, target / "workbench_correct.jpg")
            _enter(tab, "review", FRAME)
            tab.wait_for_selector("#next")
            pair = tab.evaluate("review.pair")  # the most influential of the ambiguous ones
            _choose(tab, pair)
            _name(tab)
            tab.keyboard.press("n")
            idle(tab)
        run("run", folder / "shear", "--out", results, "--quiet")
        page = browser.new_page(color_scheme="dark")
        with opened(page, folder) as tab:
            _choose(tab, pair)
            _name(tab)
            _save(tab, target / "workbench_inspect.jpg")
            go(tab, "review")
            tab.wait_for_selector("#next")
            for _ in range(JUDGED):
                tab.keyboard.press("c")
                idle(tab)
            _save(tab, target / "review.jpg")
        browser.close()


def draw_report(page: Path, target: Path) -> None:
    """Write the picture of a campaign's report."""
    with sync_playwright() as engine:
        browser = engine.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", *FLAGS])
        tab = browser.new_page(viewport=REPORT)
        tab.goto(page.as_uri())
        tab.screenshot(path=target)
        browser.close()


def _paint_reflection(experiment: Path) -> Array:
    """Paint a bright disc on a rod in the middle of a photograph; return the place of the rod [px]."""
    radii = pd.read_csv(experiment / "grains.csv")[["id", "radius"]]
    tracks = pd.read_csv(experiment / "truth_tracks.csv").merge(radii)
    file = sorted((experiment / "photos").iterdir())[DAZZLED]
    photograph = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
    assert photograph is not None
    here = tracks[tracks["frame"] == DAZZLED]
    places = np.column_stack([here["x"] / PIXEL, photograph.shape[0] - 1 - here["y"] / PIXEL])
    row = int(np.hypot(*(places - 0.5 * np.array(photograph.shape[::-1])).T).argmin())
    centre = (int(places[row, 0]) - 5, int(places[row, 1]) + 4)
    cv2.circle(photograph, centre, round(REFLECTION * float(here["radius"].iloc[row])), 250, -1, cv2.LINE_AA)
    cv2.imwrite(str(file), photograph, [cv2.IMWRITE_JPEG_QUALITY, 92])
    return places[row]


def _choose(tab: Page, pair: dict) -> None:
    """Choose a contact of FRAME in the step Inspect."""
    _enter(tab, "inspect", FRAME)
    tab.evaluate("([x, y]) => workbench.stage.centre(x, y, 2.2)", pair["point"])
    idle(tab)
    tab.mouse.click(*on_screen(tab, (pair["point"][0], pair["point"][1])))
    idle(tab)
    assert tab.evaluate("workbench.step.chosen()") == {"i": pair["i"], "j": pair["j"]}


def _name(tab: Page) -> None:
    """Give the name of the reviewer, which every verdict carries."""
    tab.fill("#reviewer", "anna")
    tab.keyboard.press("Enter")
    idle(tab)
    tab.locator("#canvas").focus()


def _enter(tab: Page, step: str, frame: int) -> None:
    if tab.locator(".tile").first.is_visible():
        tab.locator(".tile").first.click()
        idle(tab)
    go(tab, step)
    tab.evaluate("(k) => workbench.show(k)", frame)
    idle(tab)


def _save(tab: Page, file: Path) -> None:
    tab.wait_for_function("() => !document.querySelector('#toast').classList.contains('shown')")
    tab.wait_for_timeout(1000.0)
    picture = file.with_suffix(".png")
    tab.screenshot(path=picture)
    Image.open(picture).convert("RGB").save(file, quality=90)
    picture.unlink()
