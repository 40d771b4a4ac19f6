"""A rod that tracking took for another is put right by mouse, and the next run obeys."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from rodsight import pipeline
from rodsight.experiment.corrections import read_corrections
from rodsight.experiment.experiment import load_experiment
from rodsight.tracks import TrackStatus

from tests.app.workbench.hand import drag, idle, on_screen, opened
from tests.app.workbench.spoiled_tracks import GONE, ROD, WRONG, pixel_of, true_poses

pytestmark = pytest.mark.screen
OTHER = 4  # a rod that is marked as not visible in photograph 1
RIGHT = 0.15  # [px] of a place
SMALL = 9.0  # [px of the screen] of a rod's radius


@pytest.fixture
def tab(page: Page, spoiled: Path) -> Iterator[Page]:
    with opened(page, spoiled) as tab:
        yield tab


def stored(root: Path) -> dict[tuple[int, int], tuple[float, float, float]]:
    read = read_corrections(load_experiment(root / "mine"), None, 4)
    if read is None:
        return {}
    rows = zip(
        read.frame.tolist(), read.id.tolist(), read.x.tolist(), read.y.tolist(), read.theta.tolist(), strict=True
    )
    return {(frame, name): (x, y, theta) for frame, name, x, y, theta in rows}


def test_a_rod_is_dragged_to_its_place_and_the_next_run_applies_it(tab, spoiled):
    truth = true_poses(spoiled)
    tab.locator(".tile").first.click()
    idle(tab)
    tab.click("#step-correct")
    expect(tab.locator("#next-uncertain")).to_be_visible()
    tab.keyboard.press("n")
    card = tab.locator("#correction")
    expect(card).to_contain_text(f"Rod {ROD}")
    expect(card).to_contain_text("±")  # where its neighbours' motion leads, not where it was tracked
    assert tab.evaluate("workbench.frame") == WRONG
    x, y, _ = truth[WRONG, ROD]
    assert tab.evaluate("workbench.step.ghost().slice(0, 2)") == pytest.approx([x, y], abs=RIGHT)
    expect(tab.locator("#warnings")).to_have_count(0)
    tab.keyboard.press("f")
    angle = tab.evaluate("workbench.step.ghost()[2]")
    tab.evaluate(f"workbench.stage.zoom({SMALL} / workbench.stage.view.k / workbench.step.rods().r[0])")
    drag(tab, (x, y), (x + 60.0, y - 60.0))  # onto another rod; the handle is close to the middle
    expect(tab.locator("#warnings")).to_be_visible()
    assert tab.evaluate("workbench.step.ghost()[2]") == pytest.approx(angle, abs=1e-6)
    tab.keyboard.press("f")
    expect(tab.locator("#warnings")).to_contain_text("Nothing correlates there")
    expect(tab.locator("#warnings")).to_contain_text("Against its neighbours it has moved by")
    expect(tab.locator("#keep")).to_contain_text("all the same")
    drag(tab, (x + 60.0, y - 60.0), (x + 3.0, y - 2.0))
    expect(card).to_contain_text("±")
    expect(card.locator(".evidence canvas")).to_have_count(5)
    tab.keyboard.press("Shift+Enter")
    idle(tab)
    found = stored(spoiled)
    assert sorted(found) == [(WRONG, ROD), (GONE, ROD)]
    for (frame, name), pose in found.items():
        np.testing.assert_allclose(pose[:2], truth[frame, name, :2], atol=RIGHT)
        assert pose[2] == pytest.approx(truth[frame, name, 2], abs=0.01)
    expect(tab.locator("#waits")).to_contain_text("2 corrections")
    expect(tab.locator("#again")).to_contain_text("suspect → ok")
    tab.keyboard.press("Control+z")
    idle(tab)
    assert stored(spoiled) == {}
    expect(tab.locator("#corrections")).to_have_count(0)
    tab.keyboard.press("Control+Shift+z")
    idle(tab)
    assert stored(spoiled) == found
    hide_by_key(tab, truth)
    tracks, _ = pipeline.track(pipeline.Run(load_experiment(spoiled / "mine"), spoiled / "runs" / "photographed"))
    scale_px = tracks.position[[WRONG, GONE], ROD] / pixel_of(spoiled)
    world = np.array([truth[frame, ROD, :2] for frame in (WRONG, GONE)])
    np.testing.assert_allclose(scale_px[:, 0], world[:, 0], atol=RIGHT)
    assert tracks.status[1, OTHER] == TrackStatus.LOST
    tab.reload()
    idle(tab)
    expect(tab.locator("#corrections .sign.good")).to_have_count(3)


def hide_by_key(tab: Page, truth: np.ndarray) -> None:
    tab.evaluate("workbench.show(1)")
    idle(tab)
    tab.mouse.click(*on_screen(tab, truth[1, OTHER, :2].tolist()))
    expect(tab.locator("#correction")).to_contain_text(f"Rod {OTHER}")
    tab.keyboard.press("x")
    idle(tab)
