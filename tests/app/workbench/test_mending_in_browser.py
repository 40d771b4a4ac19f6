"""A rod that tracking took for another is put right by mouse, and the next run obeys."""

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from rodsight import pipeline
from rodsight.experiment.corrections import read_corrections
from rodsight.experiment.experiment import load_experiment
from rodsight.experiment.reading.tables import read_table
from rodsight.experiment.scaling import make_scale
from rodsight.results.hdf5.store import origin_of, save_tracks
from rodsight.run_folder import TRACKS
from rodsight.tracks import TrackStatus
from rodsight.workbench.setup.draft import Draft

from tests.app.workbench.hand import drag, idle, on_screen, opened

pytestmark = pytest.mark.screen
ROD, WRONG, GONE = 7, 2, 3  # a rod, the photograph in which it is taken for another, and the one without it
OTHER = 4  # a rod that is said to be hidden in photograph 1
RIGHT = 0.15  # [px] of a place


@pytest.fixture
def spoiled(made_photographs: Path, tmp_path: Path) -> Path:
    """A folder with an experiment and its tracks, in which a rod is wrong in one photograph and lost in the next."""
    shutil.copytree(made_photographs, tmp_path / "mine")
    Draft(tmp_path / "mine").set_keys("named as the truth names them", {"photographs.grains": "grains.csv"})
    experiment = load_experiment(tmp_path / "mine")
    run = pipeline.Run(experiment, tmp_path / "runs" / experiment.name)
    tracks, walls = pipeline.track(run)
    position, rotation, status = tracks.position.copy(), tracks.rotation.copy(), tracks.status.copy()
    position[WRONG, ROD] += 60.0 * pixel_of(tmp_path)
    status[WRONG, ROD] = TrackStatus.SUSPECT
    position[GONE, ROD], rotation[GONE, ROD], status[GONE, ROD] = np.nan, np.nan, TrackStatus.LOST
    wrong = replace(tracks, position=position, rotation=rotation, status=status)
    origin = origin_of(run.file(TRACKS))
    save_tracks(run.file(TRACKS), experiment.name, wrong, walls, origin)
    run.tell_manifest()
    run.manifest.add(TRACKS, origin.fingerprint)
    return tmp_path


@pytest.fixture
def tab(page: Page, spoiled: Path) -> Iterator[Page]:
    with opened(page, spoiled) as tab:
        yield tab


def pixel_of(root: Path) -> float:
    section = load_experiment(root / "mine").config.photographs
    assert section is not None
    return section.pixel_size


def true_poses(root: Path) -> np.ndarray:
    """Of every photograph and rod (4, 30, 3): x, y [px], angle [rad] of the world."""
    experiment = load_experiment(root / "mine")
    scale = make_scale(experiment.config.photographs, experiment.photographs().shape[0])
    table = read_table(root / "mine" / "truth_tracks.csv", ("frame", "id", "x", "y", "theta"))
    place = scale.to_pixels(np.stack([table.numbers("x"), table.numbers("y")], axis=1))
    return np.column_stack([place, table.numbers("theta")]).reshape(4, -1, 3)


def told(root: Path) -> dict[tuple[int, int], tuple[float, float, float]]:
    read = read_corrections(load_experiment(root / "mine"), None, 4)
    if read is None:
        return {}
    rows = zip(
        read.frame.tolist(), read.id.tolist(), read.x.tolist(), read.y.tolist(), read.theta.tolist(), strict=True
    )
    return {(frame, name): (x, y, theta) for frame, name, x, y, theta in rows}


def test_a_rod_is_dragged_to_its_place_and_the_next_run_obeys(tab, spoiled):
    truth = true_poses(spoiled)
    tab.locator(".tile").first.click()
    idle(tab)
    tab.click("#step-mend")
    expect(tab.locator("#next-doubtful")).to_be_visible()
    tab.keyboard.press("n")
    card = tab.locator("#mending")
    expect(card).to_contain_text(f"Rod {ROD}")
    expect(card).to_contain_text("as the hand put it")  # on another rod nothing correlates
    assert tab.evaluate("bench.frame") == WRONG
    x, y, _ = truth[WRONG, ROD]
    off = 60.0
    tab.keyboard.press("f")
    drag(tab, (x + off, y - off), (x + 3.0, y - 2.0))
    expect(card).to_contain_text("±")
    expect(card.locator(".evidence canvas")).to_have_count(5)
    tab.keyboard.press("Shift+Enter")
    idle(tab)
    found = told(spoiled)
    assert sorted(found) == [(WRONG, ROD), (GONE, ROD)]
    for (frame, name), pose in found.items():
        np.testing.assert_allclose(pose[:2], truth[frame, name, :2], atol=RIGHT)
        assert pose[2] == pytest.approx(truth[frame, name, 2], abs=0.01)
    expect(tab.locator("#waits")).to_contain_text("2 corrections")
    tab.keyboard.press("Control+z")
    idle(tab)
    assert told(spoiled) == {}
    expect(tab.locator("#corrections")).to_have_count(0)
    tab.keyboard.press("Control+Shift+z")
    idle(tab)
    assert told(spoiled) == found
    hide_by_key(tab, truth)
    tracks, _ = pipeline.track(pipeline.Run(load_experiment(spoiled / "mine"), spoiled / "runs" / "photographed"))
    scale_px = tracks.position[[WRONG, GONE], ROD] / pixel_of(spoiled)
    world = np.array([truth[frame, ROD, :2] for frame in (WRONG, GONE)])
    np.testing.assert_allclose(scale_px[:, 0], world[:, 0], atol=RIGHT)
    assert tracks.status[1, OTHER] == TrackStatus.LOST
    tab.reload()
    idle(tab)
    expect(tab.locator("#corrections .sign.good")).to_have_count(3)


def hide_by_key(tab: Page, truth: np.ndarray) -> None:
    tab.evaluate("bench.show(1)")
    idle(tab)
    tab.mouse.click(*on_screen(tab, truth[1, OTHER, :2].tolist()))
    expect(tab.locator("#mending")).to_contain_text(f"Rod {OTHER}")
    tab.keyboard.press("x")
    idle(tab)
