"""A person who makes mistakes: every one is named on screen or undone, and nothing is lost. In a real Chromium."""

from pathlib import Path

import pytest
from playwright.sync_api import Page, expect
from rodsight.workbench.setup.draft import Draft

from tests.app.workbench.hand import fill, go, idle, opened

pytestmark = pytest.mark.screen


@pytest.fixture
def begun(made_photographs: Path, photographs_only: Path) -> Path:
    """A folder with an experiment whose rods are known."""
    folder = photographs_only / "my photographs"
    (folder / "grains.csv").write_bytes((made_photographs / "grains.csv").read_bytes())
    Draft(folder).set_keys("all", {
        "name": "mine", "photographs.files": "pictures/*.jpg", "photographs.interval": 30.0,
        "photographs.pixel_size": 2.5e-4, "photographs.grains": "grains.csv",
    })  # fmt: skip
    return photographs_only


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


def test_undo_waits_for_what_was_typed_before_it(page: Page, begun: Path):
    with opened(page, begun) as tab:
        enter(tab, "photographs")
        tab.fill("#field-interval", "77")
        tab.evaluate("""() => { document.getElementById("field-interval").blur(); workbench.undo(); }""")
        idle(tab)
        expect(tab.locator("#toast")).to_contain_text("Undone: photographs")
        assert tab.evaluate("workbench.project.photographs.interval") == 30.0
