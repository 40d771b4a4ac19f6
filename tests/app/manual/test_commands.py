"""Every command in the pages runs on a tiny experiment: twenty rods, four photographs.

A command that computes for seconds is a slow test if another one, or another room's test, has all its options. A
further slow test runs the same commands on the sample. Four tables list the differences from the pages, each with its
reason: LEFT_OUT, SMALLER, ADDED and LATER.
"""

from __future__ import annotations

import gzip
import os
import re
import shlex
import shutil
import signal
import threading
import urllib.request
import webbrowser
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from rodsight.recording.viewing import open_viewer, recording_server
from rodsight.synthetic.synthesis import SynthesisSettings, synthesize

from tests.app.exchange.foreign.test_pair_forces import DATA as MERCURY_DATA
from tests.app.exchange.foreign.test_pegs import write_frame
from tests.app.manual.test_pages import README, TEXTS, commands
from tests.program import ROOT, rodsight

WRITTEN = ROOT / "tests/app/exchange/foreign/written"
PIXEL = 2.5e-4  # m, of the tiny photographs
FENCED = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
MENTIONED = re.compile(r"`rodsight\s([^`>]+\s[^`>]+)`")  # a command in a sentence
PLACE = re.compile(r"[A-Z]{3}|…|^(share --html|export pictures)$")  # placeholders of the reader, and abbreviations

# Commands that do not run here: their beginning, and the reason.
LEFT_OUT = {
    "study accuracy": "simulates three packings of 1172 rods",
    "study budget": "simulates packings of hundreds of rods",
    "study intervals": "simulates packings of 300 rods",
    "study numbers": "simulates packings of 450 rods",
    "study paper": "simulates packings of 450 rods",
    "study report": "simulates packings of 250 rods, four of each world",
    "study uncertainty": "simulates packings of 450 rods",
    "study trust": "simulates every scenario",
    "study worlds --grains": "simulates packings of 200 rods",
    "study mixture": "simulates every scenario",
    "study real": "needs photoelastic experiments, which are not ours to share",
}
# Arguments that are replaced to save time.
SMALLER = {
    "--idle 600": ("--idle 1", "no photograph arrives any more"),
    "--frames 0:12": ("--frames 0:3", "there are four photographs"),
    "--frames 11:12": ("--frames 3:4", "there are four photographs"),
    "--frame 11": ("--frame 3", "there are four photographs"),
    "--preset small --seed": ("--preset small --grains 20 --frames 3 --seed", "250 rods take half a minute"),
    "--preset paper --seed 1": ("--preset paper --seed 1 --grains 20", "1172 rods take minutes"),
    "--no-photographs --frames 200": ("--no-photographs --grains 40 --frames 6", "1172 rods take minutes"),
    "--grains 300 --frames 60": ("--grains 40 --frames 6", "300 rods take half a minute"),
    "--preset fringes": ("--preset fringes --grains 40", "the fringes of each disc are computed"),
    "--preset shear --no-photographs": ("--preset shear --no-photographs --grains 60", "450 rods take a minute"),
    "study fringes --seeds 4 5 6": ("study fringes --seeds 4 --grains 40", "200 discs take minutes"),
    "--grains 150": ("--grains 60", "simulated anew"),
    "--ensemble 8": ("--ensemble 2", "each is solved again"),
}
# Options added to a command, or to all commands of that name, and the reason.
ADDED = {
    "sensitivity": ("--workers 1", "starting a process takes longer than the work"),
    "sensitivity my_test": ("--factors friction=0.7:1.3", "each of a dozen factors is solved several times"),
    "sensitivity sample_data/shear": ("--factors friction=0.7:1.3", "each of a dozen factors is solved several times"),
    "campaign": ("--no-recordings", "each starts a process of its own"),
    "campaign sample_data/campaign.csv": ("--dry", "the form with --workers 2 runs"),
}
# Commands that compute for seconds and run in the slow lane alone: their beginning, and the room whose fast tests use
# the same options. That their arguments are valid is tested for every command.
LATER = {
    "synth big --preset 1g2e": "tests/app/synthetic",
    "synth lab": "tests/app/synthetic",
    "synth test --preset fringes": "tests/app/synthetic",
    "study fringes": "tests/app/synthetic",
    "study worlds": "tests/app/study",
    "campaign": "tests/app/campaigns",
    "export figures": "tests/app/figures",
    "export pictures": "tests/app/recording/viewing",
    "export video": "tests/app/cli",
    "run my_test --ensemble": "tests/app/robustness",
    "run my_test --follow": "tests/app/following",
    "run try": "tests/app/cli",
    "sensitivity my_test": "tests/app/robustness",
    "share runs/shear --frames": "tests/app/recording/archive",
}
MADE_BY = {"synth": 1, "init": 1, "import": 3}  # index of the word with the folder that a command creates
COSTLY = ("export", "init", "run", "sensitivity", "share", "synth", "track")  # compute for seconds


def page_commands() -> Iterator[tuple[str, ...]]:
    """Yield the words after `rodsight` in blocks and in sentences of the pages."""
    for text in (README, *TEXTS.values()):
        sentences = (" ".join(found.split()) for found in MENTIONED.findall(FENCED.sub("", text)))
        mentioned = (shlex.split(each) for each in sentences if not PLACE.search(each))
        for words in chain(commands(text), mentioned):
            if words and not words[0].startswith("-"):
                yield tuple(words)


def left_out(command: str) -> bool:
    return any(command.startswith(each) for each in LEFT_OUT)


COMMANDS = list(dict.fromkeys(page_commands()))
DONE = [words for words in COMMANDS if not left_out(shlex.join(words))]


def form(words: tuple[str, ...]) -> tuple[tuple[str, ...], set[str]]:
    """Return a command, with the format that it exports, and its options."""
    return words[: 2 if words[0] == "export" else 1], {word for word in words if word.startswith("--")}


def repeats(number: int) -> bool:
    """Whether another command of DONE has all options of this one, and more of them or an earlier place."""
    kind, options = form(DONE[number])
    others = ((k, *form(words)) for k, words in enumerate(DONE) if words[0] in COSTLY)
    return any(other == kind and (options < more or (options == more and k < number)) for k, other, more in others)


def marks(number: int) -> list[pytest.MarkDecorator]:
    later = any(shlex.join(DONE[number]).startswith(start) for start in LATER)
    return [pytest.mark.slow] if later or repeats(number) else []


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the pages use: experiments, runs, files of other programs."""
    folder = tmp_path_factory.mktemp("pages")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        shear = folder / "sample_data/shear"
        synthesize(shear, SynthesisSettings(grains=20, frames=4, seed=12, pixel_size=PIXEL))
        table = pd.read_csv(ROOT / "sample_data/campaign.csv").assign(frames="0:2")
        table.tail(2).to_csv(folder / "sample_data/campaign.csv", index=False)
        for name in ("my_test", "my_photographs", "big", "try", "lab", "one"):
            shutil.copytree(shear, folder / name)
            config = folder / name / "experiment.toml"
            config.write_text(config.read_text().replace('name = "shear"', f'name = "{name}"'))
        for name in ("my_test", "my_photographs"):
            for file in sorted((shear / "photos").iterdir()):  # as in the pages: PNG with smaller pixels
                picture = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
                assert picture is not None
                finer = cv2.resize(picture, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_CUBIC)
                cv2.imwrite(str(folder / name / "photos" / file.with_suffix(".png").name), finer)
        for name, out in (("shear", "shear"), ("shear", "stiffer"), ("my_test", "my_test")):
            source = "my_test" if name == "my_test" else f"sample_data/{name}"
            setting = ("--set", "solver.kappa=0.1") if out == "stiffer" else ()
            assert rodsight("run", source, "--out", f"runs/{out}", *setting) == 0
        shutil.copytree("runs/shear", "runs/campaign/shear")  # as a campaign writes it
        _write_foreign_files(folder)
    return folder


def _write_foreign_files(folder: Path) -> None:
    """Write the files that the pages import, under their names in the pages."""
    tracks = pd.read_csv(folder / "sample_data/shear/truth_tracks.csv")
    named = tracks.rename(columns={"frame": "t", "id": "rod"}).assign(r=0.008)
    named[["t", "rod", "x", "y", "r"]].to_csv(folder / "spots.csv", index=False)
    shutil.copy(WRITTEN / "trackpy_discs.csv", folder / "trajectories.csv")
    spots = tracks.assign(FRAME=tracks.frame, TRACK_ID=tracks.id, RADIUS=8.0, POSITION_X=1e3 * tracks.x)
    spots = spots.assign(POSITION_Y=1e3 * (tracks.y.max() - tracks.y)).drop(columns=tracks.columns)
    units = ",".join("(mm)" if each in ("RADIUS", "POSITION_X", "POSITION_Y") else "" for each in spots)
    header, rows = spots.to_csv(index=False).split("\n", 1)
    (folder / "allspots.csv").write_text("\n".join([header, header.title(), header.title(), units, rows]))
    shutil.copy(WRITTEN / "rodtracker_rods.csv", folder / "rods.csv")
    shutil.copy(WRITTEN / "box_with_floor.dump", folder / "dump.txt")
    (folder / "Shear.data").write_text(MERCURY_DATA)
    frame = tracks[tracks.frame == 0]
    balls = "".join(f"{x}\t{y}\t0\t0.008\n" for x, y in zip(frame.x, frame.y, strict=True))
    (folder / "spheres.txt").write_text(f"#format x_y_z_r\n{balls}")
    assert rodsight("export", "dic", "runs/shear", "--out", "folder") == 0
    for file in (folder / "folder").glob("dic_out_*.txt"):
        _add_corners(file)
    (folder / "solved").mkdir()
    for stem in ("DSC9_solved", "DSC10_solved"):
        write_frame(folder / "solved", stem)


def _add_corners(file: Path) -> None:
    """Add the corners of the frame, as rows of radius 1, to the poses of a photograph."""
    rows = np.loadtxt(file, skiprows=1)
    reach = rows[:, 3].max()
    (left, top), (right, bottom) = rows[:, :2].min(axis=0) - reach, rows[:, :2].max(axis=0) + reach
    corners = np.zeros((4, rows.shape[1]))
    corners[:, :2] = [(left, bottom), (right, bottom), (right, top), (left, top)]  # y down
    corners[:, 3], corners[:, -3:] = 1.0, 1.0
    table = np.vstack([rows, corners])
    file.write_text("\n".join([str(len(table)), *(" ".join(map(repr, row)) for row in table.tolist()), ""]))


@pytest.fixture
def at_work(here: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No screen, and a browser that loads the page once and then interrupts the command by SIGINT."""

    def look_and_stop(page: str) -> bool:
        content = Path(page.removeprefix("file://")).read_text(encoding="utf-8")
        address = content.partition("url=")[2].partition('"')[0]
        assert "token=" in address

        def look() -> None:
            browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
            with browser.open(address, timeout=30) as page:
                assert b"<html" in page.read()
            os.kill(os.getpid(), signal.SIGINT)

        threading.Thread(target=look, daemon=True).start()
        return True

    def serve_here(files: list[Path], *, browser: bool) -> str:  # a server process would outlive the command
        servers.append(recording_server.RecordingServer(files))
        return servers[-1].address

    def pack_quickly(data: bytes, *_: object, **__: object) -> bytes:  # the viewer is packed again for each page
        return pack(data, 1)

    servers: list[recording_server.RecordingServer] = []
    pack = gzip.compress
    monkeypatch.chdir(here)
    monkeypatch.setattr(gzip, "compress", pack_quickly)
    monkeypatch.setattr(webbrowser, "open", look_and_stop)
    monkeypatch.setattr(open_viewer, "start_server_process", serve_here)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    yield
    for server in servers:
        server.close()


def typed(words: tuple[str, ...]) -> list[str]:
    """Return the command with its replacements and additions."""
    line = shlex.join(words)
    for more, (less, _) in SMALLER.items():
        line = line.replace(more, less)
    added = [options for which, (options, _) in ADDED.items() if which in (words[0], shlex.join(words))]
    return [*shlex.split(line), *(word for options in added for word in options.split())]


@pytest.mark.thorough
@pytest.mark.usefixtures("at_work")
@pytest.mark.parametrize(
    "words",
    [pytest.param(words, id=shlex.join(words), marks=marks(number)) for number, words in enumerate(DONE)],
)
def test_a_command_of_the_pages_succeeds(words, tmp_path, monkeypatch, capsys):
    made = Path(words[MADE_BY[words[0]]]) if words[0] in MADE_BY else None
    if made is not None and made.exists():
        made.rename(tmp_path / "aside")
        if words[0] == "init":  # init writes into the folder of the photographs
            shutil.copytree(tmp_path / "aside/photos", made / "photos")
    if words[0] == "view" and "--web" in words:
        monkeypatch.setenv("DISPLAY", ":0")  # then the command opens the browser
    try:
        status = rodsight(*typed(words))
        assert status == 0, capsys.readouterr().err
        if made is not None:
            assert any(made.iterdir())
            if "photoelastic" not in words:  # whose files are those of another program, to be imported
                assert (made / "experiment.toml").is_file()
    finally:
        if made is not None:
            shutil.rmtree(made, ignore_errors=True)
            if (tmp_path / "aside").exists():
                (tmp_path / "aside").rename(made)


def test_every_exception_applies_to_a_page():
    lines = [shlex.join(words) for words in COMMANDS]
    for start in LEFT_OUT:
        assert any(line.startswith(start) for line in lines), start
    for start, room in LATER.items():
        assert any(line.startswith(start) for line in lines), start
        assert (ROOT / room).is_dir(), room
    for which in ADDED:
        assert any(which in (line, line.split()[0]) for line in lines), which
    for more in SMALLER:
        assert any(more in line for line in lines), more
    assert len(DONE) > 50
