"""The page in a real headless Chromium."""

import json
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from rodsight.results.hdf5.store import load_results
from rodsight.review.command import open_session
from rodsight.review.reviewed_run import open_reviewed
from rodsight.review.service.server import ReviewServer
from rodsight.review.service.session import ReviewSession
from rodsight.verdicts.decisions import Bodies
from rodsight.verdicts.log import VERDICTS

from solver.bodies.grains import Array
from solver.contacts.contacts import ContactSource
from tests.browser import LIKE, picture_of, wait_for_colour, wait_until_still
from tests.program import rodsight

WIDTH, HEIGHT = 1280, 800
NO_PICTURE = "HTMLCanvasElement.prototype.getContext = () => null;"  # a browser that cannot draw WebGL
PINK, GREEN = (255, 84, 130), (40, 224, 150)  # of the marks of verdicts
MARKED = {"least": 20, "reach": 14}  # [px] of a mark that is drawn


@pytest.fixture(scope="module")
def solved_photographs(made_photographs: Path, tmp_path_factory) -> tuple[Path, Path]:
    """A small photographed experiment and its run; not to be written to."""
    out = tmp_path_factory.mktemp("review") / "run"
    assert rodsight("solve", str(made_photographs), "--out", str(out), "--quiet", "--set", "solver.sweeps=50") == 0
    return made_photographs, out


@pytest.fixture
def run(solved_photographs, tmp_path) -> tuple[Path, Path]:
    experiment, out = solved_photographs
    return experiment, Path(shutil.copytree(out, tmp_path / "run"))


@pytest.fixture
def server(run):
    server = ReviewServer(open_session(open_reviewed(run[1])), reviewer="anna")
    thread = threading.Thread(target=server.serve, daemon=True)
    thread.start()
    yield server
    server.shutdown()
    server.close()
    thread.join()


@pytest.fixture
def tab(page: Page) -> Page:
    """A page as wide as a reviewer's."""
    page.set_viewport_size({"width": WIDTH, "height": HEIGHT})
    return page


def open_page(tab: Page, address: str) -> None:
    tab.goto(address)
    tab.wait_for_function("() => globalThis.review && review.drawn > 0")


def open_with_picture(tab: Page, address: str) -> None:
    open_page(tab, address)
    tab.wait_for_function("() => review.viewer && document.getElementById('loading').hidden")


def act(tab: Page, step: Callable[[], None]) -> None:
    """Do something and wait until the page has put the outcome before the reviewer."""
    before = tab.evaluate("review.drawn")
    step()
    tab.wait_for_function("(before) => review.drawn > before", arg=before)
    tab.evaluate("review.busy.then(() => null)")


def press(tab: Page, key: str) -> None:
    act(tab, lambda: tab.keyboard.press(key))


def on_screen(tab: Page, session: ReviewSession, point: Array) -> Array:
    """Where a point of the picture [px] lies on the page, with the whole packing in view."""
    canvas = session.picture.canvas
    width, height = tab.evaluate("document.getElementById('stage').clientWidth"), HEIGHT
    scale = min(width / canvas.width, height / canvas.height)  # the view keeps the picture's proportions
    middle = np.array([canvas.left + 0.5 * canvas.width, canvas.top + 0.5 * canvas.height])
    return np.array([0.5 * width, 0.5 * height]) + scale * (np.asarray(point) - middle)


def colour_near(tab: Page, place: Array, colour: tuple[int, int, int], reach: int = 14) -> int:
    """How many pixels around a place of the page have about a colour."""
    x, y = (round(v) for v in place)
    part = picture_of(tab)[max(y - reach, 0) : y + reach, max(x - reach, 0) : x + reach].astype(int)
    return int((np.abs(part - np.array(colour)).max(axis=2) < LIKE).sum())


def lines(out):
    return [json.loads(line) for line in (out / VERDICTS).read_text().splitlines()]


def missed_gap(session, frame):
    """Two neighbours that are no candidate, close enough for a click, far from every candidate."""
    from rodsight.review.service.picking import NEAR, WIDEST_GAP, near_pairs

    mean = float(session.results.grains.radius.mean())
    pairs = near_pairs(session.results, frame, WIDEST_GAP * mean)
    known = session.candidates(frame)
    for row in np.argsort(-pairs.gap):
        distance = np.linalg.norm(known.contacts.point - pairs.point[row], axis=1)
        if pairs.key[row] not in known.key and distance.min() > 1.3 * NEAR * mean:
            return int(pairs.key[row]), session.picture.canvas.points(pairs.point[row])
    raise AssertionError("this experiment has no such gap")


@pytest.mark.screen
def test_a_person_judges_adds_and_undoes_and_the_solver_obeys(server, run, tab):
    experiment, out = run
    session = server.session
    known = session.candidates(0)
    row = int(np.argmax(np.where(known.detected, known.probability, 0.0)))
    contact, point = int(known.key[row]), session.picture.canvas.points(known.contacts.point[row])
    gap, between = missed_gap(session, 0)
    asked, failed = [], []
    tab.on("request", lambda request: asked.append(request.url))
    tab.on("requestfailed", lambda request: failed.append(request.url))
    open_with_picture(tab, server.address)
    assert "token" not in tab.url
    tab.evaluate("document.getElementById('viewer').focus()")
    tab.keyboard.press("w")  # the whole packing
    tab.evaluate("review.busy.then(() => null)")
    wait_until_still(tab)

    place = on_screen(tab, session, point)
    act(tab, lambda: tab.mouse.click(*place))
    assert tab.evaluate("review.pair.key") == str(contact)
    assert colour_near(tab, place, PINK) == 0
    press(tab, "n")
    wait_for_colour(tab, place, PINK, **MARKED)

    place = on_screen(tab, session, between)
    act(tab, lambda: tab.mouse.click(*place))
    assert tab.evaluate("review.pair.key") == str(gap)
    assert tab.evaluate("review.pair.verdict") == "contact"
    wait_for_colour(tab, place, GREEN, **MARKED)

    press(tab, "z")
    assert tab.evaluate("review.pair.verdict") is None
    press(tab, "c")  # after all
    press(tab, "u")
    press(tab, "z")
    outside = [url for url in asked if url.startswith("http") and "127.0.0.1" not in url]
    assert not set(outside) - set(failed), outside
    told = lines(out)
    assert [line.get("verdict", "undo") for line in told] == [
        "no contact", "contact", "undo", "contact", "unsure", "undo",
    ]  # fmt: skip
    assert told[1]["origin"] == "added"
    assert all(line["reviewer"] == "anna" for line in told)
    assert rodsight("solve", str(experiment), "--out", str(out), "--quiet", "--set", "solver.sweeps=50") == 0
    frame = load_results(out / "results.h5").frames[0]
    at = {int(key): place for place, key in enumerate(frame.contacts.key)}
    assert frame.fn[at[contact]] == 0.0
    assert frame.source[at[contact]] == ContactSource.FORBIDDEN_BY_REVIEWER
    assert frame.source[at[gap]] == ContactSource.ADDED_BY_REVIEWER


@pytest.mark.screen
def test_everything_works_without_a_mouse_or_a_picture(server, run, tab):
    """A browser that cannot draw WebGL: the crop and the keys are enough."""
    tab.add_init_script(NO_PICTURE)
    open_page(tab, server.address)
    expect(tab.locator("#loading")).to_contain_text("goes on with the crop")
    assert tab.evaluate("document.getElementById('cropped').naturalWidth") > 0
    for key in "cnu":
        press(tab, key)
    first = tab.evaluate("review.frame")
    press(tab, "]")
    assert tab.evaluate("review.frame") == first + 1
    tab.keyboard.press("r")
    expect(tab.locator("#rearrangement")).to_have_attribute("aria-pressed", "true")
    press(tab, "b")
    expect(tab.locator("#detector")).to_be_empty()
    assert tab.evaluate("getComputedStyle(document.getElementById('estimate')).display") == "none"
    press(tab, " ")
    press(tab, "m")
    assert tab.evaluate("review.sampled") is True
    a, b = server.session.bodies.grains[:2]
    tab.keyboard.press("g")
    tab.keyboard.insert_text(f"{a} {b}")
    press(tab, "Enter")
    assert tab.evaluate("[review.pair.a, review.pair.b]") == [a, b]
    told = lines(run[1])
    assert [line.get("verdict") or line["flag"] for line in told] == [
        "contact",
        "no contact",
        "unsure",
        "rearrangement",
    ]


@pytest.mark.screen
def test_names_from_the_experiment_stay_text(server, tab):
    """A wall called like a script is shown, not run."""
    session = server.session
    name = "<img src=x onerror='globalThis.hacked = 1'>"
    session.bodies = Bodies(session.bodies.grains, tuple(f"{name}{w}" for w in session.bodies.walls))
    session._rows = session.bodies.rows()
    tab.add_init_script(NO_PICTURE)
    open_page(tab, server.address)
    for _ in range(session.candidates(0).count):
        if tab.evaluate("typeof review.pair.b") == "string":
            break
        press(tab, " ")
    assert name in tab.locator("#bodies").text_content()
    assert tab.locator("#pair img").count() == 0
    assert tab.evaluate("globalThis.hacked") is None


@pytest.mark.slow
def test_a_hundred_doubtful_contacts_by_keyboard_in_four_minutes(server, run, tab):
    seconds = []
    open_with_picture(tab, server.address)
    tab.keyboard.press("m")
    tab.evaluate("review.busy.then(() => null)")
    for number in range(100):
        if tab.evaluate("review.pair === null"):
            break
        begun = time.monotonic()
        press(tab, "cn"[number % 2])
        tab.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))).then(() => null)")
        seconds.append(time.monotonic() - begun)
    print(
        f"{len(seconds)} verdicts: {sum(seconds):.1f} s, median {np.median(seconds):.2f} s, worst {max(seconds):.2f} s"
    )
    assert len(seconds) == 100
    assert sum(seconds) < 240.0
