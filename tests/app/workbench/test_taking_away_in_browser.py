"""Layers, brightness, a touchpad, and what is taken away: a picture, a table, a duplicate. In a real Chromium."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from rodsight.results.hdf5.store import load_results

from tests.app.workbench.hand import fill, go, idle, opened
from tests.browser import read_picture

pytestmark = pytest.mark.screen
FRAME = 3  # a photograph with forces


def grey(tab: Page) -> float:
    """Mean level of the picture as it is painted."""
    return tab.evaluate("""() => {
        const canvas = workbench.stage.composed(), c = canvas.getContext("2d"), { data } = c.getImageData(0, 0, canvas.width, canvas.height);
        let sum = 0;
        for (let k = 0; k < data.length; k += 4) sum += data[k];
        return 4 * sum / data.length;
    }""")  # noqa: E501  a page


def test_layers_touchpad_and_what_is_taken_away(page: Page, solved: Path):
    results = load_results(solved / "runs" / "mine" / "results.h5")
    with opened(page, solved) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        go(tab, "photographs")
        tab.wait_for_function("() => workbench.stage.image !== null")
        before = grey(tab)
        tab.keyboard.press("y")
        tab.locator("#layer-brightness").fill("1.8")
        assert grey(tab) > 1.3 * before
        tab.locator("#layer-photograph").uncheck()
        assert grey(tab) < 0.2 * before
        tab.click("#layers-reset")
        assert grey(tab) == pytest.approx(before, rel=0.02)
        tab.keyboard.press("y")
        expect(tab.locator("#layers-panel")).to_be_hidden()
        view = tab.evaluate("({ ...workbench.stage.view })")
        tab.mouse.move(500, 300)
        tab.mouse.wheel(30, 18)  # two fingers
        tab.wait_for_function("(x) => workbench.stage.view.x !== x", arg=view["x"])
        after = tab.evaluate("({ ...workbench.stage.view })")
        assert after["k"] == view["k"]
        assert [(after[axis] - view[axis]) * view["k"] for axis in "xy"] == pytest.approx([30.0, 18.0])
        tab.mouse.wheel(0, -120)  # a wheel's notch
        tab.wait_for_function("(k) => workbench.stage.view.k > k", arg=view["k"])
        tab.keyboard.press("f")
        go(tab, "inspect")
        tab.evaluate(f"workbench.show({FRAME})")
        idle(tab)
        with tab.expect_download() as taken:
            tab.click("#save-table")
        lines = taken.value.path().read_text().splitlines()
        assert lines[0].startswith("frame,i,j,x_px,y_px,fn_N,ft_N")
        forces = results.frames[FRAME - 2].fn  # the stored run begins at photograph 2
        np.testing.assert_allclose([float(line.split(",")[5]) for line in lines[1:]], forces, rtol=1e-3, atol=1e-9)
        with tab.expect_download() as taken:
            tab.click("#save-picture")
        picture = read_picture(taken.value.path().read_bytes())
        assert picture[-25:-5].max() > 200  # the line that states what it is
        with tab.expect_download() as taken:
            tab.click("#save-figure")
        drawn = taken.value.path().read_text()
        assert drawn.lstrip().startswith("<?xml")
        assert "normal force" in drawn  # text stays text
        go(tab, "photographs")
        fill(tab, "interval", "31")
        with tab.expect_download() as taken:
            tab.click("#save-script")
        assert "test.set_photographs(interval=31)" in taken.value.path().read_text()
        tab.click("#duplicate")
        idle(tab)
        assert tab.evaluate("workbench.project.at") == "my photographs copy"
        assert tab.evaluate("workbench.project.run") is None
        tab.wait_for_function("() => workbench.stage.image !== null")
        shutil.copytree(solved / "my photographs" / "pictures", solved / "tuesday" / "pictures")
        tab.click("#brand")
        idle(tab)
        tab.select_option("#like", "my photographs")
        tab.get_by_text("Set up an experiment from these").click()
        idle(tab)
        assert tab.evaluate("[workbench.project.at, workbench.project.pixel]") == ["tuesday", 2.5e-4]
    assert (solved / "my photographs copy" / "experiment.toml").is_file()
    assert (solved / "my photographs copy" / "pictures" / "DSC_7.jpg").stat().st_nlink == 2
