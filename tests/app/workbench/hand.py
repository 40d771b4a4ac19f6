"""Actions of a user on the workbench's page."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Page
from rodsight.workbench.service.server import WorkbenchServer
from rodsight.workbench.service.workbench import Workbench


@contextmanager
def opened(page: Page, folder: Path) -> Iterator[Page]:
    """The workbench of a folder in a page; no script of it may fail."""
    server = WorkbenchServer(Workbench(folder))
    thread = threading.Thread(target=server.serve, daemon=True)
    thread.start()
    page.set_viewport_size({"width": 1280, "height": 720})
    wrong: list[str] = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    try:
        page.goto(server.address)
        idle(page)
        yield page
    finally:  # a thread that still computes when the interpreter ends aborts it, and hides why
        server.shutdown()
        thread.join()
        server.close()
    assert wrong == []


def idle(tab: Page) -> None:
    """Wait until the page has finished its actions, and the photograph has its size in the new step."""
    tab.wait_for_function("() => globalThis.workbench && workbench.done > 0")
    tab.evaluate("workbench.busy.then(() => null)")
    tab.evaluate("new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(() => drawn(null))))")


def go(tab: Page, step: str) -> None:
    tab.click(f"#step-{step}")
    idle(tab)


def fill(tab: Page, field: str, text: str) -> None:
    tab.fill(f"#field-{field}", text)
    tab.keyboard.press("Enter")
    idle(tab)


def on_screen(tab: Page, place: tuple[float, float]) -> tuple[float, float]:
    """Where a pixel of the photograph is on the page."""
    x, y = tab.evaluate(
        """(p) => { const box = workbench.stage.canvas.getBoundingClientRect(), s = workbench.stage.toScreen(p);
        return [s[0] + box.left, s[1] + box.top]; }""",
        list(place),
    )
    return x, y


def drag(tab: Page, start: tuple[float, float], end: tuple[float, float]) -> None:
    tab.mouse.move(*on_screen(tab, start))
    tab.mouse.down()
    tab.mouse.move(*on_screen(tab, (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]))))
    tab.mouse.move(*on_screen(tab, end))
    tab.mouse.up()
    idle(tab)
