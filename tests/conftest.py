"""What tests of several rooms share: experiments made once, and a browser."""

from __future__ import annotations

import gc
import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rodsight
from hypothesis import HealthCheck, Phase, settings
from playwright.sync_api import Browser, Page, expect, sync_playwright
from rodsight.synthetic.synthesis import SynthesisSettings, synthesize

from tests.browser import FLAGS, SECONDS, SEEN, find_chromium
from tests.kernels import compile_missing_kernels
from tests.scheduling import rank_of, schedule_by_folder
from tests.shapes import check_shapes
from tests.sharing import made_once

FAST = "not thorough and not slow and not screen"  # the marks of the fast tests, as in pyproject.toml
TWO_PROCESSES = (FAST, "thorough", "not slow and not screen")  # these lanes, and both in one run

check_shapes("rodsight.solver")

# A failure must be the same everywhere: examples are drawn without chance, and a slow machine is no failure.
settings.register_profile(
    "rodsight", max_examples=25, deadline=None, derandomize=True, database=None,
    suppress_health_check=[HealthCheck.too_slow],
)  # fmt: skip
# A mutant need only be noticed: the smallest example of it is not needed.
settings.register_profile("mutants", settings.get_profile("rodsight"), phases=[Phase.explicit, Phase.generate])
settings.load_profile("rodsight")


@pytest.fixture(scope="session", autouse=True)
def signals_reach_children() -> None:
    """Children answer signals even where the tests were begun with these ignored: in the background, under nohup."""
    for number in (signal.SIGINT, signal.SIGHUP):
        if signal.getsignal(number) == signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)


@pytest.fixture(scope="session")
def made_tracks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small tracked experiment with truth; not to be written to."""
    settings = SynthesisSettings(grains=40, frames=5, photographs=False, noise=1e-5, seed=1)
    return made_once(tmp_path_factory, "tracked", lambda folder: synthesize(folder, settings))


@pytest.fixture(scope="session")
def without_sensors(made_tracks: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same without recorded forces on walls, which a call with arrays does not have; not to be written to."""
    folder = Path(shutil.copytree(made_tracks, tmp_path_factory.mktemp("tracked") / "without_sensors"))
    config = folder / "experiment.toml"
    config.write_text(config.read_text().replace('forces = "wall_forces.csv"\n', ""))
    return folder


@pytest.fixture(scope="session")
def examples(made_tracks: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the examples of docstrings and pages work: an experiment my_test and its run, runs/shear."""
    folder = tmp_path_factory.mktemp("examples")
    shutil.copytree(made_tracks, folder / "my_test")
    config = folder / "my_test/experiment.toml"
    config.write_text(config.read_text().replace('"tracked"', '"my_test"'))
    rodsight.run(folder / "my_test", out=folder / "runs/shear", settings={"solver.sweeps": 50})
    return folder


@pytest.fixture
def tracked(made_tracks: Path, tmp_path: Path) -> Path:
    """A copy of the small tracked experiment, to be spoiled at will."""
    return Path(shutil.copytree(made_tracks, tmp_path / "tracked", ignore=shutil.ignore_patterns(".rodsight")))


@pytest.fixture(scope="session")
def made_photographs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small photographed experiment with truth; not to be written to."""
    settings = SynthesisSettings(grains=30, frames=4, seed=2)
    return made_once(tmp_path_factory, "photographed", lambda folder: synthesize(folder, settings))


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """A browser without a screen; pages of different tests know nothing of each other."""
    chromium = find_chromium()
    folder = str(tmp_path_factory.mktemp("browser"))  # for all that it and its driver write
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", folder)
        patch.setenv("HOME", folder)
        with sync_playwright() as driver:
            started = driver.chromium.launch(executable_path=chromium, args=FLAGS, chromium_sandbox=False)
            expect.set_options(timeout=1e3 * SECONDS)
            yield started
            started.close()


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A page of its own, which waits long enough for pictures drawn in software."""
    context = browser.new_context(viewport={"width": 1000, "height": 700}, color_scheme="dark")
    context.set_default_timeout(1e3 * SECONDS)
    context.add_init_script(SEEN)
    yield context.new_page()
    context.close()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Run tests with a browser last: its driver keeps an event loop in this thread until the end."""
    if config.option.markexpr == "thorough":  # tests of a thorough file with a lane of their own belong to that one
        others = {each for each in items if any(map(each.get_closest_marker, ("slow", "screen")))}
        items[:] = [each for each in items if each not in others]
        config.hook.pytest_deselected(items=list(others))
    items.sort(key=lambda item: ("browser" in getattr(item, "fixturenames", ()), rank_of(item.nodeid)))


def pytest_collection_finish() -> None:
    """Leave the tests and all modules that they import out of later searches for unreachable objects: they stay."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Run the whole fast or thorough lane in two processes; chosen tests, other lanes and benchmarks in this one."""
    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS and not config.option.benchmark_only
    return min(2, os.cpu_count() or 1) if whole and config.option.markexpr in TWO_PROCESSES else 0


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes() -> None:
    """Compile missing kernels once, before the processes of the tests would each compile them."""
    compile_missing_kernels()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    return schedule_by_folder(config, log)
