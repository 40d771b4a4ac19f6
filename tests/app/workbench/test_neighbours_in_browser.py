"""Two windows on one experiment, a machine that is slow, a hostile page in the next tab: in a real Chromium."""

import functools
import http.server
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect
from rodsight.experiment.reading.tables import read_table
from rodsight.workbench.setup.draft import Draft
from rodsight.workbench.setup.edits import GRAIN_COLUMNS

from tests.app.workbench.hand import fill, go, idle, on_screen, opened

pytestmark = pytest.mark.screen
DELAY = 1.0  # [s] that a slow machine takes for a request


def enter(tab: Page, step: str) -> None:
    tab.locator(".tile").first.click()
    idle(tab)
    go(tab, step)


def rods(tab: Page) -> list[int]:
    return tab.evaluate("workbench.project.rods.id")


def written(root: Path) -> list[int]:
    return read_table(root / "my photographs" / "grains.csv", GRAIN_COLUMNS).integers("id").tolist()


def choose(tab: Page, row: int) -> None:
    place = tab.evaluate(f"[workbench.project.rods.x[{row}], workbench.project.rods.y[{row}]]")
    tab.mouse.click(*on_screen(tab, tuple(place)))


def test_two_windows_show_the_same_and_lose_no_edit(page: Page, begun: Path):
    with opened(page, begun) as first:
        second = first.context.new_page()
        second.set_viewport_size({"width": 1280, "height": 720})
        second.goto(first.url)
        idle(second)
        for tab in (first, second):
            enter(tab, "rods")
        choose(first, 3)
        first.keyboard.press("Delete")
        second.wait_for_function("() => workbench.project.rods.id.length === 29")
        assert rods(second) == written(begun)
        for tab, row in ((first, 5), (second, 6)):  # both at once: neither knows of the other's
            choose(tab, row)
        gone = {rods(first)[5], rods(first)[6]}
        for tab in (first, second):
            tab.evaluate("dispatchEvent(new KeyboardEvent('keydown', { key: 'Delete' }))")
        for tab in (first, second):
            tab.wait_for_function("() => workbench.project.rods.id.length === 27")
        assert rods(first) == rods(second) == written(begun)
        assert not gone & set(written(begun))
        second.keyboard.press("Control+z")  # the last edit is taken back, whoever made it
        for tab in (first, second):
            tab.wait_for_function("() => workbench.project.rods.id.length === 28")


@pytest.mark.slow
def test_what_is_typed_is_not_lost_to_another_window(page: Page, begun: Path):
    with opened(page, begun) as tab:
        enter(tab, "photographs")
        tab.locator("#field-interval").press_sequentially("5")
        Draft(begun / "my photographs").set_keys("elsewhere", {"photographs.channel": "red"})
        tab.wait_for_function("(looks) => workbench.looks > looks + 1", arg=tab.evaluate("workbench.looks"))
        assert tab.input_value("#field-interval") == "530"
        tab.keyboard.press("Enter")
        idle(tab)
        tab.locator("#canvas").focus()
        tab.wait_for_function("() => workbench.project.photographs.channel === 'red'")
        assert str(tab.evaluate("workbench.project.photographs.interval")) == "530"


@pytest.fixture
def slow(page: Page) -> list[str]:
    """Every request takes a second; returns the names of the endpoints."""
    requested: list[str] = []

    def late(route: Route) -> None:
        requested.append(route.request.url.rsplit("/", 1)[-1])
        time.sleep(DELAY)
        route.continue_()

    page.route("**/api/**", late)
    return requested


@pytest.mark.slow
def test_on_a_slow_machine_nothing_is_done_twice_and_no_press_is_lost(page: Page, begun: Path, slow: list[str]):
    with opened(page, begun) as tab:
        enter(tab, "rods")
        before, x = rods(tab), tab.evaluate("workbench.project.rods.x[4]")
        choose(tab, 4)
        for _ in range(3):  # quicker than the answers
            tab.keyboard.press("Shift+ArrowRight")
        expect(tab.locator("#busy")).to_be_visible()  # it shows that it is busy
        idle(tab)
        assert tab.evaluate("workbench.project.rods.x[4]") == pytest.approx(x + 0.75, abs=0.01)
        assert slow.count("move_rod") == 3
        for key in ("Delete", "Delete"):
            tab.keyboard.press(key)
        idle(tab)
        assert sorted(set(before) - set(written(begun))) == [before[4]]
        go(tab, "run")
        for key in ("scale", "material"):
            go(tab, key)
        tab.get_by_role("button", name="brass").dblclick()
        idle(tab)
        assert slow.count("set_material") == 1
        fill(tab, "density", "8400")
        assert tab.evaluate("workbench.project.material.density") == 8400.0


HOSTILE = """<!doctype html><script>
const target = new URLSearchParams(location.search).get("target"), got = {};
const tried = async (name, work) => { try { got[name] = await work(); } catch { got[name] = "refused"; } };
const element = (tag, values) => new Promise((done) => {
  const one = Object.assign(document.createElement(tag), values);
  one.onload = () => done("loaded"); one.onerror = () => done("refused");
  document.body.append(one); setTimeout(() => done("silent"), 3000);
});
addEventListener("load", async () => {
  const body = JSON.stringify({ at: "my photographs", interval: 666 }), where = `${target}/api/set_photographs`;
  for (const type of ["text/plain", "application/json"]) for (const mode of ["no-cors", "cors"])
    await tried(`${type} ${mode}`, async () => (await fetch(where, { method: "POST", mode, credentials: "include", headers: { "Content-Type": type }, body })).status || "opaque");
  await tried("read", async () => (await fetch(`${target}/page/app.js`, { credentials: "include" })).text());
  got.picture = await element("img", { src: `${target}/photograph?at=my+photographs&frame=0` });
  got.script = await element("script", { src: `${target}/page/dom.js` });
  const inner = document.createElement("iframe"); inner.src = target; document.body.append(inner);
  const form = Object.assign(document.createElement("form"), { method: "POST", action: where, target: "sink", enctype: "text/plain" });
  form.append(Object.assign(document.createElement("input"), { name: body.slice(0, -1) + ', "x": "', value: '"}' }));
  document.body.append(form, Object.assign(document.createElement("iframe"), { name: "sink" })); form.submit();
  setTimeout(() => { got.framed = inner.contentDocument === null; globalThis.got = got; }, 1500);
});
</script><body></body>"""  # noqa: E501  a page


@contextmanager
def served(folder: Path) -> Iterator[int]:
    """Somebody else's server on this machine."""
    handler = functools.partial(Silent, directory=str(folder))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server.server_address[1]
    server.shutdown()
    server.server_close()


class Silent(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format: str, *_: object) -> None:
        pass


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_a_hostile_page_in_the_next_tab_reads_and_changes_nothing(page: Page, begun: Path, tmp_path: Path, host: str):
    evil = tmp_path / "evil"
    evil.mkdir()
    (evil / "page.html").write_text(HOSTILE)
    file = begun / "my photographs" / "experiment.toml"
    before = file.read_bytes()
    with opened(page, begun) as tab, served(evil) as port:
        enter(tab, "rods")
        requested = []
        other = tab.context.new_page()  # the same browser: it has the workbench's cookie
        other.on("response", lambda answer: requested.append((answer.status, answer.request.method, answer.url)))
        origin = tab.evaluate("location.origin")
        other.goto(f"http://{host}:{port}/page.html?target={origin}")
        other.wait_for_function("() => globalThis.got")
        got = other.evaluate("got")
        assert got["picture"] == got["script"] == got["read"] == "refused", got
        assert {got[f"{kind} cors"] for kind in ("text/plain", "application/json")} == {"refused"}
        assert got["framed"]
        posted = [status for status, method, url in requested if method == "POST" and url.startswith(origin)]
        assert posted
        assert set(posted) == {403}  # forms and requests arrived, and were refused
        assert file.read_bytes() == before
        assert len(rods(tab)) == 30
