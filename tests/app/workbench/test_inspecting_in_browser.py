"""Inspection and review in a real browser: the card of a contact, blind mode, agreement; a circle by three clicks."""

import json
import re
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect
from rodsight.run_folder import SUMMARY

from tests.app.workbench.hand import fill, go, idle, on_screen, opened

pytestmark = pytest.mark.screen


def test_a_contact_has_its_card_and_the_review_its_blind_mode(page: Page, solved: Path):
    with opened(page, solved) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        go(tab, "inspect")
        assert tab.evaluate("workbench.frame") == 2  # the run begins there
        card = open_contact(tab)
        for word in ("P(touch)", "f_n", "gap"):
            expect(card).to_contain_text(word)
        low = tab.evaluate("document.querySelector('#card .verdicts').getBoundingClientRect().bottom")
        assert low < 640.0  # verdicts are visible on a small screen
        tab.locator("#without").click()
        idle(tab)
        expect(card).to_contain_text("Without it")
        fill_name(tab)
        pair = tab.evaluate("workbench.step.chosen()")
        tab.keyboard.press("n")
        idle(tab)
        expect(tab.locator("#before-after")).to_contain_text("before the verdict")
        go(tab, "review")
        tab.wait_for_selector("#next")
        assert pair in [{"i": each["i"], "j": each["j"]} for each in judged(tab)]
        expect(tab.locator("#detector")).to_contain_text("detected")
        tab.keyboard.press("b")
        idle(tab)
        expect(tab.locator("#detector")).to_be_empty()
        for hidden in ("#gap", "#estimate", "#agreement", "#candidates"):
            expect(tab.locator(hidden)).to_have_count(0)
        for key in ("c", "n", "b"):
            tab.keyboard.press(key)
            idle(tab)
        tab.locator("#agreement summary").click()
        idle(tab)
        expect(tab.locator("#agreement tbody").first.locator("tr")).to_have_count(2)  # a frame, and all
        expect(tab.locator("#agreement")).to_contain_text("judge more pairs")
        tab.go_back()  # the browser's Back is the step before
        idle(tab)
        expect(tab.locator("#panel h1")).to_have_text("Inspect")


def open_contact(tab: Page) -> Locator:
    """Choose a rod of the frame, then its first contact; gives the card."""
    rods = tab.evaluate("workbench.step.rodsOfFrame()")
    card = tab.locator("#card")
    for place in zip(rods[0::3], rods[1::3], strict=True):  # the first whose middle is not near a pair
        tab.keyboard.press("Escape")
        tab.mouse.click(*on_screen(tab, place))
        idle(tab)
        if "–" not in (card.locator(".fact").first.text_content() or ""):
            break
    expect(card).to_contain_text("radius")
    card.locator(".list button").first.click()  # one of its contacts
    idle(tab)
    return card


def test_forces_of_open_scale_have_no_newtons(page: Page, solved: Path):
    summary = {"frame_count": 3, "grain_count": 12, "trust": [0.9] * 3, "status_count": {"settled": 3}}
    (solved / "runs" / "mine" / SUMMARY).write_text(json.dumps({**summary, "force_unit": "a.u."}))
    with opened(page, solved) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        go(tab, "inspect")
        card = open_contact(tab)
        expect(card).to_contain_text(re.compile(r"f_n[–0-9. ±]+ a\.u\."))
        assert re.search(r"\d N\b", card.inner_text()) is None


def judged(tab: Page) -> list[dict]:
    return [each for each in tab.evaluate("workbench.step.pairs()") if each["verdict"]]


def test_a_circle_is_three_clicks(page: Page, solved: Path):
    with opened(page, solved) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        go(tab, "walls")
        tab.click("#draw-circle")
        for place in ((450.0, 300.0), (250.0, 500.0), (50.0, 300.0)):
            tab.mouse.click(*on_screen(tab, place))
            idle(tab)
        circle = tab.evaluate("workbench.project.walls[0].circle")
        assert (circle["x"], circle["y"], circle["radius"]) == pytest.approx((250.0, 300.0, 200.0), abs=2.0)
        fill(tab, "pressure-circle", "50")
        assert tab.evaluate("workbench.project.walls[0].pressure") == 5e4
        tab.select_option("#side-0", "out")
        idle(tab)
        assert tab.evaluate("workbench.project.walls[0].circle.side") == "out"
        tab.keyboard.press("Control+z")


def fill_name(tab: Page) -> None:
    """Give the name of the reviewer, which every verdict carries."""
    tab.fill("#reviewer", "anna")
    tab.keyboard.press("Enter")
    idle(tab)
    tab.locator("#canvas").focus()
