"""Inspection in a real browser: what is told blind, what eyes and program are compared by, a circle by three clicks."""

from pathlib import Path

import pytest
from playwright.sync_api import Page, expect
from rodsight.workbench.setup.draft import Draft

from tests.app.workbench.hand import fill, go, idle, on_screen, opened
from tests.golden.stored import unpack

pytestmark = pytest.mark.screen


@pytest.fixture
def solved(photographs_only: Path) -> Path:
    """A folder with an experiment of photographs and the results of an earlier version."""
    Draft(photographs_only / "my photographs").set_keys("all", {
        "name": "mine", "photographs.files": "pictures/*.jpg", "photographs.interval": 30.0,
        "photographs.pixel_size": 2.5e-4,
    })  # fmt: skip
    (photographs_only / "runs" / "mine").mkdir(parents=True)
    unpack(2, photographs_only / "runs" / "mine")
    return photographs_only


def test_blind_nothing_tells_what_was_found_and_judges_are_compared(page: Page, solved: Path):
    with opened(page, solved) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        go(tab, "inspect")
        assert tab.evaluate("bench.frame") == 2  # the run begins there
        fill_name(tab)
        tab.keyboard.press("ArrowRight")
        idle(tab)
        tab.keyboard.press("Space")
        card = tab.locator("#card")
        expect(card).to_contain_text("P(touch)")
        low = tab.evaluate("document.querySelector('#card .verdicts').getBoundingClientRect().bottom")
        assert low < 640.0  # verdicts are in sight on a small screen
        tab.keyboard.press("b")
        idle(tab)
        for word in ("P(touch)", "f_n", "gap", "sticking", "What if"):
            expect(card).not_to_contain_text(word)
        expect(tab.locator("#agreement")).to_have_count(0)
        expect(tab.locator("#show-recording")).to_be_disabled()
        tab.keyboard.press("f")
        rods = tab.evaluate("bench.step.rodsOfFrame()")
        for place in zip(rods[0::3], rods[1::3], strict=True):  # the first whose middle is not near a pair
            tab.keyboard.press("Escape")
            tab.mouse.click(*on_screen(tab, place))
            idle(tab)
            if "–" not in (tab.locator("#card .fact").first.text_content() or ""):
                break
        expect(card).to_contain_text("radius")
        expect(card.locator(".list")).to_have_count(0)
        tab.keyboard.press("Escape")
        for key in ("Space", "c", "n", "b"):
            tab.keyboard.press(key)
            idle(tab)
        tab.keyboard.press("Escape")
        tab.locator("#agreement summary").click()
        idle(tab)
        expect(tab.locator("#agreement tbody").first.locator("tr")).to_have_count(2)  # a frame, and all
        expect(tab.locator("#agreement")).to_contain_text("judge more pairs")


def test_a_circle_is_three_clicks(page: Page, solved: Path):
    with opened(page, solved) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        go(tab, "walls")
        tab.click("#draw-circle")
        for place in ((450.0, 300.0), (250.0, 500.0), (50.0, 300.0)):
            tab.mouse.click(*on_screen(tab, place))
            idle(tab)
        circle = tab.evaluate("bench.project.walls[0].circle")
        assert (circle["x"], circle["y"], circle["radius"]) == pytest.approx((250.0, 300.0, 200.0), abs=2.0)
        fill(tab, "pressure-circle", "50")
        assert tab.evaluate("bench.project.walls[0].pressure") == 5e4
        tab.select_option("#side-0", "out")
        idle(tab)
        assert tab.evaluate("bench.project.walls[0].circle.side") == "out"
        tab.keyboard.press("Control+z")


def fill_name(tab: Page) -> None:
    """Verdicts are signed."""
    tab.fill("#who", "anna")
    tab.keyboard.press("Enter")
    idle(tab)
    tab.locator("#canvas").focus()
