from __future__ import annotations

import cv2
import numpy as np
import pytest
from rodsight.cli.main import main
from rodsight.recording.viewing.headless import HeadlessViewer, NoPictureError, vulkan_drivers
from rodsight.recording.viewing.pictures import PictureSettings, timeline_values, write_film
from rodsight.recording.viewing.plain_window import BUTTONS, ICON, TITLE

from tests.browser import read_picture, warm_fraction

MOST_TABS = 7  # more are not read in a row
needs_vulkan = pytest.mark.skipif(not vulkan_drivers(), reason="no Vulkan driver: apt-get install mesa-vulkan-drivers")


@needs_vulkan
@pytest.mark.slow  # test_viewer.py draws one
def test_pictures_of_tabs_and_views_at_any_time(recording):
    with HeadlessViewer(recording.path, width=900, height=600) as viewer:
        assert viewer.tabs[0] == "Summary"
        assert len(viewer.tabs) <= MOST_TABS
        viewer.set_time("frame", 1)
        network = read_picture(viewer.picture("Force network"))
        assert 0.01 < warm_fraction(network) < 0.5
        assert viewer.picture("Force network") == viewer.picture("Force network")
        # The first sweep of a frame has less force than the reported field.
        viewer.set_time("sweep", 61)
        assert warm_fraction(read_picture(viewer.picture("Force network"))) < 0.8 * warm_fraction(network)
        anisotropies = read_picture(viewer.picture("Anisotropies"))  # of another tab
        assert np.ptp(anisotropies) > 100
        assert viewer.warnings() == []
        with pytest.raises(NoPictureError, match="no view 'Nothing'"):
            viewer.picture("Nothing")


@needs_vulkan
@pytest.mark.slow  # as the pictures of tabs and views, but for the menus
def test_a_plain_picture_of_a_tab_has_no_menus_and_no_buttons(recording):
    size = (900, 600)
    with HeadlessViewer(recording.path, width=size[0], height=size[1], plain=True) as viewer:
        viewer.show_tab("Forces")
        viewer.set_time("frame", 1)
        picture = read_picture(viewer.picture()).astype(int)
        assert picture.shape[:2] == size[::-1]
        saturated = np.ptp(picture, axis=2) > 60
        assert saturated.mean() > 0.005  # the forces are drawn
        assert not saturated[:TITLE].any()  # orange warnings of the viewer stand in its uppermost row
        left = int(size[0] * 1.25 / 2.25)
        for end in (left, size[0]):
            assert np.ptp(picture[2 : TITLE - 2, end - BUTTONS + 2 : end - 4]) < 12  # buttons in titles are erased
        assert np.ptp(picture[:TITLE, ICON:200]) > 100  # the title itself is there
        viewer.show_tab("Fringes")  # behind the forces
        assert warm_fraction(read_picture(viewer.picture())) > 0.05
        viewer.show_tab("Rods in space")  # of a nested row of tabs
        assert warm_fraction(read_picture(viewer.picture())) > 0.005


@needs_vulkan
@pytest.mark.slow
def test_a_film_has_one_picture_for_every_frame(recording, tmp_path):
    size = write_film(
        recording.path, tmp_path / "run.mp4", range(4), PictureSettings(view="Force network", size=(640, 480))
    )
    assert (tmp_path / "run.mp4").stat().st_size == size
    film = cv2.VideoCapture(str(tmp_path / "run.mp4"))
    pictures = []
    while (step := film.read())[0]:
        pictures.append(step[1])
    assert len(pictures) == 4
    assert all(warm_fraction(each[..., ::-1]) > 0.005 for each in pictures)
    assert np.abs(pictures[0].astype(int) - pictures[3]).mean() > 0.5  # grey levels


def test_the_timelines_are_read_from_the_file(recording, results):
    assert timeline_values(recording.path, "frame") == (0, 3)
    sweeps = sum(forces.history.count + 1 for forces in results.frames)
    assert timeline_values(recording.path, "sweep") == (0, sweeps - 1)
    with pytest.raises(NoPictureError, match="no timeline"):
        timeline_values(recording.path, "nothing")


@pytest.mark.parametrize(
    "wrong", [["--size", "big"], ["--frames", "7:9"], ["--step", "0"], ["--rate", "0"], ["--timeline", "time"]]
)
def test_wrong_arguments_of_pictures_end_with_status_2(recording, wrong, capsys):
    with pytest.raises(SystemExit) as end:
        main(["export", "video", str(recording.path), *wrong])
    assert end.value.code == 2
    capsys.readouterr()
