"""Faults that once destroyed work or edited something else, by mouse and keyboard. In a real Chromium."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import Page, expect
from rodsight import pipeline
from rodsight.experiment.corrections import read_corrections
from rodsight.experiment.experiment import load_experiment
from rodsight.experiment.reading.photograph_order import natural_key
from rodsight.experiment.reading.tables import read_table
from rodsight.tracks import TrackStatus
from rodsight.verdicts.log import VERDICTS, VerdictLog
from rodsight.workbench.setup.draft import Draft

from tests.app.workbench.hand import drag, fill, go, idle, on_screen, opened
from tests.app.workbench.spoiled_tracks import ROD, WRONG, true_poses
from tests.app.workbench.test_inspecting_in_browser import fill_name
from tests.app.workbench.test_photograph_series import with_notes
from tests.program import rodsight

pytestmark = pytest.mark.screen
RIGHT = 0.15  # [px] of a place
FRAME = 3  # a photograph of the stored run, which begins at photograph 2
LARGE = 9.0  # [px of the screen] of a rod's radius: small enough that a neighbour is in view


def enter(tab: Page, step: str) -> None:
    tab.locator(".tile").first.click()
    idle(tab)
    go(tab, step)


def choose_wrong_rod(tab: Page) -> None:
    enter(tab, "correct")
    expect(tab.locator("#next-uncertain")).to_be_visible()
    tab.keyboard.press("n")
    expect(tab.locator("#correction")).to_contain_text(f"Rod {ROD}")
    expect(tab.locator("#correction .evidence canvas")).to_have_count(5)
    assert tab.evaluate("workbench.frame") == WRONG


@pytest.fixture(scope="module")
def finished_once(made_photographs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an experiment of photographs, mine, and its run; not to be written to."""
    root = tmp_path_factory.mktemp("finished")
    shutil.copytree(made_photographs, root / "mine")
    out = root / "runs" / load_experiment(root / "mine").name
    assert rodsight("run", root / "mine", "--out", out, "--view", "none", "--quiet") == 0
    return root


@pytest.fixture
def finished(finished_once: Path, tmp_path: Path) -> Path:
    """A copy of it that a test may change."""
    return Path(shutil.copytree(finished_once, tmp_path, dirs_exist_ok=True))


def test_a_rod_kept_under_a_glare_costs_itself_alone(page: Page, spoiled: Path):
    """Nothing correlates there: neither the photograph's other rods nor the next photograph are lost."""
    truth, experiment = true_poses(spoiled), load_experiment(spoiled / "mine")
    file = experiment.photographs().files[WRONG]
    x, y, _ = truth[WRONG, ROD]
    photograph = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
    assert photograph is not None
    radius = read_table(spoiled / "mine" / "grains.csv", ("id", "radius")).numbers("radius")[ROD]
    cv2.circle(photograph, (round(x), round(y)), round(radius), 250.0, -1, cv2.LINE_AA)
    assert cv2.imwrite(str(file), photograph)
    with opened(page, spoiled) as tab:
        choose_wrong_rod(tab)
        tab.evaluate(f"workbench.stage.zoom({LARGE} / workbench.stage.view.k / workbench.step.rods().r[0])")
        drag(tab, tab.evaluate("workbench.step.ghost().slice(0, 2)"), (float(x) + 1.0, float(y)))
        expect(tab.locator("#warnings")).to_contain_text("Nothing correlates there")
        tab.click("#keep")
        idle(tab)
        expect(tab.locator("#again")).to_contain_text("given")
        assert "NaN" not in tab.locator("#panel").inner_text()
    tracks, _ = pipeline.track(pipeline.Run(load_experiment(spoiled / "mine"), spoiled / "again"))
    others = np.arange(tracks.grain_count) != ROD
    assert (tracks.status[:, others] == TrackStatus.OK).all()
    assert np.isfinite(tracks.position[:, others]).all()
    assert tracks.status[-1, ROD] == TrackStatus.OK


def test_a_rod_dragged_near_its_place_is_found_although_dirt_covers_the_first_photograph(page: Page, spoiled: Path):
    """Its angle need not be turned by hand, and the neighbour that lies nearer is not proposed."""
    truth, experiment = true_poses(spoiled), load_experiment(spoiled / "mine")
    table = read_table(spoiled / "mine" / "grains.csv", ("id", "x", "y", "radius"))
    x, y, radius = (float(table.numbers(name)[ROD]) for name in ("x", "y", "radius"))
    first = cv2.imread(str(experiment.photographs().files[0]), cv2.IMREAD_GRAYSCALE)
    assert first is not None
    rows, columns = np.ogrid[: first.shape[0], : first.shape[1]]
    first[(np.hypot(columns - x, rows - y) < radius) & (columns > x + 0.1 * radius)] = 60
    assert cv2.imwrite(str(experiment.photographs().files[0]), first)
    x, y, theta = (float(each) for each in truth[WRONG, ROD])
    with opened(page, spoiled) as tab:
        choose_wrong_rod(tab)
        ghost = tab.evaluate("workbench.step.ghost()")
        assert ghost[:2] == pytest.approx([x, y], abs=RIGHT)
        tab.keyboard.press("Escape")
        tab.evaluate(f"workbench.stage.zoom({LARGE} / workbench.stage.view.k / workbench.step.rods().r[0])")
        choose_wrong_rod_again(tab)
        drag(tab, tuple(ghost[:2]), (x + 1.4, y + 0.4))
        away = "(([u, v]) => Math.hypot(u - x, v - y))(workbench.step.ghost())"
        tab.wait_for_function(f"([x, y]) => {away} < {RIGHT}", arg=[x, y])
        expect(tab.locator("#correction")).to_contain_text("±")
        *_, angle = tab.evaluate("workbench.step.ghost()")
        assert np.cos(angle + theta) == pytest.approx(1.0, abs=1e-3)


def choose_wrong_rod_again(tab: Page) -> None:
    tab.keyboard.press("n")
    idle(tab)
    expect(tab.locator("#correction .evidence canvas")).to_have_count(5)


def test_undo_takes_back_the_verdict_and_then_the_correction_after_a_restart(page: Page, finished: Path):
    name = load_experiment(finished / "mine").name
    log = VerdictLog(finished / "runs" / name / VERDICTS)

    def verdicts() -> list[str]:
        return [str(entry.verdict) for _, entry in log.verdicts()]

    def corrected() -> int:
        read = read_corrections(load_experiment(finished / "mine"), None, 4)
        return 0 if read is None else len(read.id)

    with opened(page, finished) as tab:
        enter(tab, "correct")
        tab.evaluate(f"workbench.show({FRAME})")
        idle(tab)
        rods = tab.evaluate("(({ x, y }) => [x, y])(workbench.step.rods())")
        tab.mouse.click(*on_screen(tab, (rods[0][0], rods[1][0])))
        expect(tab.locator("#correction")).to_be_visible()
        tab.keyboard.press("x")
        idle(tab)
        assert corrected() == 1
        go(tab, "inspect")
        tab.evaluate(f"workbench.show({FRAME})")
        idle(tab)
        tab.mouse.click(*on_screen(tab, tab.evaluate("workbench.step.contactAt(0)")))
        tab.wait_for_selector("#card .verdicts")
        fill_name(tab)
        tab.keyboard.press("n")
        idle(tab)
        assert verdicts() == ["no contact"]
    with opened(page, finished) as tab:  # another program, another page
        enter(tab, "correct")
        tab.locator("#canvas").focus()
        tab.keyboard.press("Control+z")
        idle(tab)
        expect(tab.locator("#toast")).to_contain_text("no contact")
        assert (verdicts(), corrected()) == ([], 1)
        tab.locator("#canvas").focus()
        tab.keyboard.press("Control+z")
        idle(tab)
        assert corrected() == 0


def test_a_tile_opens_its_own_folder_although_another_window_has_added_one_before_it(page: Page, solved: Path):
    with opened(page, solved) as first:
        shutil.copytree(solved / "my photographs" / "pictures", solved / "a new series")
        second = first.context.new_page()
        second.goto(first.url)
        idle(second)
        expect(second.get_by_text("a new series")).to_be_visible()  # offered beside one that is set up
        second.get_by_text("Set up an experiment from these").first.click()
        idle(second)
        assert second.evaluate("workbench.project.at") == "a new series"
        first.locator(".tile").first.click()  # on a page that was drawn before
        idle(first)
        assert first.evaluate("workbench.project.at") == "my photographs"


def test_bolts_outside_the_walls_and_a_scale_wrong_by_ten_are_named(page: Page, begun: Path, made_photographs: Path):
    section = load_experiment(made_photographs).config.photographs
    with opened(page, begun) as tab:
        enter(tab, "walls")
        tab.click("#find-walls")
        idle(tab)
        go(tab, "rods")
        for place in ((14.0, 14.0), (14.0, 300.0)):
            tab.mouse.click(*on_screen(tab, place))
            idle(tab)
        assert tab.evaluate("workbench.project.rods.id.length") == 32
        expect(tab.locator("#panel .messages").first).to_contain_text("outside the walls: bolts")
        tab.click("#drop-outside")
        idle(tab)
        assert tab.evaluate("workbench.project.rods.id.length") == 30
        tab.locator("#canvas").focus()
        tab.keyboard.press("Control+z")
        idle(tab)
        assert tab.evaluate("workbench.project.rods.id.length") == 32
        go(tab, "scale")
        tab.get_by_role("button", name="The number").click()
        fill(tab, "pixel-size", f"{1e4 * section.pixel_size:g}")
        go(tab, "rods")
        tab.fill("#field-radii", ", ".join(f"{1e3 * radius:g}" for radius in section.radii))
        tab.click("#detect")
        idle(tab)
        expect(tab.locator("#toast")).to_contain_text("scale: looks 10 times too large")


def test_a_camera_counter_its_clock_and_its_rotation(page: Page, photographs_only: Path):
    folder = photographs_only / "my photographs"
    wrapped = ["DSC_9998.jpg", "DSC_9999.jpg", "DSC_0001.jpg", "DSC_0002.jpg"]
    files = sorted((folder / "pictures").iterdir(), key=natural_key)
    for file, name, seconds in zip(files, wrapped, (0, 61, 31, 92), strict=True):
        with_notes(file.rename(file.with_name(name)), seconds, orientation=6)
    Draft(folder).set_keys("all", {"name": "mine", "photographs.files": "pictures/*.jpg", "photographs.interval": 30.0})
    with opened(page, photographs_only) as tab:
        enter(tab, "photographs")
        assert tab.evaluate("workbench.project.files") == wrapped
        stated = tab.locator("#panel .messages").first
        expect(stated).to_contain_text("stand upright when rotated by 90° clockwise")
        expect(stated).to_contain_text("DSC_0001.jpg was taken before DSC_9999.jpg")
        tab.click("#camera-times")
        idle(tab)
        assert tab.evaluate("workbench.project.files") == [wrapped[0], wrapped[2], wrapped[1], wrapped[3]]
        expect(stated).not_to_contain_text("was taken before")
    assert (folder / "times.csv").read_text().split() == ["frame,time", "0,0.0", "1,31.0", "2,61.0", "3,92.0"]


def test_a_pressure_changed_after_the_run_is_named_at_every_later_step_until_it_is_undone(page: Page, finished: Path):
    with opened(page, finished) as tab:
        enter(tab, "walls")
        fill(tab, "pressure-top", "500")
        for step in ("run", "inspect", "review", "share"):
            go(tab, step)
            expect(tab.locator("#panel .messages").first).to_contain_text("walls.top.pressure was 50000 and is 500000")
            assert tab.locator(f"#step-{step} .sign").get_attribute("title") in ("doubtful", "missing")
        expect(tab.locator("#standing")).to_contain_text("out of date")
        tab.click("#brand")
        idle(tab)
        expect(tab.locator(".tile").first).to_contain_text("out of date")
        tab.locator(".tile").first.click()
        idle(tab)
        tab.locator("#canvas").focus()
        tab.keyboard.press("Control+z")
        idle(tab)
        go(tab, "inspect")
        expect(tab.locator("#panel")).not_to_contain_text("walls.top.pressure")
        assert tab.locator("#step-inspect .sign").get_attribute("title") != "missing"
