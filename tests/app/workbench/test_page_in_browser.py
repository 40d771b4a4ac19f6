"""The workbench in a real headless Chromium: from a folder of photographs to forces, by mouse and keyboard."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from rodsight.experiment.experiment import load_experiment
from rodsight.verdicts.log import VERDICTS, VerdictLog

from tests.app.workbench.hand import drag, fill, go, idle, on_screen, opened
from tests.program import rodsight

pytestmark = pytest.mark.screen
FORCES_TAB = (138.0, 15.0)  # [px] of the viewer, where its second tab is named
WATCHED = 1500.0  # [ms] that a viewer drawn by the processor may need for one picture


@pytest.fixture
def tab(page: Page, photographs_only: Path) -> Iterator[Page]:
    with opened(page, photographs_only) as tab:
        yield tab


def mark(tab: Page, step: str) -> str:
    return tab.locator(f"#step-{step} .sign").get_attribute("title") or ""


@pytest.mark.slow
def test_from_photographs_to_forces(tab, photographs_only, made_photographs):
    truth = load_experiment(made_photographs).config
    tab.get_by_text("Set up an experiment from these").click()
    idle(tab)
    fill(tab, "interval", "30")
    assert mark(tab, "photographs") == "good"
    expect(tab.locator("#quality")).to_contain_text("px wide")
    go(tab, "scale")
    drag(tab, (100.0, 200.0), (300.0, 200.0))
    length = tab.evaluate("(() => { const d = workbench.project.photographs.distance; return d ?? null; })()")
    assert length is None  # a length without metres is nothing yet
    fill(tab, "distance", str(200.0 * truth.photographs.pixel_size * 1e3))
    assert tab.evaluate("workbench.project.pixel") == pytest.approx(truth.photographs.pixel_size, rel=0.01)
    tab.get_by_role("button", name="The number").click()
    fill(tab, "pixel-size", str(truth.photographs.pixel_size * 1e3))
    go(tab, "rods")
    tab.fill("#field-radii", ", ".join(str(radius * 1e3) for radius in truth.photographs.radii))
    tab.click("#detect")
    idle(tab)
    assert tab.evaluate("workbench.project.rods.id.length") == 30
    x, y = tab.evaluate("[workbench.project.rods.x[3], workbench.project.rods.y[3]]")
    tab.mouse.click(*on_screen(tab, (x, y)))
    tab.keyboard.press("Delete")
    idle(tab)
    assert tab.evaluate("workbench.project.rods.id.length") == 29
    tab.keyboard.press("Control+z")
    idle(tab)
    assert tab.evaluate("workbench.project.rods.id.length") == 30
    go(tab, "walls")
    tab.click("#find-walls")
    idle(tab)
    fill(tab, "pressure-top", "50")
    go(tab, "material")
    tab.get_by_role("button", name="aluminium").click()
    idle(tab)
    for step in ("photographs", "scale", "walls", "rods", "material"):
        assert mark(tab, step) == "good", step
    go(tab, "run")
    tab.click("#run")
    expect(tab.locator("#run-state")).to_have_text("finished", timeout=240_000)
    idle(tab)
    assert tab.evaluate("workbench.project.run.frames") == 4
    assert (photographs_only / "runs" / "my photographs" / "results.h5").is_file()
    judge_by_key(tab, photographs_only / "runs" / "my photographs")
    go(tab, "share")
    tab.click("#write-page")
    idle(tab)
    expect(tab.locator("#toast")).to_contain_text("is out of date: verdicts have changed")
    tab.locator("#canvas").focus()
    tab.keyboard.press("Control+z")  # the verdict
    idle(tab)
    tab.click("#write-page")
    idle(tab)
    expect(tab.locator("#shared")).to_contain_text("my photographs-share.html")
    assert (photographs_only / "runs" / "my photographs" / "my photographs-share.html").stat().st_size > 10e6
    assert rodsight("check", photographs_only / "my photographs", "--quiet") == 0


def judge_by_key(tab: Page, run: Path) -> None:
    go(tab, "review")
    tab.wait_for_selector("#next")
    tab.keyboard.press("]")
    idle(tab)
    tab.keyboard.press("c")
    idle(tab)
    if not log_of(run):  # the account of a machine is no name: the page requests one
        tab.keyboard.type("anna")
        tab.keyboard.press("Enter")
        tab.locator("#canvas").focus()
        idle(tab)
        tab.keyboard.press("c")
        idle(tab)
    tab.keyboard.press("n")
    idle(tab)
    assert log_of(run) == ["contact", "no contact"]
    tab.keyboard.press("z")
    idle(tab)
    assert log_of(run) == ["contact"]
    go(tab, "inspect")
    show_the_recording(tab)


def log_of(run: Path) -> list[str]:
    return [str(entry.verdict) for _, entry in VerdictLog(run / VERDICTS).verdicts()]


def show_the_recording(tab: Page) -> None:
    frame = tab.evaluate("workbench.frame")
    tab.keyboard.press("v")
    tab.wait_for_function("(frame) => workbench.recording?.opened && workbench.recording.reported === frame", arg=frame)
    click_in_the_viewer(tab)
    tab.click("#step-photographs")
    idle(tab)
    expect(tab.locator("#recording")).to_be_hidden()


def click_in_the_viewer(tab: Page) -> None:
    """Click the network of the recording: the card is that of the clicked contact."""
    tab.keyboard.press("Escape")
    tab.evaluate("""() => {
        const listener = workbench.recording.listener, clicked = listener.clicked;
        globalThis.clicks = [];
        listener.clicked = (...what) => { clicks.push(what); clicked(...what); };
    }""")
    box = tab.locator("#viewer").bounding_box()
    assert box is not None
    tab.mouse.click(box["x"] + FORCES_TAB[0], box["y"] + FORCES_TAB[1])  # the summary is in front
    tab.wait_for_timeout(WATCHED)
    left, reported = box["x"] + 0.28 * box["width"], []
    for top in box["y"] + box["height"] * np.linspace(0.25, 0.75, 11):  # a click on empty ground reports nothing
        before = tab.evaluate("clicks.length")
        tab.mouse.move(left - 3, top - 3)
        tab.mouse.move(left, top)
        tab.wait_for_timeout(WATCHED)  # the viewer picks what it painted under the mouse
        tab.mouse.click(left, top)
        tab.wait_for_timeout(WATCHED)
        if tab.evaluate("clicks.length") > before:
            reported.append((top, *tab.evaluate("clicks.at(-1).slice(0, 2)")))
        if len(reported) == 3:
            break
    screen, x, y = np.transpose(reported)
    steps = np.diff(y) / np.diff(screen)  # straight down on the screen is straight down on the photograph
    assert np.ptp(x) < 2.0
    assert (steps > 0.0).all()
    assert np.ptp(steps) < 0.05 * steps.mean()
    title = tab.locator("#card .fact").first.text_content() or ""
    rods = np.reshape(tab.evaluate("workbench.step.rodsOfFrame()"), (-1, 3))
    names = tab.evaluate("workbench.step.names()")
    near = np.hypot(rods[:, 0] - x[-1], rods[:, 1] - y[-1]) < 1.4 * rods[:, 2]
    assert any(str(names[k]) in re.findall(r"\d+", title) for k in np.flatnonzero(near)), title


def test_what_is_missing_is_a_click_away(tab):
    tab.get_by_text("Set up an experiment from these").click()
    idle(tab)
    for step in ("correct", "inspect", "review", "share"):
        go(tab, step)
        tab.get_by_role("button", name="To the run").click()
        idle(tab)
    expect(tab.locator("#lacks button b")).to_have_text(["Photographs", "Scale", "Walls"])
    tab.locator("#lacks button").nth(1).click()
    expect(tab.locator("#panel h1")).to_have_text("Scale")


def test_the_sample_is_a_click_away(tab, photographs_only):
    tab.get_by_text("The sample: simple shear").click()
    idle(tab)
    assert (photographs_only / "shear" / "experiment.toml").is_file()
    assert mark(tab, "scale") == "good"
    assert tab.evaluate("workbench.project.files.length") == 24
    tab.keyboard.press("3")
    assert tab.evaluate("workbench.project.walls.length") == 4
    expect(tab.locator("#panel h1")).to_have_text("Walls")


def test_what_is_in_the_middle_stays_there_when_the_window_gets_smaller(page: Page, solved: Path):
    with opened(page, solved) as tab:
        tab.set_viewport_size({"width": 1920, "height": 1080})
        tab.locator(".tile").first.click()
        idle(tab)
        go(tab, "inspect")
        tab.evaluate("workbench.stage.centre(300, 200, 6)")
        tab.set_viewport_size({"width": 1280, "height": 720})
        idle(tab)
        middle = tab.evaluate("(s => s.toPhotograph(s.boxWidth / 2, s.boxHeight / 2))(workbench.stage)")
        assert middle == pytest.approx([300, 200], abs=1.0)


def test_an_experiment_that_is_opened_is_shown_whole_whatever_was_enlarged_before(page: Page, solved: Path):
    with opened(page, solved) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        tab.evaluate("workbench.stage.centre(300, 200, 6)")
        idle(tab)
        tab.click("#brand")
        idle(tab)
        tab.locator(".tile").first.click()  # its photographs have the size of those before
        idle(tab)
        tab.wait_for_function("() => workbench.stage.isFitted()")
        left, top, right, bottom = tab.evaluate("workbench.stage.visible()")
        width, height = tab.evaluate("[workbench.project.width, workbench.project.height]")
        assert max(left, top) < 0.0
        assert right > width
        assert bottom > height


def test_a_window_that_changes_while_the_first_photograph_loads_shows_the_whole_of_it(page: Page, solved: Path):
    with opened(page, solved) as tab:
        waiting = []
        tab.route("**/photograph*", lambda route: waiting.append(route))
        tab.locator(".tile").first.click()
        tab.wait_for_function("() => workbench.project !== null && workbench.stage.wanted")
        tab.set_viewport_size({"width": 1100, "height": 700})
        tab.wait_for_function("() => workbench.stage.boxWidth < 600")
        for each in waiting:
            each.continue_()
        tab.unroute("**/photograph*")
        idle(tab)
        left, top, right, bottom = tab.evaluate("workbench.stage.visible()")
        width, height = tab.evaluate("[workbench.project.width, workbench.project.height]")
        assert max(left, top) < 0.0
        assert right > width
        assert bottom > height


def test_every_wall_has_a_colour_of_its_own_beside_its_name(tab):
    tab.get_by_text("The sample: simple shear").click()
    idle(tab)
    go(tab, "walls")
    colours = tab.evaluate("workbench.project.walls.map((wall) => wall.colour)")
    swatch = "(found) => found.map((each) => getComputedStyle(each).backgroundColor.match(/\\d+/g).map(Number))"
    shown = tab.locator("#panel .card .swatch").evaluate_all(swatch)
    assert [f"#{bytes(each).hex()}" for each in shown] == colours
    assert len(set(colours)) == len(colours) == 4


def test_review_without_results_leads_to_the_run_and_shows_no_folder(page: Page, begun: Path):
    with opened(page, begun) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        go(tab, "review")
        expect(tab.locator("#panel")).to_contain_text("There are no contacts to review yet")
        assert str(begun) not in tab.locator("#panel").inner_text()
