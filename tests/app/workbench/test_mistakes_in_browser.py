"""A person who makes mistakes: every one is named on screen or undone, and nothing is lost. In a real Chromium."""

from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.app.workbench.hand import drag, fill, go, idle, opened

pytestmark = pytest.mark.screen


def enter(tab: Page, step: str) -> None:
    tab.locator(".tile").first.click()
    idle(tab)
    go(tab, step)


def test_a_step_shows_the_photograph_that_it_edits(page: Page, begun: Path):
    with opened(page, begun) as tab:
        enter(tab, "photographs")
        tab.locator("#canvas").focus()
        for _ in range(3):
            tab.keyboard.press("ArrowRight")
        idle(tab)
        assert tab.evaluate("workbench.frame") == 3
        for step in ("scale", "walls", "rods", "material"):
            go(tab, step)
            assert tab.evaluate("workbench.frame") == 0
            assert "frame=0" in tab.evaluate("workbench.stage.wanted")
            expect(tab.locator("#hint")).to_contain_text("Photograph 0")
        tab.locator("#canvas").focus()
        tab.keyboard.press("ArrowRight")
        expect(tab.locator("#toast")).to_contain_text("This step edits photograph 0")
        assert tab.evaluate("workbench.frame") == 0
        go(tab, "photographs")
        assert tab.evaluate("workbench.frame") == 3  # where one looked last


def test_undo_by_key_and_browser_back(page: Page, begun: Path):
    with opened(page, begun) as tab:
        enter(tab, "photographs")
        fill(tab, "interval", "31")
        go(tab, "material")
        fill(tab, "density", "8400")
        go(tab, "scale")
        tab.reload()
        idle(tab)
        tab.locator("#canvas").focus()
        tab.keyboard.press("Control+z")
        idle(tab)
        expect(tab.locator("#toast")).to_contain_text("Undone: material")
        tab.keyboard.press("Control+z")
        idle(tab)
        assert tab.evaluate("workbench.project.photographs.interval") == 30.0
        go(tab, "walls")
        tab.go_back()
        tab.wait_for_function("() => workbench.step.name === 'scale'")
        tab.go_forward()
        tab.wait_for_function("() => workbench.step.name === 'walls'")
        tab.click("#brand")
        idle(tab)
        expect(tab.locator("#home")).to_be_visible()
        tab.go_back()
        tab.wait_for_function("() => workbench.project !== null && workbench.step.name === 'walls'")
        expect(tab.locator("#home")).to_be_hidden()


def test_a_refused_value_stays_in_its_field_with_the_reason(page: Page, begun: Path):
    file = begun / "my photographs" / "experiment.toml"
    with opened(page, begun) as tab:
        enter(tab, "photographs")
        before = file.read_bytes()
        for field, value, words in (
            ("interval", "-3", "must be greater than 0"), ("name", "a/b", "letters, digits, spaces"),
            ("interval", "soon", "is not a number"),
        ):  # fmt: skip
            fill(tab, field, value)
            expect(tab.locator("#refused")).to_contain_text(words)
            assert tab.input_value(f"#field-{field}") == value
            assert tab.get_attribute(f"#field-{field}", "aria-invalid") == "true"
            assert file.read_bytes() == before
        fill(tab, "interval", "12")
        expect(tab.locator("#refused")).to_have_count(0)
        go(tab, "material")
        fill(tab, "friction", "7")
        expect(tab.locator("#refused")).to_contain_text("friction: value 7")
        assert "literal" not in tab.inner_text("#refused")


def test_text_and_selection_stay_when_the_panel_is_drawn_again(page: Page, begun: Path):
    file = begun / "my photographs" / "experiment.toml"
    with opened(page, begun) as tab:
        enter(tab, "photographs")
        name = tab.locator("#field-name")
        name.press("Control+a")
        tab.evaluate("workbench.paint()")
        tab.keyboard.type("shear ")
        tab.evaluate("workbench.paint()")
        tab.keyboard.type("two")
        assert name.input_value() == "shear two"
        tab.evaluate("workbench.paint()")
        name.blur()
        idle(tab)
        assert 'name = "shear two"' in file.read_text(encoding="utf-8")


def test_an_unreadable_photograph_is_stated_and_shows_no_other(page: Page, begun: Path):
    (begun / "my photographs" / "pictures" / "DSC_11.jpg").write_bytes(b"no picture")
    with opened(page, begun) as tab:
        enter(tab, "photographs")
        tab.locator("#canvas").focus()
        tab.keyboard.press("ArrowRight")
        expect(tab.locator("#unreadable")).to_contain_text("DSC_11.jpg")
        assert tab.evaluate("workbench.stage.image") is None
        tab.keyboard.press("ArrowRight")
        expect(tab.locator("#unreadable")).to_be_hidden()
        tab.wait_for_function("() => workbench.stage.image !== null")


def test_a_server_that_is_gone_is_a_state_of_the_page(page: Page, begun: Path):
    with opened(page, begun) as tab:
        enter(tab, "photographs")
        tab.route("**/*", lambda route: route.abort())
        expect(tab.locator("#lost")).to_contain_text("does not answer")
        fill(tab, "interval", "99")
        expect(tab.locator("#toast")).to_contain_text("nothing was changed")
        tab.unroute("**/*")
        expect(tab.locator("#lost")).to_be_hidden()


def test_a_refusal_is_gone_once_the_value_is_right(page: Page, begun: Path):
    with opened(page, begun) as tab:
        enter(tab, "photographs")
        fill(tab, "interval", "a minute")
        expect(tab.locator("#toast")).to_have_class("shown wrong")
        fill(tab, "interval", "60")
        expect(tab.locator("#toast")).to_have_class("")
        fill(tab, "interval", "a minute")
        go(tab, "scale")
        expect(tab.locator("#toast")).to_have_class("")


def test_known_rods_that_disagree_and_rims_that_are_not_seen_are_named(page: Page, begun: Path):
    with opened(page, begun) as tab:
        enter(tab, "scale")
        tab.get_by_text("Known rods").click()
        idle(tab)
        drag(tab, (2.0, 2.0), (9.0, 2.0))  # beside the packing
        expect(tab.locator("#toast")).to_contain_text("No rim is seen there")
        expect(tab.locator("#panel")).to_contain_text("as drawn")
        drag(tab, (12.0, 12.0), (26.0, 12.0))
        fill(tab, "radius-a", "7")
        expect(tab.locator("#disagreeing")).to_have_count(0)
        fill(tab, "radius-b", "7")
        expect(tab.locator("#disagreeing")).to_contain_text("The radii disagree: rod")


def test_the_quality_is_not_awaited_where_a_photograph_cannot_be_read(page: Page, begun: Path):
    damaged = sorted(begun.rglob("*.jpg"))[-1]
    damaged.write_bytes(damaged.read_bytes()[:2000])
    with opened(page, begun) as tab:
        enter(tab, "photographs")
        expect(tab.locator("#not-measured")).to_be_visible()


def test_undo_waits_for_what_was_typed_before_it(page: Page, begun: Path):
    with opened(page, begun) as tab:
        enter(tab, "photographs")
        tab.fill("#field-interval", "77")
        tab.evaluate("""() => { document.getElementById("field-interval").blur(); workbench.undo(); }""")
        idle(tab)
        expect(tab.locator("#toast")).to_contain_text("Undone: photographs")
        assert tab.evaluate("workbench.project.photographs.interval") == 30.0


def test_a_mask_is_painted_and_undone(page: Page, begun: Path):
    with opened(page, begun) as tab:
        enter(tab, "photographs")
        tab.keyboard.press("b")
        tab.keyboard.press("[")
        expect(tab.locator("#hint")).to_contain_text("Drag over what is to be ignored")
        radius = 0.5 * float(tab.locator("#hint").inner_text().split("brush of ")[1].split(" px")[0])
        x, y = (tab.evaluate(f"0.5 * workbench.project.{side}") for side in ("width", "height"))
        drag(tab, (x - 40.0, y), (x + 40.0, y + 20.0))
        (polygon,) = tab.evaluate("workbench.project.photographs.mask")
        place = np.array(polygon)
        assert place[:, 0].min() == pytest.approx(x - 40.0 - radius, abs=1.5)
        assert place[:, 0].max() == pytest.approx(x + 40.0 + radius, abs=1.5)
        area = 0.5 * abs(np.dot(place[:, 0], np.roll(place[:, 1], 1)) - np.dot(place[:, 1], np.roll(place[:, 0], 1)))
        assert area == pytest.approx(2.0 * radius * np.hypot(80.0, 20.0) + np.pi * radius**2, rel=0.05)
        for layer in ("mask", "rods"):
            tab.evaluate("import('/page/layers/settings.js').then((s) => s.resetLayers())")
            with_it = tab.evaluate("workbench.stage.composed().toDataURL()")
            tab.evaluate(f"import('/page/layers/settings.js').then((s) => s.setLayer('{layer}', {{ on: false }}))")
            assert tab.evaluate("workbench.stage.composed().toDataURL()") != with_it
        tab.keyboard.press("Control+z")
        idle(tab)
        assert tab.evaluate("workbench.project.photographs.mask") is None
