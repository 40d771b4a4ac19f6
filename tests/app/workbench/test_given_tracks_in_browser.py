"""An experiment of tracks: steps that need photographs state that there are none, and offer nothing that fails."""

import shutil
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.app.workbench.hand import go, idle, opened

pytestmark = pytest.mark.screen


def test_steps_of_photographs_offer_nothing_where_tracks_are_given(page: Page, made_tracks: Path, tmp_path: Path):
    shutil.copytree(made_tracks, tmp_path / "tracks")
    refused: list[str] = []
    page.on("response", lambda answer: refused.append(answer.url) if answer.status == 422 else None)
    with opened(page, tmp_path) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        for step in ("photographs", "scale", "walls", "rods", "correct"):
            go(tab, step)
            expect(tab.locator("#given-tracks")).to_contain_text("This experiment has no photographs")
            for absent in ("#detect", "#find-walls", "#field-distance", "#mask", "#next-uncertain"):
                expect(tab.locator(absent)).to_have_count(0)
            expect(tab.locator("#time")).not_to_have_class("shown")
            for key in ("m", "n", "Delete", "s"):
                tab.keyboard.press(key)
            idle(tab)
        go(tab, "photographs")
        expect(tab.locator("#duplicate")).to_be_visible()
        go(tab, "material")
        expect(tab.locator("#field-density")).to_be_visible()
    assert refused == []
