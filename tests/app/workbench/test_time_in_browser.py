"""The time line in a real Chromium: plots of a contact, a rod and the frames; flags; the contact sheet."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from rodsight.results.hdf5.store import load_results

from tests.app.workbench.hand import go, idle, opened

pytestmark = pytest.mark.screen
FIRST = 2  # the photograph with which the stored run begins


@pytest.fixture
def tab(page: Page, solved: Path) -> Iterator[Page]:
    with opened(page, solved) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        go(tab, "inspect")
        tab.wait_for_selector("#lanes")
        yield tab


def choose_contact(tab: Page, row: int) -> None:
    """Choose a contact as a click on it does; its card is there once its history is."""
    x, y = tab.evaluate(f"workbench.step.contactAt({row})")
    tab.evaluate(f"workbench.stage.centre({x}, {y})")
    idle(tab)
    box = tab.locator("#canvas").bounding_box()
    assert box is not None
    tab.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    tab.wait_for_selector("#card canvas")
    idle(tab)


def taken(tab: Page) -> tuple[list[str], np.ndarray]:
    """Names and values of what is plotted; NaN where there is no value."""
    with tab.expect_download() as download:
        tab.click("#save-plot")
    head, *rows = download.value.path().read_text().splitlines()
    return head.split(","), np.array([[float(each or "nan") for each in row.split(",")] for row in rows])


def test_the_plot_shows_what_is_stored_of_the_chosen_contact_and_of_a_kept_one(tab: Page, solved: Path):
    results = load_results(solved / "runs" / "mine" / "results.h5")
    tab.locator("#canvas").focus()
    tab.keyboard.press("p")
    names, values = taken(tab)
    assert names == ["frame", "trust_all_rods"]
    np.testing.assert_allclose(values[FIRST:, 1], [frame.trust for frame in results.frames], rtol=1e-4)
    choose_contact(tab, 0)
    names, values = taken(tab)
    contacts = results.frames[0].contacts
    i, j = (int(results.tracks.id[row]) for row in (contacts.i[0], contacts.j[0]))
    assert names == ["frame", f"fn_rods_{i}_{j}_N", f"fn_rods_{i}_{j}_N_sd"]
    for k, frame in enumerate(results.frames):
        row = np.flatnonzero((frame.contacts.i == contacts.i[0]) & (frame.contacts.j == contacts.j[0]))
        stored = frame.fn[row[0]] if len(row) else np.nan
        np.testing.assert_allclose(values[FIRST + k, 1], stored, rtol=1e-4)
    tab.locator(".plot-keys .fact button").first.click()
    choose_contact(tab, 5)
    names, _ = taken(tab)
    assert len([name for name in names if name.endswith("_N")]) == 2
    assert f"fn_rods_{i}_{j}_N" in names
    tab.select_option("#plot-quantity", "gap")
    assert any(name.startswith("gap_") and name.endswith("_µm") for name in taken(tab)[0])
    tab.locator(f'button[aria-label="drop rods {i} – {j}"]').click()
    assert len([name for name in taken(tab)[0] if name.endswith("_µm")]) == 1


def test_a_press_on_the_plot_goes_to_its_photograph(tab: Page):
    tab.keyboard.press("p")
    idle(tab)
    box = tab.locator("#plot").bounding_box()
    assert box is not None
    count = tab.evaluate("workbench.project.frames")
    for frame in (3, 1, 2):
        tab.mouse.click(box["x"] + (frame + 0.5) / count * box["width"], box["y"] + 30)
        idle(tab)
        assert tab.evaluate("workbench.frame") == frame
    lanes = tab.locator("#lanes").bounding_box()
    assert lanes is not None
    assert (lanes["x"], lanes["width"]) == (box["x"], box["width"])  # one above the other: the same photographs


def test_flags_are_jumped_to_by_kind_both_ways(tab: Page, solved: Path):
    results = load_results(solved / "runs" / "mine" / "results.h5")
    status = [frame.status.name.lower() for frame in results.frames]
    for kind in set(status) & {"reset", "rearranging", "suspect"}:
        tab.evaluate(f"workbench.show({FIRST})")
        tab.select_option("#flag-kind", kind)
        idle(tab)
        assert status[tab.evaluate("workbench.frame") - FIRST] == kind
    wanted = [FIRST + k for k, name in enumerate(status) if name == status[-1]]
    if status[-1] in ("reset", "rearranging", "suspect"):
        tab.select_option("#flag-kind", status[-1])
        tab.locator("#canvas").focus()
        tab.keyboard.press("Shift+J")
        idle(tab)
        assert tab.evaluate("workbench.frame") in wanted
    tab.select_option("#flag-kind", "failed")
    expect(tab.locator("#toast")).to_contain_text("No photograph: failed")


def test_the_contact_sheet_shows_all_photographs_or_the_chosen_contact_in_them(tab: Page):
    count = tab.evaluate("workbench.project.frames")
    choose_contact(tab, 0)
    tab.locator("#canvas").focus()
    tab.keyboard.press("a")
    expect(tab.locator(".cell")).to_have_count(count)
    assert "/crop?" in (tab.locator(".cell img").last.get_attribute("src") or "")
    tab.click("#sheet-around")
    assert "/photograph?" in (tab.locator(".cell img").last.get_attribute("src") or "")
    expect(tab.locator(".cell").last).to_contain_text("T ")
    tab.locator(".cell").last.click()
    idle(tab)
    assert tab.evaluate("workbench.frame") == count - 1
    expect(tab.locator(".cell").last).to_have_attribute("aria-current", "true")
    tab.keyboard.press("Escape")
    expect(tab.locator("#sheet")).to_be_hidden()
    tab.keyboard.press("a")
    go(tab, "walls")
    expect(tab.locator("#sheet")).to_be_hidden()
