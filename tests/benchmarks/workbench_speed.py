"""Processor time of the page and memory of its server with 5 250 rods (the sample) and 20 megapixels.

    python -m tests.benchmarks.workbench_speed EXPERIMENT RUN [--folder DIR]     # of 250 rods or more, finished

The run is tiled (tests/benchmarks/tiled_results.py). Every event is one that a user's hand causes; the page's processor
time is that of its main thread, of all browser processes together where stated. Clock times depend on other work.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import CDPSession, Page, sync_playwright

from tests.app.workbench.hand import idle
from tests.benchmarks.tiled_results import tile_run
from tests.browser import find_chromium

FLAGS = ("--disable-gpu", "--disable-dev-shm-usage")  # drawn by the processor, as on a machine without a graphics card
EVENTS = 30
AIMS = {"pan": 0.03, "zoom": 0.03, "next": 0.3, "server": 600.0}
SIZE = {"width": 1920, "height": 1080}
EVENT_LOOP = """async ([values, count]) => {
    const canvas = document.getElementById("canvas"), box = canvas.getBoundingClientRect();
    const event = new Function("k", `return ${values}`);
    for (let k = 0; k < count; k += 1) {
        const place = { clientX: box.left + box.width / 2, clientY: box.top + box.height / 2, cancelable: true };
        canvas.dispatchEvent(new WheelEvent("wheel", { ...place, ...event(k) }));
        await new Promise((drawn) => requestAnimationFrame(() => drawn(null)));
    }
}"""
LAYERS = """async (names) => {
    const { layers, resetLayers, setLayer } = await import("/page/layers/settings.js");
    resetLayers();
    for (const name of names) setLayer(name, { on: true });
    workbench.stage.redraw();
}"""


@contextmanager
def served(folder: Path) -> Iterator[tuple[str, int]]:
    """A workbench in a process of its own: its address and process."""
    work = [sys.executable, "-c", SERVER, str(folder)]
    with subprocess.Popen(work, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[2]) as server:
        assert server.stdout is not None
        try:
            yield server.stdout.readline().strip(), server.pid
        finally:
            server.terminate()


SERVER = """
import sys
from pathlib import Path
from rodsight.workbench.service.server import WorkbenchServer
from rodsight.workbench.service.workbench import Workbench
server = WorkbenchServer(Workbench(Path(sys.argv[1])))
print(server.address, flush=True)
server.serve()
"""


def memory(process: int, name: str = "VmRSS") -> float:
    """Memory of a process [MB]."""
    for line in Path(f"/proc/{process}/status").read_text(encoding="ascii").splitlines():
        if line.startswith(f"{name}:"):
            return int(line.split()[1]) / 1024
    raise ValueError(f"no {name}")


def browser_seconds() -> float:
    """Processor time of all processes that this one has started [s], the server's excepted by the caller."""
    ticks, found = os.sysconf("SC_CLK_TCK"), 0.0
    children = {os.getpid()}
    table = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parts = (entry / "stat").read_text(encoding="utf-8", errors="replace").rsplit(")", 1)[1].split()
            except OSError:  # it has ended
                continue
            table[int(entry.name)] = int(parts[1]), (int(parts[11]) + int(parts[12])) / ticks
    for _ in range(6):
        children |= {process for process, (parent, _) in table.items() if parent in children}
    for process in children - {os.getpid()}:
        name = Path(f"/proc/{process}/comm")
        found += table[process][1] if name.exists() and "chrom" in name.read_text(encoding="utf-8") else 0.0
    return found


class Meter:
    """Processor time per event of a page."""

    def __init__(self, tab: Page, session: CDPSession) -> None:
        self.tab, self.session = tab, session

    def task_seconds(self) -> float:
        metrics = self.session.send("Performance.getMetrics")["metrics"]
        return next(each["value"] for each in metrics if each["name"] == "TaskDuration")

    def measure(self, name: str, script: str, aim: float) -> bool:
        """Let the page perform events one picture apart, then settle; print the time of an event, and of settling."""
        self.settle()
        since = self.task_seconds(), browser_seconds()
        self.tab.evaluate(EVENT_LOOP, [script, EVENTS])
        moved = self.task_seconds(), browser_seconds()
        self.settle()
        page, whole = ((after - before) / EVENTS for before, after in zip(since, moved, strict=True))
        once = self.task_seconds() - moved[0]
        print(f"{name:<40} {1e3 * page:6.1f} ms page {1e3 * whole:6.1f} ms browser, once still {1e3 * once:5.0f} ms  "
              f"aim {1e3 * aim:.0f}{'' if page <= aim else '   MISSED'}", flush=True)  # fmt: skip
        return page <= aim

    def settle(self) -> None:
        idle(self.tab)
        self.tab.wait_for_timeout(400)
        idle(self.tab)


def pan(meter: Meter, name: str) -> bool:
    """Two fingers on a touchpad there and back, then a wheel."""
    met = meter.measure(f"pan, {name}", "{ deltaX: k % 20 < 10 ? 9 : -9, deltaY: k % 20 < 10 ? 5 : -5 }", AIMS["pan"])
    return meter.measure(f"zoom, {name}", "{ deltaY: k % 20 < 10 ? -60 : 60 }", AIMS["zoom"]) and met


def measure(folder: Path, dense: float) -> bool:
    """Measure everything on a screen of so many device pixels per pixel."""
    met = True
    with served(folder) as (address, server), sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=find_chromium(), args=FLAGS, chromium_sandbox=False)
        tab = browser.new_context(color_scheme="dark", device_scale_factor=dense, viewport=SIZE).new_page()
        tab.set_default_timeout(1e5)
        session = tab.context.new_cdp_session(tab)
        session.send("Performance.enable", {"timeDomain": "threadTicks"})
        tab.goto(address)
        idle(tab)
        tab.locator(".tile").first.click()
        idle(tab)
        meter = Meter(tab, session)
        tab.keyboard.press("7")
        tab.wait_for_selector("#colour-by")
        idle(tab)
        print(f"{dense:g} device pixels per pixel, {tab.evaluate('workbench.step.names().length')} rods, "
              f"{tab.evaluate('workbench.project.width * workbench.project.height') / 1e6:.1f} megapixels")  # fmt: skip
        met &= pan(meter, "forces, whole picture")
        tab.evaluate(LAYERS, ["uncertainty", "contacts", "displacement", "strain"])
        met &= pan(meter, "all layers, whole picture")
        tab.evaluate(LAYERS, [])
        tab.evaluate("workbench.stage.zoom(6)")
        met &= pan(meter, "forces, enlarged six times")
        tab.keyboard.press("f")
        met &= next_photograph(meter, server)
        now, peak = memory(server), memory(server, "VmHWM")
        met &= peak <= AIMS["server"]
        print(f"{'server':<44} {now:7.0f} MB now   {peak:7.0f} MB at most   aim {AIMS['server']:.0f}"
              f"{'' if peak <= AIMS['server'] else '   MISSED'}\n", flush=True)  # fmt: skip
        browser.close()
    return met


def next_photograph(meter: Meter, server: int) -> bool:
    """The next photograph with its forces: processor time of page and server, and clock time until it is drawn.

    What follows once the picture is still, a drawing as sharp as the screen and the photographs beside, is printed
    beside it.
    """
    tab, took, clock = meter.tab, [], []
    meter.settle()
    for key in ("ArrowRight", "ArrowRight", "ArrowRight", "ArrowLeft", "ArrowLeft", "ArrowLeft"):
        since = meter.task_seconds(), processor_seconds(server), time.perf_counter()
        tab.keyboard.press(key)
        idle(tab)
        clock.append(time.perf_counter() - since[2])
        drawn = meter.task_seconds(), processor_seconds(server)
        time.sleep(0.6)  # a hand's pause, in which it is drawn sharply, and the neighbours are requested
        meter.settle()
        still = meter.task_seconds(), processor_seconds(server)
        took.append((drawn[0] - since[0], drawn[1] - since[1], still[0] - drawn[0], still[1] - drawn[1]))
    page, serving, later, beside = (1e3 * sorted(each)[len(took) // 2] for each in zip(*took, strict=True))
    median, least = page + serving, 1e3 * min(clock)
    aim = 1e3 * AIMS["next"]
    met = median <= aim
    print(f"{'the next photograph, with its forces':<40} {page:6.0f} ms page, {serving:.0f} ms server, "
          f"{least:.0f} ms least clock, once still {later:.0f} ms page, {beside:.0f} ms server  aim {aim:.0f}"
          f"{'' if met else '   MISSED'}", flush=True)  # fmt: skip
    return met


def processor_seconds(process: int) -> float:
    """Processor time of a process [s]."""
    parts = Path(f"/proc/{process}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    return (int(parts[11]) + int(parts[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.workbench_speed", description=__doc__)
    parser.add_argument("experiment", type=Path)
    parser.add_argument("run", type=Path)
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "rodsight-benchmark-page")
    given = parser.parse_args()
    place = tile_run(given.experiment, given.run, given.folder)
    print(f"{os.cpu_count()} cores, {os.getloadavg()[0]:.1f} processes at work\n")
    results = [measure(place, dense) for dense in (1.0, 2.0)]
    sys.exit(0 if all(results) else 1)
