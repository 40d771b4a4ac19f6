"""The review in a real headless Chromium."""

import json
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from rodsight.results.hdf5.store import load_results
from rodsight.reviewing.judging.picking import NEAR, WIDEST_GAP, pairs_within
from rodsight.reviewing.session import ReviewSession
from rodsight.solver.bodies.grains import Array
from rodsight.solver.contacts.contacts import ContactSource
from rodsight.verdicts.decisions import BodyNames
from rodsight.verdicts.log import VERDICTS

from tests.browser import LIKE, POLLING
from tests.program import rodsight

from .conftest import review_server, session_of

WIDTH, HEIGHT = 1280, 800
PINK, GREEN = (255, 84, 130), (40, 224, 150)  # of the marks of verdicts
WHITE = (255, 255, 255)
LEAST, REACH = 20, 14  # pixels of a mark that is drawn, and [px] around its place


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
def solved_tracks(made_tracks: Path, tmp_path: Path) -> Path:
    """The folder of a run whose experiment has no photographs."""
    out = tmp_path / "tracks run"
    assert rodsight("solve", str(made_tracks), "--out", str(out), "--quiet", "--set", "solver.sweeps=20") == 0
    return out


@pytest.fixture
def server(run):
    with review_server(run[1]) as server:
        yield server


@pytest.fixture
def tab(page: Page) -> Page:
    """A page as wide as a reviewer's."""
    page.set_viewport_size({"width": WIDTH, "height": HEIGHT})
    return page


def open_page(tab: Page, address: str) -> None:
    tab.goto(address)
    wait_for_pair(tab)


def wait_for_pair(tab: Page) -> None:
    tab.wait_for_function("() => globalThis.review && review.presented > 0")
    tab.evaluate("workbench.busy.then(() => null)")


def act(tab: Page, step: Callable[[], object]) -> None:
    """Do something and wait until the page shows the next pair."""
    before = tab.evaluate("review.presented")
    step()
    tab.wait_for_function("(before) => review.presented > before", arg=before)
    tab.evaluate("workbench.busy.then(() => null)")


def press(tab: Page, key: str) -> None:
    act(tab, lambda: tab.keyboard.press(key))


def on_screen(tab: Page, point: Array) -> tuple[float, float]:
    """Place on the page of a pixel of the photograph."""
    x, y = tab.evaluate(
        """(p) => { const box = workbench.stage.canvas.getBoundingClientRect(), s = workbench.stage.toScreen(p);
        return [s[0] + box.left, s[1] + box.top]; }""",
        [float(each) for each in point],
    )
    return x, y


COUNT = """([x, y, reach, colour, like]) => {
  const canvas = workbench.stage.composed(), box = workbench.stage.canvas.getBoundingClientRect();
  const dense = canvas.width / box.width;
  const [left, top] = [x - box.left - reach, y - box.top - reach].map((each) => Math.round(each * dense));
  const { data } = canvas.getContext("2d").getImageData(left, top, 2 * reach * dense, 2 * reach * dense);
  let found = 0;
  for (let k = 0; k < data.length; k += 4) found += colour.every((value, n) => Math.abs(value - data[k + n]) < like);
  return found;
}"""  # pixels of about a colour around a place of the page


def colour_near(tab: Page, place: tuple[float, float], colour: tuple[int, int, int]) -> int:
    return int(tab.evaluate(COUNT, [*place, REACH, list(colour), LIKE]))


def wait_for_colour(tab: Page, place: tuple[float, float], colour: tuple[int, int, int]) -> None:
    tab.wait_for_function(
        f"(given) => ({COUNT})(given) >= {LEAST}", arg=[*place, REACH, list(colour), LIKE], polling=POLLING
    )


def lines(out):
    return [json.loads(line) for line in (out / VERDICTS).read_text().splitlines()]


def missed_gap(session: ReviewSession, frame: int) -> tuple[list[int], Array]:
    """Names of two neighbours that are no candidate pair, far from every candidate pair; and their gap [px]."""
    mean = float(session.results.grains.radius.mean())
    pairs = pairs_within(session.results, frame, WIDEST_GAP * mean)
    known = session.candidates(frame)
    for row in np.argsort(-pairs.gap):
        distance = np.linalg.norm(known.contacts.point - pairs.point[row], axis=1)
        if pairs.key[row] not in known.key and distance.min() > 1.3 * NEAR * mean:
            names = [session.bodies.name(int(each[row])) for each in (pairs.i, pairs.j)]
            return names, session.scale.to_pixels(pairs.point[row])
    raise AssertionError("this experiment has no such gap")


@pytest.mark.screen
def test_a_person_judges_adds_and_undoes_and_the_solver_applies_it(server, run, tab):
    experiment, out = run
    session = session_of(server)
    known = session.candidates(0)
    row = int(np.argmax(np.where(known.detected, known.probability, 0.0)))
    contact, point = int(known.key[row]), session.scale.to_pixels(known.contacts.point[row])
    names = [session.bodies.name(int(each[row])) for each in (known.contacts.i, known.contacts.j)]
    gap, between = missed_gap(session, 0)
    requested, failed = [], []
    tab.on("request", lambda request: requested.append(request.url))
    tab.on("requestfailed", lambda request: failed.append(request.url))
    open_page(tab, server.address)
    assert "token" not in tab.url
    tab.keyboard.press("w")  # the whole photograph
    place = on_screen(tab, point)
    act(tab, lambda: tab.mouse.click(*place))
    assert tab.evaluate("[review.pair.i, review.pair.j]") == names
    assert colour_near(tab, place, PINK) == 0
    press(tab, "n")
    wait_for_colour(tab, place, PINK)

    place = on_screen(tab, between)
    act(tab, lambda: tab.mouse.click(*place))
    assert tab.evaluate("[review.pair.i, review.pair.j]") == gap
    assert tab.evaluate("review.pair.verdict") == "contact"
    wait_for_colour(tab, place, GREEN)

    press(tab, "z")
    assert tab.evaluate("review.pair.verdict") is None
    press(tab, "c")  # after all
    press(tab, "u")
    press(tab, "Control+z")  # the undo of the page undoes verdicts here
    outside = [url for url in requested if url.startswith("http") and "127.0.0.1" not in url]
    assert not set(outside) - set(failed), outside
    written = lines(out)
    assert [line.get("verdict", "undo") for line in written] == [
        "no contact", "contact", "undo", "contact", "unsure", "undo",
    ]  # fmt: skip
    assert written[1]["origin"] == "added"
    assert all(line["reviewer"] == "anna" for line in written)
    assert rodsight("solve", str(experiment), "--out", str(out), "--quiet", "--set", "solver.sweeps=50") == 0
    frame = load_results(out / "results.h5").frames[0]
    at = {int(key): place for place, key in enumerate(frame.contacts.key)}
    rows = session.bodies.rows()
    assert frame.fn[at[contact]] == 0.0
    assert frame.source[at[contact]] == ContactSource.FORBIDDEN_BY_REVIEWER
    assert frame.source[at[session.bodies.key(*(rows[name] for name in gap))]] == ContactSource.ADDED_BY_REVIEWER
    tab.reload()  # the verdict shows the force before it, and that the run applied it
    wait_for_pair(tab)
    tab.keyboard.press("g")
    tab.keyboard.insert_text(" ".join(str(name) for name in names))
    press(tab, "Enter")
    expect(tab.locator("#before-after")).to_contain_text("applied by the run")


@pytest.mark.screen
def test_everything_works_without_a_mouse(server, run, tab):
    open_page(tab, server.address)
    assert tab.evaluate("document.getElementById('cropped').naturalWidth") > 0
    for key in "c2u":
        press(tab, key)
    first = tab.evaluate("workbench.frame")
    press(tab, "]")
    assert tab.evaluate("workbench.frame") == first + 1
    tab.keyboard.press("r")
    expect(tab.locator("#rearrangement")).to_have_attribute("aria-pressed", "true")
    press(tab, "b")
    expect(tab.locator("#detector")).to_be_empty()
    expect(tab.locator("#estimate")).to_have_count(0)
    expect(tab.locator("#agreement")).to_have_count(0)
    low = tab.evaluate("document.querySelector('#contact').getBoundingClientRect().bottom")
    assert low < 640.0  # the verdicts are visible on a small screen
    press(tab, " ")
    here = tab.evaluate("[review.pair.i, review.pair.j]")
    press(tab, "ArrowRight")
    press(tab, "ArrowLeft")
    assert tab.evaluate("[review.pair.i, review.pair.j]") == here
    for order in ("frame", "sample"):
        press(tab, "m")
        expect(tab.locator(f"#order-{order}")).to_have_attribute("aria-pressed", "true")
    a, b = session_of(server).bodies.grains[:2]
    tab.keyboard.press("g")
    tab.keyboard.insert_text(f"{a} {b}")
    press(tab, "Enter")
    assert tab.evaluate("[review.pair.i, review.pair.j]") == [a, b]
    zoom, outlined = tab.evaluate("[review.zoom, review.outlines]")
    for key in ("+", "o"):
        tab.keyboard.press(key)
    assert tab.evaluate("[review.zoom, review.outlines]") == [zoom + 1, not outlined]
    assert [line.get("verdict") or line["flag"] for line in lines(run[1])] == [
        "contact", "no contact", "unsure", "rearrangement",
    ]  # fmt: skip


@pytest.mark.screen
def test_the_order_of_influence_is_no_random_sample(server, run, tab):
    """Verdicts by influence are known, those in random order also estimate the accuracy of the detector."""
    open_page(tab, server.address)
    press(tab, "c")
    expect(tab.locator("#precision-text")).to_have_text("not known yet")
    press(tab, "m")
    press(tab, "c")
    expect(tab.locator("#precision-text")).to_contain_text("%")
    assert [line["origin"] for line in lines(run[1])] == ["click", "queue"]


@pytest.mark.screen
def test_reviewers_are_compared_and_disputes_are_listed(server, run, tab):
    open_page(tab, server.address)
    for key in ("c", "c", "n"):
        press(tab, key)
    tab.fill("#reviewer", "ben")
    act(tab, lambda: tab.keyboard.press("Enter"))
    for key in ("n", "c", "n"):
        press(tab, key)
    tab.locator("#agreement summary").click()
    expect(tab.locator("#disputed button")).to_have_count(1)
    expect(tab.locator("#disputed button")).to_contain_text("anna: contact")
    expect(tab.locator("#disputed button")).to_contain_text("ben: no contact")
    expect(tab.locator("#threshold")).to_contain_text("µm")
    act(tab, lambda: tab.locator("#disputed button").click())
    assert tab.evaluate("review.pair.verdict") == "no contact"


@pytest.mark.screen
def test_a_run_of_tracks_alone_is_drawn_on_a_plain_ground(solved_tracks, tab):
    with review_server(solved_tracks) as server:
        open_page(tab, server.address)
        assert tab.evaluate("document.getElementById('cropped').getAttribute('src')") is None
        assert tab.locator("#outlines circle").count() > 0
        tab.keyboard.press("w")
        point = tab.evaluate("review.pair.point")
        x, y = on_screen(tab, point)
        assert colour_near(tab, (x, y), WHITE) > 0
        press(tab, "]")
        assert tab.evaluate("workbench.frame") == 1
        press(tab, "c")
    assert lines(solved_tracks)[0]["frame"] == 1


@pytest.mark.screen
def test_names_from_the_experiment_stay_text(server, tab):
    """A wall whose name is a script is shown as text."""
    session = session_of(server)
    name = "<img src=x onerror='globalThis.hacked = 1'>"
    session.bodies = BodyNames(session.bodies.grains, tuple(f"{name}{w}" for w in session.bodies.walls))
    session._rows = session.bodies.rows()
    open_page(tab, server.address)
    for _ in range(session.candidates(0).count):
        if tab.evaluate("typeof review.pair.j") == "string":
            break
        press(tab, " ")
    assert name in tab.locator("#bodies").text_content()
    assert tab.locator("#pair img").count() == 0
    assert tab.evaluate("globalThis.hacked") is None


@pytest.mark.slow
def test_a_hundred_pairs_by_keyboard_in_four_minutes(server, run, tab):
    seconds = []
    open_page(tab, server.address)
    press(tab, "m")
    press(tab, "m")  # the sample of all frames
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
