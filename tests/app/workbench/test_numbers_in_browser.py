"""Numbers with their standard deviations, and signs with their names, as the page writes them. In a real Chromium."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.app.workbench.hand import go, idle, opened
from tests.app.workbench.test_inspecting_in_browser import open_contact

pytestmark = pytest.mark.screen

WRITTEN = """async (values) => {
  const { withDeviation } = await import("/page/dom.js");
  return values.map(([value, deviation, unit]) => withDeviation(value, deviation, unit));
}"""
TEXTS = """async () => {
  const texts = [], write = CanvasRenderingContext2D.prototype.fillText;
  CanvasRenderingContext2D.prototype.fillText = function (text, ...place) { texts.push(text); return write.call(this, text, ...place); };
  workbench.stage.redraw();
  await new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)));
  CanvasRenderingContext2D.prototype.fillText = write;
  return texts;
}"""  # noqa: E501


def test_a_value_has_the_decimals_of_its_standard_deviation(page: Page, solved: Path):
    with opened(page, solved) as tab:
        assert tab.evaluate(WRITTEN, [
            [2.46012, 0.00096, "mm"], [15.31, 6.94, "N"], [383.4, 23.0, "N"], [1234.5, 150.0, "N"], [2.0, 0.0997, "N"],
            [15.31, None, "N"], [15.31, 0.0, "N"], [None, 1.0, "N"], [0.4712, None, ""],
        ]) == [
            "2.460 ± 0.00096 mm", "15.3 ± 6.9 N", "383 ± 23 N", "1235 ± 150 N", "2.00 ± 0.10 N", "15.3 N", "15.3 N",
            "–", "0.471",
        ]  # fmt: skip


def test_the_forces_of_a_contact_have_a_unit_and_states_a_legend(page: Page, solved: Path):
    with opened(page, solved) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        go(tab, "inspect")
        expect(tab.locator("#reasons li").first).to_be_visible()
        box = tab.locator("#lanes").bounding_box() or {}
        tab.mouse.move(box["x"] + box["width"] - 4.0, box["y"] + 0.5 * box["height"])
        assert re.match(r"\d: [a-z]+, T .*, φ .*°.*\ncolours: status", tab.get_attribute("#lanes", "title") or "")
        expect(open_contact(tab)).to_contain_text("normal force over the frames [N]; bars: one standard deviation")
        assert "sticking" not in tab.evaluate(TEXTS)
        tab.locator("#canvas").focus()
        tab.keyboard.press("y")
        tab.check("#layer-contacts")
        idle(tab)
        assert {"contacts", "sticking", "sliding", "open"} <= set(tab.evaluate(TEXTS))
