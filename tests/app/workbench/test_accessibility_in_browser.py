"""Every step, light and dark, by the rules that a script can judge; walls, scale and rods by keyboard alone."""

from pathlib import Path
from typing import Literal

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from tests.app.workbench.hand import go, idle, opened
from tests.golden.stored import unpack

pytestmark = pytest.mark.screen
STEPS = ("photographs", "scale", "walls", "rods", "material", "run", "inspect", "review", "correct", "share")


@pytest.fixture
def solved(begun: Path) -> Path:
    run = begun / "runs" / "mine"
    run.mkdir(parents=True)
    unpack(2, run)
    return begun


# Rules beside those of axe: canvases have a role and a name, one step is the present one, steps show their state.
UNNAMED = """() => {
    const seen = (each) => each.checkVisibility() && !each.closest("[aria-hidden=true]");
    const steps = [...document.querySelectorAll("#steps button")];
    return [
        ...[...document.querySelectorAll("canvas")].filter((each) => seen(each) && !(each.role && each.ariaLabel)).map((each) => `canvas ${each.id}`),
        ...(steps.length && steps.filter((each) => each.ariaCurrent === "step").length !== 1 ? ["no present step"] : []),
        ...steps.filter((each) => !each.querySelector("[role=img][aria-label]")).map((each) => `no state: ${each.id}`),
    ];
}"""  # noqa: E501  a page


def enter(tab: Page) -> None:
    tab.locator(".tile").first.click()
    idle(tab)


@pytest.mark.parametrize("scheme", ["dark", pytest.param("light", marks=pytest.mark.slow)])
def test_axe_finds_no_violation_in_any_step(page: Page, solved: Path, scheme: Literal["dark", "light"]):
    axe, found = Axe(), {}

    def judge(state: str) -> None:
        wrong = axe.run(tab).response["violations"]
        found[state] = [f"{each['id']}: {node['target']}" for each in wrong for node in each["nodes"]]
        found[state] += tab.evaluate(UNNAMED)

    page.emulate_media(color_scheme=scheme)
    with opened(page, solved) as tab:
        tab.locator(".tile").first.wait_for()
        judge("the first page")
        enter(tab)
        for step in STEPS:
            go(tab, step)
            if step in ("inspect", "review"):
                tab.wait_for_selector("#lanes")
            judge(step)
        go(tab, "inspect")
        tab.keyboard.press("y")
        for each in tab.locator("#layers-panel summary").all():
            each.click()
        tab.keyboard.press("p")
        idle(tab)
        judge("layers and plot")
        tab.keyboard.press("y")
        tab.keyboard.press("a")
        idle(tab)
        judge("contact sheet")
        tab.keyboard.press("Escape")
        tab.keyboard.press("?")
        judge("keys")
    assert {state: wrong for state, wrong in found.items() if wrong} == {}


def test_time_is_gone_through_by_keyboard_alone(page: Page, solved: Path):
    with opened(page, solved) as tab:
        enter(tab)
        go(tab, "inspect")
        tab.wait_for_selector("#lanes")
        tab.locator("#lanes").focus()
        before = tab.evaluate("workbench.frame")
        tab.keyboard.press("ArrowRight")
        idle(tab)
        assert tab.evaluate("workbench.frame") == before + 1
        assert tab.evaluate("document.activeElement.id") == "lanes"  # it is painted anew, and keeps the focus
        assert tab.get_attribute("#lanes", "aria-valuenow") == str(before + 1)
        tab.keyboard.press("a")
        idle(tab)
        assert tab.evaluate("document.activeElement.dataset.frame") == str(before + 1)
        tab.keyboard.press("Shift+Tab")
        tab.keyboard.press("Enter")
        idle(tab)
        assert tab.evaluate("workbench.frame") == before
        tab.keyboard.press("Escape")
        expect(tab.locator("#sheet")).to_be_hidden()


def test_a_wall_a_length_and_a_rod_are_drawn_by_keyboard(page: Page, solved: Path):
    with opened(page, solved) as tab:
        enter(tab)
        go(tab, "scale")
        tab.locator("#canvas").focus()
        draw(tab, right=20)
        a, b = tab.evaluate("workbench.step.drawn()")
        assert (b[0] - a[0]) * tab.evaluate("workbench.stage.view.k") == pytest.approx(240.0)
        assert tab.evaluate("document.activeElement.id") == "field-distance"
        tab.keyboard.type("60")
        tab.keyboard.press("Enter")
        idle(tab)
        assert tab.evaluate("workbench.project.pixel") == pytest.approx(0.06 / (b[0] - a[0]), rel=1e-4)  # to .01 px
        go(tab, "walls")
        tab.locator("#canvas").focus()
        draw(tab, right=12, down=2)
        idle(tab)
        assert tab.evaluate("workbench.project.walls.length") == 1
        go(tab, "rods")
        tab.locator("#canvas").focus()
        tab.keyboard.press("k")
        for _ in range(3):  # away from all rods: into the margin
            tab.keyboard.press("ArrowUp")
        tab.evaluate("workbench.stage.cursor = [14, 14]")
        tab.keyboard.press("Enter")
        idle(tab)
        assert tab.evaluate("workbench.project.rods.id.length") == 31


def draw(tab: Page, right: int = 0, down: int = 0) -> None:
    """Press, move and let go with the keyboard's cursor."""
    tab.keyboard.press("k")
    tab.keyboard.press("Enter")
    for key, count in (("ArrowRight", right), ("ArrowDown", down)):
        for _ in range(count):
            tab.keyboard.press(key)
    tab.keyboard.press("Enter")
    idle(tab)


def test_a_control_keeps_the_focus_when_the_page_is_painted_anew(page: Page, solved: Path):
    with opened(page, solved) as tab:
        enter(tab)
        tab.locator("#step-walls").focus()
        tab.keyboard.press("Enter")
        idle(tab)
        assert tab.evaluate("document.activeElement.id") == "step-walls"
        go(tab, "material")
        tab.locator("#panel button").nth(2).focus()
        tab.keyboard.press("Enter")
        idle(tab)
        assert tab.evaluate("[...document.querySelectorAll('#panel button')].indexOf(document.activeElement)") == 2
        ring = tab.evaluate("getComputedStyle(document.activeElement).outlineStyle")
        assert ring == "solid"


SIZES = """async () => {
    const { correctDevicePixels } = await import("/page/parts/recording.js");
    correctDevicePixels();
    const box = document.createElement("div");
    Object.assign(box.style, { position: "fixed", width: "100px", height: "60px" });
    document.body.append(box);
    const observed = { box: "device-pixel-content-box" };
    const [entry] = await new Promise((done) => new ResizeObserver(done).observe(box, observed));
    const [size] = entry.devicePixelContentBoxSize;
    return [size.inlineSize, size.blockSize, entry instanceof ResizeObserverEntry, size instanceof ResizeObserverSize];
}"""


def test_the_viewer_is_given_the_pixels_of_the_screen(browser: Browser, solved: Path):
    context = browser.new_context(device_scale_factor=2)
    with opened(context.new_page(), solved) as tab:
        assert tab.evaluate(SIZES) == [200, 120, True, True]
    context.close()
