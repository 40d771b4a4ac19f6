"""The order of the photographs by mouse and keyboard. In a real Chromium."""

from pathlib import Path

import pytest
from PIL import Image
from playwright.sync_api import Page, expect
from rodsight.workbench.setup.draft import Draft

from tests.app.workbench.hand import go, idle, opened

pytestmark = pytest.mark.screen
NAMES = [f"DSC_{7 + 4 * k}.jpg" for k in range(4)]


@pytest.fixture
def begun(photographs_only: Path) -> Path:
    Draft(photographs_only / "my photographs").set_keys("all", {
        "name": "mine", "photographs.files": "pictures/*.jpg", "photographs.interval": 30.0,
    })  # fmt: skip
    return photographs_only


def shown(tab: Page) -> str:
    """The file whose pixels are on the screen."""
    tab.wait_for_function("() => workbench.stage.image !== null")
    return tab.evaluate("new URLSearchParams(workbench.stage.wanted.split('?')[1]).get('file')").split("/")[-1]


@pytest.mark.slow
def test_photographs_are_dragged_left_out_and_used_again(page: Page, begun: Path):
    file = begun / "my photographs" / "pictures" / NAMES[2]
    file.write_bytes(file.read_bytes()[:2000])
    with opened(page, begun) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        go(tab, "photographs")
        expect(tab.locator("#panel .messages").first).to_contain_text(f"Photograph 2, {NAMES[2]}, is cut short")
        expect(tab.locator("#order")).to_contain_text(f"{NAMES[2]}: cannot be used")
        tab.locator("#order button").nth(2).click()
        expect(tab.locator("#unreadable")).to_contain_text(NAMES[2])
        tab.click("#leave-out")
        idle(tab)
        assert tab.evaluate("workbench.project.files") == [NAMES[0], NAMES[1], NAMES[3]]
        expect(tab.locator("#order")).to_contain_text("90 s")  # its time is that of before
        expect(tab.locator("#left-out")).to_contain_text(NAMES[2])
        assert shown(tab) == NAMES[3]
        tab.drag_and_drop("#order button:nth-child(3)", "#order button:nth-child(2)")
        # On a busy machine the page is idle still before it takes the drop.
        tab.wait_for_function("(name) => workbench.project.files[1] === name", arg=NAMES[3])
        idle(tab)
        assert tab.evaluate("workbench.project.files") == [NAMES[0], NAMES[3], NAMES[1]]
        assert shown(tab) == NAMES[3]
        tab.locator("#canvas").focus()
        tab.keyboard.press("Alt+ArrowRight")
        idle(tab)
        assert tab.evaluate("workbench.project.files") == [NAMES[0], NAMES[1], NAMES[3]]
        tab.get_by_role("button", name="use again").click()
        idle(tab)
        assert tab.evaluate("workbench.project.files") == NAMES
        tab.keyboard.press("Control+z")
        idle(tab)
        assert tab.evaluate("workbench.project.files") == [NAMES[0], NAMES[1], NAMES[3]]
        wide = tab.evaluate("workbench.project.width")
        tab.select_option("#field-rotation", "90")
        idle(tab)
        assert tab.evaluate("workbench.project.height") == wide
        tab.wait_for_function(
            "(high) => workbench.stage.image && workbench.stage.wanted.includes('rotation=90')", arg=wide
        )


def test_a_photograph_of_another_size_and_two_photographs_alone_are_named(page: Page, begun: Path):
    file = begun / "my photographs" / "pictures" / NAMES[2]
    with Image.open(file) as picture:
        smaller = picture.resize((picture.width // 2, picture.height // 2))
    smaller.save(file)
    with opened(page, begun) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        go(tab, "photographs")
        stated = tab.locator("#panel .messages").first
        expect(stated).to_contain_text(f"Photograph 2, {NAMES[2]}, is {smaller.width} x {smaller.height} pixels")
        for row in (2, 2):
            tab.locator("#order button").nth(row).click()
            tab.click("#leave-out")
            idle(tab)
        assert tab.evaluate("workbench.project.files") == NAMES[:2]
        expect(stated).to_contain_text("There are 2 photographs: friction is mobilised over several")
