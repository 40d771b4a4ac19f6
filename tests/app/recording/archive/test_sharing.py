from __future__ import annotations

import subprocess
from dataclasses import replace

import numpy as np
import pytest
from rodsight.cli.main import main
from rodsight.drawing.force_range import ForceRange
from rodsight.experiment.units import Scale
from rodsight.recording.archive.cards import make_card
from rodsight.recording.archive.readback import read_forces
from rodsight.recording.archive.repair import repair_recording
from rodsight.recording.archive.share import share_recording
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities
from rodsight.recording.look.canvas import Canvas
from rodsight.recording.look.force_style import ForceStyle
from rodsight.recording.tabs.layout_property import read_layout
from rodsight.recording.viewing.single_page import write_single_page
from rodsight.recording.viewing.viewer import viewer_binary

from tests.app.recording.fake_photographs import PIXEL, SHAPE, photograph
from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest, rows
from tests.browser import forces_drawn, picture_of, wait_for_forces, wait_until_still


def verify(path) -> None:
    done = subprocess.run([viewer_binary(), "rrd", "verify", path], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


@pytest.mark.thorough
def test_a_shared_recording_is_smaller_complete_and_has_the_same_forces(recording, results, tmp_path):
    report = share_recording(recording.path, tmp_path / "small.rrd", first=1, stop=3, scale=0.5)
    one = share_recording(recording.path, tmp_path / "one.rrd", first=1, stop=2, scale=0.5)
    # The static data stay; each of the two frames that are left out saves what a frame takes.
    assert report.size < recording.size - 1.5 * (report.size - one.size)
    assert report.former_size == recording.size
    verify(report.path)
    found = read_forces(report.path)
    assert sorted(found) == [1, 2]
    assert all(np.array_equal(found[k].fn, results.frames[k].fn) for k in found)
    layout, former = read_layout(report.path), read_layout(recording.path)
    assert layout == replace(former, frame_count=2)


@pytest.mark.thorough
def test_only_the_sweeps_of_the_shared_frames_are_in_it(recording, results, tmp_path):
    path = share_recording(recording.path, tmp_path / "small.rrd", first=1, stop=3).path
    start = results.frames[0].history.count + 1
    sweeps = [row["sweep"] for row in rows(path, entities.SWEEP_NATURAL_MAP) if "sweep" in row]
    assert min(sweeps) == start
    assert max(sweeps) < start + 2 * (results.frames[1].history.count + 1)
    assert rows(path, entities.SUMMARY)


@pytest.mark.thorough
def test_smaller_photographs_cover_the_same_area(recording, tmp_path):
    import cv2

    path = share_recording(recording.path, tmp_path / "small.rrd", scale=0.3).path
    shown = latest(path, entities.PHOTOGRAPH, entities.FRAME, 2)
    picture = cv2.imdecode(np.array(shown["EncodedImage:blob"][0], np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    assert picture.shape == (72, 90)
    stretch = shown["Transform3D:scale"][0]
    assert np.allclose(np.array(picture.shape[::-1]) * stretch[:2], SHAPE[::-1])
    former = latest(recording.path, entities.PHOTOGRAPH, entities.FRAME, 2)
    assert shown["EncodedImage:opacity"] == former["EncodedImage:opacity"]


@pytest.mark.parametrize("wrong", [{"scale": 0.0}, {"scale": 1.5}, {"first": 3, "stop": 3}, {"stop": 9}])
def test_an_invalid_scale_or_range_is_refused(recording, tmp_path, wrong):
    with pytest.raises(ValueError, match=r"scale|range"):
        share_recording(recording.path, tmp_path / "small.rrd", **wrong)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.thorough
def test_a_truncated_recording_is_repaired_up_to_its_end(tmp_path):
    results = make_results(20, sweeps=30)
    path = write_recording(results, tmp_path / "run.rrd").path
    whole = path.read_bytes()
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(whole[: int(0.7 * len(whole))])
    report = repair_recording(cut, tmp_path / "repaired.rrd")
    verify(report.path)
    found = read_forces(report.path)
    assert report.frames == len(found) >= 8
    assert all(np.array_equal(found[k].fn, results.frames[k].fn) for k in found)


def test_a_file_without_data_cannot_be_repaired(tmp_path):
    (tmp_path / "noise.rrd").write_bytes(b"nothing at all" * 100)
    with pytest.raises(OSError, match=r"nothing to save|failed"):
        repair_recording(tmp_path / "noise.rrd", tmp_path / "repaired.rrd")
    assert [file.name for file in tmp_path.iterdir()] == ["noise.rrd"]


@pytest.mark.thorough
def test_a_card_names_its_run_and_shows_every_contact_grain_and_wall_of_the_last_frame(results, tmp_path):
    path = write_recording(replace(results, name="<b>shear"), tmp_path / "run.rrd").path
    card = make_card(path)
    assert "&lt;b&gt;shear" in card
    assert "<b>" not in card
    last = results.frames[-1]
    network, _, keys = card.partition('<g class="gaps and keys">')
    assert network.count("<path") == last.contacts.count + results.walls.count
    assert keys.count("<path") > 48  # the wedge of forces, the scale bar, and gaps
    for text in (f"frame {last.frame} · ", f"trust {last.trust:.2f}", " mm<", " N<"):
        assert text in keys
    assert card.count("<circle") == results.grains.count
    style = ForceStyle.on(Canvas.around(results.tracks, None), ForceRange.of(results.frames))
    for colour in set(style.colours(last.fn).tolist()):  # the reported field, not a sweep
        assert f"#{colour:08x}" in card


@pytest.mark.slow
def test_a_folder_of_runs_is_one_page_with_a_card_for_each_and_one_viewer(tmp_path, capsys):
    path = write_recording(make_results(1, sweeps=5), tmp_path / "run.rrd").path
    for name in ("first", "second", "damaged"):
        (tmp_path / "runs" / name).mkdir(parents=True)
        content = path.read_bytes()[: 500 if name == "damaged" else None]
        (tmp_path / "runs" / name / "recording.rrd").write_bytes(content)
    with pytest.raises(SystemExit) as end:
        main(["share", str(tmp_path / "runs"), "--html"])
    assert not end.value.code
    assert "2 runs" in capsys.readouterr().out
    text = (tmp_path / "runs" / "runs-share.html").read_text(encoding="utf-16")
    assert [text.count(f'id="recording-{k}-0"') for k in range(3)] == [1, 1, 0]
    assert [text.count(f"<h2>{name}</h2>") for name in ("first", "second", "damaged")] == [1, 1, 0]
    assert text.count('id="module"') == 1


@pytest.mark.thorough
def test_the_command_writes_a_small_file_and_a_page_and_prints_their_size(recording, tmp_path, capsys):
    folder = tmp_path / "shear"
    folder.mkdir()
    (folder / "recording.rrd").write_bytes(recording.path.read_bytes())
    with pytest.raises(SystemExit) as end:
        main(["share", str(folder), "--frames", "0:2", "--html"])
    assert not end.value.code
    output = capsys.readouterr().out
    assert "2 frames" in output
    assert output.count(" MB") >= 3
    assert sorted(file.name for file in folder.iterdir()) == ["recording.rrd", "shear-share.html"]


@pytest.mark.parametrize("arguments", [["--frames", "7"], ["--frames", "0:99"], ["--scale", "3"], ["--repair", "x"]])
def test_wrong_arguments_end_with_status_2_and_one_line(recording, arguments, capsys):
    with pytest.raises(SystemExit) as end:
        main(["share", str(recording.path), *arguments])
    assert end.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.slow
@pytest.mark.screen
def test_the_page_draws_the_forces_in_a_browser_without_a_server(results, tmp_path, page):
    # All frames look alike, so that the forces are visible in any frame that the playing viewer shows.
    path = write_recording(results, tmp_path / "run.rrd", photograph=photograph, scale=Scale(PIXEL, SHAPE[0])).path
    file = tmp_path / "run.html"
    write_single_page([path, path], file, title="<shear> & test", cards=[make_card(path), "the same"])
    page.goto(f"file://{file}?renderer=webgl")
    output = page.inner_text("body")  # before the viewer starts
    assert "<shear> & test" in output
    assert "fake" in output
    assert "Drag the slider" in output
    assert page.locator("svg path").count() > 50
    page.get_by_role("button").nth(1).click()
    page.wait_for_function("() => window.rodsight || document.title === 'failed'")
    assert page.title() == "<shear> & test", page.inner_text("body")
    wait_for_forces(page)


@pytest.mark.slow
@pytest.mark.screen
def test_the_page_without_its_recording_draws_no_forces(tmp_path, recording, page):
    file = tmp_path / "run.html"
    write_single_page([recording.path], file, title="empty")
    # The page waits for data that are never sent.
    text = file.read_text(encoding="utf-16").replace("TIMEOUT = 60000", "TIMEOUT = 5000")
    sent = "handle.send_rrd_to_channel(channel, await unpack(`recording-${number}-${part}`));"
    assert sent in text
    file.write_text(text.replace(sent, ""), encoding="utf-16")
    page.goto(f"file://{file}?renderer=webgl")
    page.wait_for_function("() => window.rodsight && seen.colours() > 20")  # the viewer has drawn itself
    wait_until_still(page)
    assert not forces_drawn(picture_of(page))
