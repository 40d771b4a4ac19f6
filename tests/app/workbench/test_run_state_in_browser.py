"""A run whose forces are not to be taken as they are is named so at every step after it. In a real Chromium."""

import json
import re
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect
from rodsight.run_folder import SUMMARY
from rodsight.workbench.setup.draft import Draft

from tests.app.workbench.hand import go, idle, opened
from tests.golden.stored import unpack

pytestmark = pytest.mark.screen


@pytest.fixture
def failed(photographs_only: Path) -> Path:
    """An experiment with the results of a run in which one photograph failed."""
    Draft(photographs_only / "my photographs").set_keys("all", {
        "name": "mine", "photographs.files": "pictures/*.jpg", "photographs.interval": 30.0,
        "photographs.pixel_size": 2.5e-4,
    })  # fmt: skip
    run = photographs_only / "runs" / "mine"
    run.mkdir(parents=True)
    unpack(2, run)
    (run / SUMMARY).write_text(json.dumps({
        "frame_count": 3, "grain_count": 12, "trust": [0.9, 0.0, 0.9], "status_count": {"settled": 2, "failed": 1},
        "failures": {"1": "0 of 12 grains are found in DSC_19.jpg"},
    }))  # fmt: skip
    return photographs_only


def test_a_failed_photograph_is_named_at_every_step_after_the_run(page: Page, failed: Path):
    with opened(page, failed) as tab:
        expect(tab.locator(".tile").first).to_contain_text("1 failed")
        tab.locator(".tile").first.click()
        idle(tab)
        expect(tab.locator("#standing")).to_contain_text("1 failed")
        for step in ("run", "inspect", "review", "share"):
            go(tab, step)
            expect(tab.locator("#panel .messages").first).to_contain_text("Photograph 3 has no forces: 0 of 12 grains")
            mark = tab.locator(f"#step-{step} .sign").get_attribute("title")
            assert mark == ("missing" if step == "share" else "doubtful"), step


def test_what_the_diagnosis_found_is_stated_wherever_the_forces_are_shown(page: Page, failed: Path):
    found = {"cause": "rotation_sign", "evidence": "rods roll backwards", "effect": "rolling is taken for sliding",
             "cure": "change the sign of theta", "corrected": False}  # fmt: skip
    (failed / "runs" / "mine" / SUMMARY).write_text(json.dumps({
        "frame_count": 3, "grain_count": 12, "trust": [0.9] * 3, "status_count": {"settled": 3},
        "diagnosis": [found, found | {"cause": "lens", "corrected": True}],
    }))  # fmt: skip
    with opened(page, failed) as tab:
        expect(tab.locator(".tile").first).to_contain_text("something is wrong")
        tab.locator(".tile").first.click()
        idle(tab)
        expect(tab.locator("#standing")).to_contain_text("something is wrong")
        for step in ("run", "inspect", "review"):
            go(tab, step)
            expect(tab.locator("#panel .messages").first).to_contain_text("Rotation sign: rods roll backwards")
            assert tab.locator(f"#step-{step} .sign").get_attribute("title") == "doubtful", step
        go(tab, "inspect")
        expect(tab.locator("#corrected")).to_have_text(re.compile("Corrected by the run: Lens: .*"))
