"""The page in a real headless Chromium."""

import json
import shutil
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from rodsight.cli.main import main
from rodsight.results.store import load_results
from rodsight.review.command import open_reviewed, open_session
from rodsight.review.server import ReviewServer
from rodsight.verdicts.decisions import Bodies
from rodsight.verdicts.log import VERDICTS

from solver.contacts.contacts import ContactSource
from tests.app.review.browser import chromium, open_browser

pytest.importorskip("websockets", reason="websockets, which drives chromium, is not installed")
pytestmark = pytest.mark.skipif(chromium() is None, reason="chromium is not installed")

WIDTH, HEIGHT = 1280, 800
NO_PICTURE = "HTMLCanvasElement.prototype.getContext = () => null;"  # a browser that cannot draw WebGL
SECONDS = 90.0  # for a picture drawn in software on a busy machine


def rodsight(*arguments: str) -> int:
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    return int(stop.value.code or 0)


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


def ready(tab, address):
    tab.open(address)
    tab.wait("globalThis.review && review.drawn > 0", SECONDS)
    tab.wait("review.viewer && document.getElementById('loading').hidden", SECONDS)


def act(tab, step, seconds=SECONDS):
    """Do something and wait until the page has put the outcome before the reviewer."""
    before = tab.run("review.drawn")
    step()
    tab.wait(f"review.drawn > {before}", seconds)
    tab.run("review.busy.then(() => null)")


def on_screen(tab, session, point):
    """Where a point of the picture [px] lies on the page, with the whole packing in view."""
    canvas = session.picture.canvas
    width, height = tab.run("document.getElementById('stage').clientWidth"), HEIGHT
    scale = min(width / canvas.width, height / canvas.height)  # the view keeps the picture's proportions
    middle = np.array([canvas.left + 0.5 * canvas.width, canvas.top + 0.5 * canvas.height])
    return np.array([0.5 * width, 0.5 * height]) + scale * (np.asarray(point) - middle)


def colour_near(tab, place, colour, reach=14):
    """How many pixels around a place of the page have about a colour."""
    import cv2

    picture = cv2.imdecode(np.frombuffer(tab.picture(), np.uint8), cv2.IMREAD_COLOR)
    x, y = (round(v) for v in place)
    part = picture[max(y - reach, 0) : y + reach, max(x - reach, 0) : x + reach, ::-1].astype(int)
    return int((np.abs(part - np.array(colour)).max(axis=2) < 50).sum())


def lines(out):
    return [json.loads(line) for line in (out / VERDICTS).read_text().splitlines()]


def missed_gap(session, frame):
    """Two neighbours that are no candidate, close enough for a click, far from every candidate."""
    from rodsight.review.picking import NEAR, WIDEST_GAP, near_pairs

    mean = float(session.results.grains.radius.mean())
    pairs = near_pairs(session.results, frame, WIDEST_GAP * mean)
    known = session.candidates(frame)
    for row in np.argsort(-pairs.gap):
        distance = np.linalg.norm(known.contacts.point - pairs.point[row], axis=1)
        if pairs.key[row] not in known.key and distance.min() > 1.3 * NEAR * mean:
            return int(pairs.key[row]), session.picture.canvas.points(pairs.point[row])
    raise AssertionError("this experiment has no such gap")


def test_a_person_judges_adds_and_undoes_and_the_solver_obeys(server, run):
    experiment, out = run
    session = server.session
    known = session.candidates(0)
    row = int(np.argmax(np.where(known.detected, known.probability, 0.0)))
    contact, point = int(known.key[row]), session.picture.canvas.points(known.contacts.point[row])
    gap, between = missed_gap(session, 0)
    with open_browser(WIDTH, HEIGHT) as tab:
        ready(tab, server.address)
        assert "token" not in tab.run("location.href")
        tab.run("document.getElementById('viewer').focus()")
        tab.key("w")  # the whole packing
        tab.run("review.busy.then(() => null)")
        time.sleep(3)
        place = on_screen(tab, session, point)

        act(tab, lambda: tab.click(*place))
        assert tab.run("review.pair.key") == str(contact)
        pink, green = (255, 84, 130), (40, 224, 150)
        assert colour_near(tab, place, pink) == 0
        act(tab, lambda: tab.key("n"))
        end = time.monotonic() + SECONDS
        while colour_near(tab, place, pink) < 20:  # the mark is drawn
            assert time.monotonic() < end
            time.sleep(0.3)

        place = on_screen(tab, session, between)
        act(tab, lambda: tab.click(*place))
        assert tab.run("review.pair.key") == str(gap)
        assert tab.run("review.pair.verdict") == "contact"
        end = time.monotonic() + SECONDS
        while colour_near(tab, place, green) < 20:
            assert time.monotonic() < end
            time.sleep(0.3)

        act(tab, lambda: tab.key("z"))
        assert tab.run("review.pair.verdict") is None
        act(tab, lambda: tab.key("c"))  # after all
        act(tab, lambda: tab.key("u"))
        act(tab, lambda: tab.key("z"))
        outside = [
            event["params"]["request"]["url"]
            for event in tab.events
            if event["method"] == "Network.requestWillBeSent" and "127.0.0.1" not in event["params"]["request"]["url"]
        ]
        blocked = {e["params"]["requestId"] for e in tab.events if e["method"] == "Network.loadingFailed"}
        assert not [url for url in outside if url not in blocked and url.startswith("http")], outside
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


def test_everything_works_without_a_mouse_or_a_picture(server, run):
    """A browser that cannot draw WebGL: the crop and the keys are enough."""
    with open_browser(WIDTH, HEIGHT) as tab:
        tab.call("Page.addScriptToEvaluateOnNewDocument", source=NO_PICTURE)
        tab.open(server.address)
        tab.wait("globalThis.review && review.drawn > 0", SECONDS)
        tab.wait("document.getElementById('loading').textContent.includes('goes on with the crop')", SECONDS)
        assert tab.run("document.getElementById('cropped').naturalWidth") > 0
        for key in "cnu":
            act(tab, lambda key=key: tab.key(key))
        first = tab.run("review.frame")
        act(tab, lambda: tab.key("]"))
        assert tab.run("review.frame") == first + 1
        tab.key("r")
        tab.wait("document.getElementById('rearrangement').getAttribute('aria-pressed') === 'true'")
        act(tab, lambda: tab.key("b"))
        assert tab.run("document.getElementById('detector').textContent") == ""
        assert tab.run("getComputedStyle(document.getElementById('estimate')).display") == "none"
        act(tab, lambda: tab.key(" "))
        act(tab, lambda: tab.key("m"))
        assert tab.run("review.sampled") is True
        a, b = server.session.bodies.grains[:2]
        tab.key("g")
        tab.call("Input.insertText", text=f"{a} {b}")
        act(tab, lambda: tab.key("Enter"))
        assert tab.run("[review.pair.a, review.pair.b]") == [a, b]
    told = lines(run[1])
    assert [line.get("verdict") or line["flag"] for line in told] == [
        "contact",
        "no contact",
        "unsure",
        "rearrangement",
    ]


def test_names_from_the_experiment_stay_text(server):
    """A wall called like a script is shown, not run."""
    session = server.session
    name = "<img src=x onerror='globalThis.hacked = 1'>"
    session.bodies = Bodies(session.bodies.grains, tuple(f"{name}{w}" for w in session.bodies.walls))
    session._rows = session.bodies.rows()
    with open_browser(WIDTH, HEIGHT) as tab:
        tab.call("Page.addScriptToEvaluateOnNewDocument", source=NO_PICTURE)
        tab.open(server.address)
        tab.wait("globalThis.review && review.drawn > 0", SECONDS)
        for _ in range(session.candidates(0).count):
            if tab.run("typeof review.pair.b") == "string":
                break
            act(tab, lambda: tab.key(" "))
        assert name in tab.run("document.getElementById('bodies').textContent")
        assert tab.run("document.querySelectorAll('#pair img').length") == 0
        assert tab.run("globalThis.hacked") is None


@pytest.mark.slow
def test_a_hundred_doubtful_contacts_by_keyboard_in_four_minutes(server, run):
    seconds = []
    with open_browser(WIDTH, HEIGHT) as tab:
        ready(tab, server.address)
        tab.key("m")
        tab.run("review.busy.then(() => null)")
        for number in range(100):
            if tab.run("review.pair === null"):
                break
            begun = time.monotonic()
            act(tab, lambda number=number: tab.key("cn"[number % 2]))
            tab.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))).then(() => null)")
            seconds.append(time.monotonic() - begun)
    print(
        f"{len(seconds)} verdicts: {sum(seconds):.1f} s, median {np.median(seconds):.2f} s, worst {max(seconds):.2f} s"
    )
    assert len(seconds) == 100
    assert sum(seconds) < 240.0
