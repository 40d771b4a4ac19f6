"""Set-up in a real browser: units that a person chooses, a lens' coefficients, tables that sensors wrote."""

from pathlib import Path

import pytest
from playwright.sync_api import Page, expect
from rodsight.workbench.setup.draft import Draft

from tests.app.workbench.hand import drag, fill, go, idle, opened

pytestmark = pytest.mark.screen


def test_units_lens_and_tables(page: Page, photographs_only: Path, tmp_path_factory: pytest.TempPathFactory):
    folder = photographs_only / "my photographs"
    Draft(folder).set_keys("all", {"name": "mine", "photographs.files": "pictures/*.jpg", "photographs.interval": 30.0})
    with opened(page, photographs_only) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        go(tab, "scale")
        tab.select_option("#unit-length", "cm")
        tab.get_by_role("button", name="The number").click()
        fill(tab, "pixel-size", "0.025")
        assert tab.evaluate("workbench.project.pixel") == pytest.approx(2.5e-4, rel=1e-9)
        expect(tab.locator("#panel .big")).to_have_text("0.025 cm")
        tab.select_option("#lens-model", "brown")
        for name, value in (("xc", "160"), ("yc", "200"), ("K2", "1e-14")):
            tab.fill(f"#lens-{name}", value)
            tab.keyboard.press("Enter")
            idle(tab)
        assert tab.evaluate("workbench.project.photographs.lens") == {"xc": 160, "yc": 200, "K2": 1e-14}
        go(tab, "walls")
        tab.keyboard.press("s")  # as it is drawn
        drag(tab, (20.0, 380.0), (300.0, 384.0))
        tab.select_option("#unit-pressure", "MPa")
        name = tab.evaluate("workbench.project.walls[0].name")
        fill(tab, f"pressure-{name}", "0.05")
        assert tab.evaluate("workbench.project.walls[0].pressure") == pytest.approx(5e4)
        forces = tmp_path_factory.mktemp("sensors") / "sensors of monday.csv"
        forces.write_text("frame,wall,fx,fy\n" + "".join(f"{k},{name},1.0,{k}.5\n" for k in range(4)))
        tab.set_input_files("#table-forces", forces)
        expect(tab.get_by_role("button", name="wall_forces.csv")).to_be_visible()
        tab.reload()
        idle(tab)
        go(tab, "scale")
        expect(tab.locator("#panel .big")).to_have_text("0.025 cm")  # the choice is kept
    assert (folder / "wall_forces.csv").read_text() == forces.read_text()
