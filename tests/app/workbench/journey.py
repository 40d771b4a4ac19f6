"""From a camera's folder to judged forces by mouse and keyboard alone, as a new user works; every step is logged.

python -m tests.app.workbench.journey DIR     # pictures of every step, and what they took
"""

from __future__ import annotations

import csv
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, expect
from rodsight.results.hdf5.store import load_results
from rodsight.results.results import Results
from rodsight.results.truth import correlations, read_truth, score

from tests.app.workbench.hand import fill, go, idle, on_screen
from tests.app.workbench.laboratory_set import HIDDEN, PIXEL, RULER, LaboratorySet

PATIENCE = 400e3  # [ms] of a run
MOST_LOOKED_AT = 30  # pairs, until one does not touch
CLOSE = 8.0  # [px] within which a pose is a rod's
NEAR = 4.0  # [screen px / px], how far a hand zooms in to be exact


@dataclass
class Journey:
    """A person at the page: what was done, how long it took, and a picture after every step."""

    tab: Page
    made: LaboratorySet
    pictures: Path | None = None
    began: float = field(default_factory=time.monotonic)
    log: list[str] = field(default_factory=list)
    judged: int = 0  # the photograph in which a pair was judged

    @property
    def seconds(self) -> float:
        """Since it began."""
        return time.monotonic() - self.began

    def step(self, name: str, work: Callable[[], str | None]) -> None:
        since = time.monotonic()
        note = work()
        idle(self.tab)
        self.log.append(f"{time.monotonic() - self.began:6.1f} s  {time.monotonic() - since:5.1f} s  {name}"
                        + (f": {note}" if note else ""))  # fmt: skip
        print(self.log[-1], flush=True)
        if self.pictures is not None:
            self.tab.wait_for_timeout(300)
            number = len(self.log)
            self.tab.screenshot(path=str(self.pictures / f"{number:02d} {name}.png"))

    def at(self, place: tuple[float, float]) -> tuple[int, int]:
        """Where a place of the photograph is; a mouse knows whole pixels of the screen only."""
        x, y = (round(each) for each in on_screen(self.tab, place))
        assert self.tab.evaluate("([x, y]) => document.elementFromPoint(x, y)?.id", [x, y]) == "canvas", (x, y)
        return x, y

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.tab.mouse.move(*self.at(start))
        self.tab.mouse.down()
        self.tab.mouse.move(*self.at((0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]))))
        self.tab.mouse.move(*self.at(end))
        self.tab.mouse.up()
        idle(self.tab)

    def click(self, place: tuple[float, float]) -> None:
        self.tab.mouse.click(*self.at(place))
        idle(self.tab)

    def look_at(self, place: tuple[float, float]) -> None:
        """Wheel in over a place, until a pixel of the photograph is large."""
        self.tab.mouse.move(*self.at(place))
        while self.tab.evaluate("workbench.stage.view.k") < NEAR:
            self.tab.mouse.wheel(0, -300)
            self.tab.evaluate("new Promise((drawn) => requestAnimationFrame(() => drawn(null)))")

    def whole(self) -> None:
        self.tab.locator("#canvas").focus()
        self.tab.keyboard.press("f")

    def mark(self, step: str) -> str:
        return self.tab.locator(f"#step-{step} .sign").get_attribute("title") or ""


def travel(journey: Journey) -> None:
    """The whole journey."""
    tab = journey.tab
    journey.step("the folder", lambda: None)
    journey.step("photographs", lambda: begin(journey))
    journey.step("scale", lambda: measure(journey))
    journey.step("walls", lambda: draw_bars(journey))
    journey.step("rods", lambda: find_rods(journey))
    journey.step("rods corrected", lambda: correct_rods(journey))
    journey.step("material", lambda: set_material(journey))
    journey.step("run", lambda: run(journey))
    journey.step("a lost rod", lambda: pick_lost(journey))
    journey.step("dragged to its place", lambda: drag_lost(journey))
    journey.step("kept", lambda: keep(journey))
    journey.step("run again", lambda: run(journey))
    journey.step("corrected", lambda: go(tab, "correct"))
    journey.step("a contact", lambda: look_at_contact(journey))
    journey.step("a verdict", lambda: judge(journey))
    journey.step("run with the verdict", lambda: run(journey))
    journey.step("before and after", lambda: see_change(journey))


def begin(journey: Journey) -> None:
    tab = journey.tab
    tab.get_by_text("Set up an experiment from these").click()
    idle(tab)
    fill(tab, "interval", f"{journey.made.interval:.3f}")


def measure(journey: Journey) -> str:
    """Drag along the ruler; then each end is put on its mark under the magnified picture."""
    tab, (start, end) = journey.tab, journey.made.ruler
    go(tab, "scale")
    journey.drag((start[0] + 2.0, start[1] + 4.0), (end[0] - 2.0, end[1] + 4.0))
    for k, mark in enumerate((start, end)):
        journey.look_at(mark)
        now = tab.evaluate(f"workbench.step.drawn()[{k}]")
        journey.drag(tuple(now), (mark[0], mark[1] + 4.0))
        journey.whole()
    fill(tab, "distance", f"{1e3 * RULER:g}")
    found = tab.evaluate("workbench.project.pixel")
    return f"{1e3 * found:.5f} mm a pixel, {100.0 * (found / PIXEL - 1.0):+.3f} %"


def draw_bars(journey: Journey) -> str:
    """Along every bar, some pixels beside its edge: the line snaps."""
    tab = journey.tab
    go(tab, "walls")
    for line in journey.made.box:
        along = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
        beside = 5.0 * np.array([along[1], -along[0]])
        start, end = line[0] + 14.0 * along + beside, line[1] - 14.0 * along + beside
        journey.drag(tuple(start.tolist()), tuple(end.tolist()))
    fill(tab, "pressure-top", "50")
    return f"{', '.join(tab.evaluate('workbench.project.walls.map((w) => w.name)'))}: {journey.mark('walls')}"


def find_rods(journey: Journey) -> str:
    tab = journey.tab
    go(tab, "rods")
    tab.fill("#field-radii", ", ".join(f"{1e3 * PIXEL * each:g}" for each in np.unique(journey.made.radius)))
    tab.click("#detect")
    idle(tab)
    missed, false = compare(journey)
    return f"{tab.evaluate('workbench.project.rods.id.length')} found, {len(missed)} missed, {len(false)} that are none"


def compare(journey: Journey) -> tuple[list[int], list[int]]:
    """Rods that are not found where they are, and rows of found ones that are none, or not as large."""
    made, tab = journey.made, journey.tab
    rods = tab.evaluate("workbench.project.rods")
    found = np.column_stack([rods["x"], rods["y"], rods["r"]])
    true = np.column_stack([made.poses[0, :, :2], made.radius])
    off = np.hypot(*(true[:, None, :2] - found[None, :, :2]).transpose(2, 0, 1))
    same = (off < 3.0) & (np.abs(true[:, None, 2] - found[None, :, 2]) < 2.0)
    return np.flatnonzero(~same.any(axis=1)).tolist(), np.flatnonzero(~same.any(axis=0)).tolist()


def correct_rods(journey: Journey) -> str:
    """Wrong ones are chosen and deleted, missed ones clicked in their middle."""
    tab, made = journey.tab, journey.made
    missed, false = compare(journey)
    rods = tab.evaluate("workbench.project.rods")
    for row in false:
        journey.click((rods["x"][row], rods["y"][row]))
        tab.keyboard.press("Delete")
        idle(tab)
    for row in missed:
        journey.click((float(made.poses[0, row, 0]), float(made.poses[0, row, 1])))
    left = compare(journey)
    assert left == ([], []), left
    return f"{len(false)} deleted, {len(missed)} added"


def set_material(journey: Journey) -> str:
    tab = journey.tab
    go(tab, "material")
    tab.get_by_role("button", name="aluminium").click()
    idle(tab)
    marks = {step: journey.mark(step) for step in ("photographs", "scale", "walls", "rods", "material")}
    assert set(marks.values()) == {"good"}, marks
    return "every step is good"


def run(journey: Journey) -> str:
    tab = journey.tab
    go(tab, "run")
    tab.click("#run")
    expect(tab.locator("#run-state")).to_have_text("running")
    expect(tab.locator("#run-state")).not_to_have_text("running", timeout=PATIENCE)
    idle(tab)
    expect(tab.locator("#run-state")).to_have_text("finished")
    return (tab.locator("#standing").text_content() or "") + f", r {np.nanmean(journey_r(journey)[5:]):.4f}"


def pick_lost(journey: Journey) -> str:
    """To the photograph in which the rod is lost, by the key for uncertain rods."""
    tab = journey.tab
    go(tab, "correct")
    expect(tab.locator("#next-uncertain")).to_be_visible()
    name = row_of(journey)
    lost = tracks_of(journey).present[:, name]
    note = f"lost in {np.flatnonzero(~lost).tolist()}"
    for _ in range(40):
        if tab.evaluate("[workbench.frame, workbench.step.chosen()]") == [HIDDEN, name]:
            break
        tab.keyboard.press("n")
        idle(tab)
    assert tab.evaluate("workbench.frame") == HIDDEN, note
    return note


def drag_lost(journey: Journey) -> str:
    """To where it is seen, by hand: the face is overexposed."""
    tab, made = journey.tab, journey.made
    ghost = tab.evaluate("workbench.step.ghost()")
    x, y, _ = made.poses[HIDDEN, made.hidden]
    journey.drag((ghost[0], ghost[1]), (float(x) + 1.0, float(y) - 1.0))
    expect(tab.locator("#keep")).to_be_enabled()
    return tab.locator("#correction").inner_text().replace("\n", " ")[:160]


def keep(journey: Journey) -> str:
    journey.tab.keyboard.press("Shift+Enter")
    idle(journey.tab)
    return journey.tab.locator("#toast").inner_text()


def look_at_contact(journey: Journey) -> str:
    tab = journey.tab
    go(tab, "review")
    tab.wait_for_selector("#next")
    touching = true_contacts(journey)
    for _ in range(MOST_LOOKED_AT):
        tab.keyboard.press("[")
        idle(tab)
        pair = tab.evaluate("review.pair")
        if (tab.evaluate("workbench.frame"), *sorted((int(pair["i"]), int(pair["j"])))) not in touching:
            break
    return tab.locator("#bodies").inner_text()


def true_contacts(journey: Journey) -> set[tuple[int, int, int]]:
    """Frames and the page's ids of the rods that touch, as a person with good eyes sees them."""
    ids = dict(zip(names_of(journey).tolist(), tracks_of(journey).id.tolist(), strict=True))
    with (journey.made.truth / "truth_contacts.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["j"].isdigit()]
    return {(int(row["frame"]), *sorted((ids[int(row["i"])], ids[int(row["j"])]))) for row in rows}  # type: ignore[misc]


def judge(journey: Journey) -> str:
    tab = journey.tab
    tab.fill("#reviewer", "Anna")
    tab.keyboard.press("Enter")
    idle(tab)
    pair, journey.judged = tab.evaluate("review.pair"), tab.evaluate("workbench.frame")
    tab.locator("#canvas").focus()
    tab.keyboard.press("n")
    idle(tab)
    return f"frame {journey.judged}, {pair['i']} – {pair['j']}: no contact"


def see_change(journey: Journey) -> str:
    tab = journey.tab
    go(tab, "review")
    tab.wait_for_selector("#next")
    tab.locator("#judged button").first.click()
    idle(tab)
    assert tab.evaluate("workbench.frame") == journey.judged
    expect(tab.locator("#before-after")).to_be_visible()
    return tab.locator("#before-after").inner_text().replace("\n", " ")


def results_of(journey: Journey) -> Results:
    folder = journey.made.folder / "runs"
    (run,) = folder.iterdir()
    return load_results(run / "results.h5")


def tracks_of(journey: Journey):
    return results_of(journey).tracks


def names_of(journey: Journey) -> np.ndarray:
    """The truth's id of every rod of the run, by where it is on the first photograph; −1: none."""
    rods = journey.tab.evaluate("workbench.project.rods")
    place, true = np.column_stack([rods["x"], rods["y"]]), journey.made.poses[0, :, :2]
    off = np.hypot(*(place[:, None] - true[None]).transpose(2, 0, 1))
    names = dict(zip(rods["id"], np.where(off.min(axis=1) < CLOSE, off.argmin(axis=1), -1).tolist(), strict=True))
    return np.array([names.get(int(each), -1) for each in tracks_of(journey).id])


def row_of(journey: Journey) -> int:
    """The hidden rod's id on the page."""
    return int(tracks_of(journey).id[np.flatnonzero(names_of(journey) == journey.made.hidden)[0]])


def journey_r(journey: Journey) -> np.ndarray:
    """r(f_n) of every frame against the truth."""
    results = results_of(journey)
    truth = read_truth(
        journey.made.truth / "truth_contacts.csv", names_of(journey), results.walls.name,
        frame_count=len(results.frames),
    )  # fmt: skip
    return correlations(score(results, truth))


def main(out: Path) -> None:
    from playwright.sync_api import sync_playwright

    from tests.app.workbench.hand import opened
    from tests.app.workbench.laboratory_set import make_laboratory_set
    from tests.browser import FLAGS, SECONDS, find_chromium

    made = make_laboratory_set(out)
    pictures = out / "pictures"
    pictures.mkdir()
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=find_chromium(), args=FLAGS, chromium_sandbox=False)
        page = browser.new_context(color_scheme="dark").new_page()
        page.set_default_timeout(1e3 * SECONDS)
        expect.set_options(timeout=1e3 * SECONDS)
        with opened(page, made.folder) as tab:
            journey = Journey(tab, made, pictures)
            try:
                travel(journey)
            finally:
                tab.screenshot(path=str(pictures / "last.png"))
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
