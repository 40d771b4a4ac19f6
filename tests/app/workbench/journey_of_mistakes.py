"""A person who makes ten mistakes; each is named on the page, and undone there: by mouse and keyboard alone.

python -m tests.app.workbench.journey_of_mistakes DIR [RODS]     # pictures of every step, and what they took
"""

from __future__ import annotations

import csv
import shutil
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from axe_playwright_python.sync_playwright import Axe
from numpy.typing import NDArray
from playwright.sync_api import Page, expect
from rodsight.results.hdf5.store import load_results
from rodsight.results.results import Results
from rodsight.results.truth import correlations, read_truth, score
from rodsight.tracks import Tracks

from tests.app.workbench.hand import fill, go, idle
from tests.app.workbench.journey import PATIENCE, Journey, correct_rods, draw_bars, measure, names_of, set_material
from tests.app.workbench.laboratory_set import PAD, PIXEL, RULER, LaboratorySet, make_laboratory_set

DAMAGED = 7  # the photograph whose file is cut short
WRONG_FRAME = 4  # the photograph in which a rod is kept at a wrong place
SHIFT = 60.0  # [px] by which it is put beside its place, onto a neighbour: beyond the reach of the search
SAME = 0.5  # [px] within which a rod is tracked alike
FOLDER, COPY = "monday", "tuesday"


@dataclass
class MistakenJourney(Journey):
    """A person at the page, and the tracks of the first run."""

    former: Tracks | None = None
    r: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))  # of every frame of the last run


def make_mistakes(journey: MistakenJourney) -> None:
    """The whole journey; every mistake is named on the page, and undone."""
    for name, work in (
        ("an interval in words", interval_in_words), ("walls before the scale", walls_before_scale),
        ("a scale wrong by ten", scale_wrong_by_ten), ("bolts among the rods", bolts_among_rods),
        ("walls in the wrong order", walls_in_wrong_order), ("a damaged photograph", damaged_photograph),
        ("two windows", two_windows), ("browser back", browser_back), ("run", run),
        ("a changed pressure", changed_pressure), ("a rod at a wrong place", wrong_place), ("run again", run_wrong),
        ("the wrong place undone", undo_wrong_place), ("a copied experiment", copied_experiment),
    ):  # fmt: skip
        journey.step(name, lambda work=work: work(journey))
        wrong = Axe().run(journey.tab).response["violations"]
        assert wrong == [], (name, [(each["id"], [node["html"][:120] for node in each["nodes"]]) for each in wrong])


def messages(tab: Page) -> str:
    return " ".join(tab.locator("#panel .messages").all_inner_texts())


def undo(journey: Journey, name: str) -> None:
    """Undo by key; the page states what."""
    journey.tab.locator("#canvas").focus()
    journey.tab.keyboard.press("Control+z")
    idle(journey.tab)
    expect(journey.tab.locator("#toast")).to_contain_text(f"Undone: {name}")


def interval_in_words(journey: Journey) -> None:
    tab = journey.tab
    tab.get_by_text("Set up an experiment from these").click()
    idle(tab)
    fill(tab, "interval", "a minute")
    expect(tab.locator("#refused")).to_contain_text("is not a number")
    fill(tab, "interval", "9999")
    undo(journey, "photographs")
    fill(tab, "interval", f"{journey.made.interval:.3f}")


def walls_before_scale(journey: Journey) -> None:
    tab, line = journey.tab, journey.made.box[0]
    go(tab, "walls")
    journey.drag(tuple(line[0].tolist()), tuple(line[1].tolist()))
    expect(tab.locator("#panel")).to_contain_text("Set the scale first")
    assert tab.evaluate("workbench.project.walls") == []
    journey.whole()  # the drag has moved the picture


def scale_wrong_by_ten(journey: Journey) -> str:
    """The ruler's centimetres are taken for decimetres: the known radii show it."""
    tab = journey.tab
    measure(journey)
    fill(tab, "distance", f"{1e4 * RULER:g}")
    go(tab, "rods")
    type_radii(journey)
    tab.click("#detect")
    idle(tab)
    expect(tab.locator("#toast")).to_contain_text("looks 10 times too large")
    undo(journey, "scale")
    return f"{1e3 * tab.evaluate('workbench.project.pixel'):.5f} mm a pixel"


def type_radii(journey: Journey) -> None:
    sizes = np.unique(journey.made.radius)
    journey.tab.fill("#field-radii", ", ".join(f"{1e3 * PIXEL * each:g}" for each in sizes))


def bolts_among_rods(journey: Journey) -> str:
    """Rods are detected before there are walls: heads of bolts are round, too."""
    tab = journey.tab
    go(tab, "rods")
    type_radii(journey)
    tab.click("#detect")
    idle(tab)
    journey.click((0.45 * PAD, 0.45 * PAD))  # the head of a bolt
    return f"{tab.evaluate('workbench.project.rods.id.length')} circles"


def walls_in_wrong_order(journey: Journey) -> str:
    """Each bar from its other end, the last one first: names and sides are right; then bolts lie outside."""
    tab, made = journey.tab, journey.made
    journey.made = replace(made, box=made.box[::-1, ::-1])
    draw_bars(journey)
    journey.made = made
    assert {w["name"] for w in tab.evaluate("workbench.project.walls")} == {"bottom", "right", "top", "left"}
    fill(tab, "pressure-left", "50")  # the wrong bar is loaded
    undo(journey, "wall left")
    tab.click("#step-rods")
    idle(tab)
    outside = len(tab.evaluate("workbench.project.outside"))
    assert outside > 0
    expect(tab.locator("#panel .messages").first).to_contain_text("outside the walls: bolts")
    drop_outside(journey)
    undo(journey, f"{outside} circles outside the walls dropped")
    drop_outside(journey)
    correct_rods(journey)
    return f"{outside} circles outside the walls dropped"


def drop_outside(journey: Journey) -> None:
    journey.tab.click("#drop-outside")
    idle(journey.tab)
    assert journey.tab.evaluate("workbench.project.outside") == []


def damaged_photograph(journey: Journey) -> str:
    """A file that was copied in part is named, and left out; the others keep their times."""
    tab = journey.tab
    name = tab.evaluate(f"workbench.project.files[{DAMAGED}]")
    file = journey.made.folder / FOLDER / "camera roll" / name
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])
    go(tab, "photographs")
    tab.wait_for_function(f"() => workbench.project.series.unusable.includes({DAMAGED})")
    expect(tab.locator("#panel .messages").first).to_contain_text(f"Photograph {DAMAGED}, {name}, is cut short")
    go(tab, "run")
    expect(tab.locator("#run")).to_be_disabled()
    go(tab, "photographs")
    tab.evaluate(f"workbench.show({DAMAGED})")
    idle(tab)
    tab.click("#leave-out")
    idle(tab)
    undo(journey, f"camera roll/{name} left out")
    tab.evaluate(f"workbench.show({DAMAGED})")
    tab.locator("#canvas").focus()
    tab.keyboard.press("Delete")
    idle(tab)
    assert name not in tab.evaluate("workbench.project.files")
    set_material(journey)
    return f"{name} left out"


def two_windows(journey: Journey) -> None:
    """What one window deletes is gone in the other, and its undo brings it back in both."""
    tab = journey.tab
    other = tab.context.new_page()
    other.goto(tab.url)
    idle(other)
    go(other, "rods")
    count = tab.evaluate("workbench.project.rods.id.length")
    other.evaluate("workbench.change('delete_rods', { ids: [workbench.project.rods.id[5]] })")
    idle(other)
    tab.locator("#canvas").focus()
    tab.wait_for_function(f"() => workbench.project.rods.id.length === {count - 1}")
    undo(journey, "rod ")
    other.wait_for_function(f"() => workbench.project.rods.id.length === {count}")
    other.close()


def browser_back(journey: Journey) -> None:
    tab = journey.tab
    for step in ("scale", "walls", "rods"):
        go(tab, step)
    for step in ("walls", "scale"):
        tab.go_back()
        tab.wait_for_function(f"() => workbench.step.name === '{step}'")
    tab.go_forward()
    tab.wait_for_function("() => workbench.step.name === 'walls'")


def run(journey: MistakenJourney) -> str:
    tab = journey.tab
    go(tab, "run")
    tab.click("#run")
    expect(tab.locator("#run-state")).to_have_text("running")
    expect(tab.locator("#run-state")).not_to_have_text("running", timeout=PATIENCE)
    idle(tab)
    expect(tab.locator("#run-state")).to_have_text("finished")
    journey.r = correlations_of(journey)
    return f"r {np.nanmean(journey.r[5:]):.4f}"


def changed_pressure(journey: Journey) -> None:
    """After the run: every later step names it, until it is undone."""
    tab = journey.tab
    go(tab, "walls")
    fill(tab, "pressure-top", "500")
    for step in ("run", "inspect", "review", "share"):
        go(tab, step)
        expect(tab.locator("#panel .messages").first).to_contain_text("walls.top.pressure was 50000 and is 500000")
        assert journey.mark(step) in ("doubtful", "missing")
    expect(tab.locator("#standing")).to_contain_text("out of date")
    undo(journey, "wall top")
    go(tab, "run")
    assert "walls.top.pressure" not in messages(tab)


def wrong_place(journey: Journey) -> str:
    """A rod is dragged onto its neighbour and kept there, although the card warns."""
    tab, made = journey.tab, journey.made
    go(tab, "correct")
    journey.whole()  # the contact that was looked at is still large
    tab.evaluate(f"workbench.show({WRONG_FRAME})")
    idle(tab)
    chosen = chosen_rod(journey)
    x, y, _ = made.poses[WRONG_FRAME, chosen]
    journey.click((float(x), float(y)))
    neighbour = int(np.argsort(np.hypot(*(made.poses[WRONG_FRAME, :, :2] - made.poses[WRONG_FRAME, chosen, :2]).T))[1])
    there = made.poses[WRONG_FRAME, neighbour, :2]
    away = SHIFT / np.hypot(*(there - (x, y)))
    journey.drag((float(x), float(y)), (float(x + away * (there[0] - x)), float(y + away * (there[1] - y))))
    tab.wait_for_function("() => document.getElementById('warnings')")
    warned = tab.locator("#warnings").inner_text()
    assert "overlap by" in warned
    assert "Against its neighbours it has moved" in warned
    tab.click("#keep")
    idle(tab)
    expect(tab.locator("#again")).to_be_visible()
    return warned.replace("\n", " ")


def chosen_rod(journey: Journey) -> int:
    """A rod well inside, by its row in the truth."""
    place = journey.made.poses[0, :, :2]
    far = np.hypot(*(place - np.median(place, axis=0)).T)
    far[[*journey.made.dim, journey.made.hidden]] = np.inf
    return int(far.argmin())


def run_wrong(journey: MistakenJourney) -> str:
    """The next run applies the wrong pose: it costs its own rod in its own photograph at most."""
    before = tracks_of(journey)
    note = run(journey)
    moved = np.hypot(*((tracks_of(journey).position - before.position) / PIXEL).transpose(2, 0, 1))
    worse = np.argwhere((moved > SAME) | (np.isnan(moved) & before.present)).tolist()
    row = names_of(journey).tolist().index(chosen_rod(journey))
    assert worse in ([], [[WRONG_FRAME, row]]), worse
    journey.former = before
    return f"{note}, changed: {worse}"


def undo_wrong_place(journey: MistakenJourney) -> str:
    go(journey.tab, "correct")
    expect(journey.tab.locator("#corrections")).to_be_visible()
    undo(journey, "")
    expect(journey.tab.locator("#corrections")).to_have_count(0)
    note = run(journey)
    np.testing.assert_allclose(tracks_of(journey).position, journey.former.position, atol=1e-9)
    return note


def copied_experiment(journey: Journey) -> None:
    """A copy made by a file manager: it has no run, and cannot overwrite that of the original."""
    tab, root = journey.tab, journey.made.folder
    shutil.copytree(root / FOLDER, root / COPY)
    results = (root / "runs" / FOLDER / "results.h5").read_bytes()
    tab.click("#brand")
    idle(tab)
    copy = tab.locator(".tile").filter(has_text=COPY)
    expect(copy).to_contain_text("not run yet")
    copy.click()
    idle(tab)
    go(tab, "photographs")
    expect(tab.locator("#panel .messages").first).to_contain_text(f"runs/{FOLDER} holds the run of {FOLDER}")
    go(tab, "run")
    expect(tab.locator("#run")).to_be_disabled()
    go(tab, "photographs")
    fill(tab, "name", COPY)
    assert "holds the run" not in messages(tab)
    assert tab.evaluate("workbench.project.ready")
    undo(journey, "photographs")
    expect(tab.locator("#panel .messages").first).to_contain_text("holds the run")
    assert (root / "runs" / FOLDER / "results.h5").read_bytes() == results


def results_of(journey: Journey) -> Results:
    return load_results(journey.made.folder / "runs" / FOLDER / "results.h5")


def tracks_of(journey: Journey) -> Tracks:
    return results_of(journey).tracks


def correlations_of(journey: Journey) -> NDArray[np.float64]:
    """r(f_n) of every frame against the truth, in which the photograph that was left out is missing, too."""
    results, source = results_of(journey), journey.made.truth / "truth_contacts.csv"
    with source.open() as stream:
        head, *rows = csv.reader(stream)
    at = head.index("frame")
    kept = [[*r[:at], str(int(r[at]) - (int(r[at]) > DAMAGED)), *r[at + 1 :]] for r in rows if int(r[at]) != DAMAGED]
    file = source.with_name("truth_of_the_photographs_used.csv")
    with file.open("w", newline="") as stream:
        csv.writer(stream).writerows([head, *kept])
    truth = read_truth(file, names_of(journey), results.walls.name, frame_count=len(results.frames))
    return correlations(score(results, truth))


def make_folder(out: Path, **values: int) -> LaboratorySet:
    """Photographs in a folder below the one that is opened, so that copies can lie beside it."""
    made = make_laboratory_set(out, **values)
    (made.folder / FOLDER).mkdir()
    (made.folder / "camera roll").rename(made.folder / FOLDER / "camera roll")
    return made


def main(out: Path, grains: str = "60") -> None:
    from playwright.sync_api import sync_playwright

    from tests.app.workbench.hand import opened
    from tests.browser import FLAGS, SECONDS, find_chromium

    made = make_folder(out, grains=int(grains), frames=10)
    pictures = out / "pictures"
    pictures.mkdir()
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=find_chromium(), args=FLAGS, chromium_sandbox=False)
        page = browser.new_context(color_scheme="dark").new_page()
        page.set_default_timeout(1e3 * SECONDS)
        expect.set_options(timeout=1e3 * SECONDS)
        with opened(page, made.folder) as tab:
            try:
                make_mistakes(MistakenJourney(tab, made, pictures))
            finally:
                tab.screenshot(path=str(pictures / "last.png"))
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
