"""The native viewer without a screen: opens a recording, moves its time cursor, takes pictures of tabs and views.

It draws with any Vulkan driver; without a graphics card the software driver of Mesa serves (package
mesa-vulkan-drivers).
"""

from __future__ import annotations

import glob
import hashlib
import os
import subprocess
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from rerun.experimental import ViewerClient

from ..look.entities import ROOT_CONTAINER
from ..parts import parts_of
from .connections import users_of_listeners
from .plain_window import TOP_BAR, contents_of, erase_buttons, path_of, without_panels
from .viewer import free_port, start_viewer

START_SECONDS = 60.0
ANSWER_SECONDS = 60.0
NOTICE_SECONDS = 9.0  # for which the viewer shows its start notices over a corner of the window
REMARK = "; "  # begins the remark in the title of a view, without which the view is found, too
PICTURE_INTERVAL = 0.25  # [s] between two pictures that must be equal: the viewer fetches data on demand


class NoPictureError(RuntimeError):
    """The viewer could not be started or did not draw; the message names what to install or to change."""


def vulkan_drivers() -> list[str]:
    """Return the files of the installed Vulkan drivers; empty if no picture can be taken."""
    places = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d")
    return [file for place in places for file in sorted(glob.glob(f"{place}/*.json"))]


class HeadlessViewer:
    """One viewer process with one recording, used in a `with` block; the process ends with the block.

    Parameters
    ----------
    recording : Path or str
        The recording.
    width, height : int
        Size of the pictures of the window [px].
    plain : bool
        Show one tab alone, without the viewer's menus, rows of tabs, time panel and buttons.

    Raises
    ------
    FileNotFoundError
        If there is no recording.
    NoPictureError
        If the viewer cannot be started.
    """

    def __init__(self, recording: Path | str, *, width: int = 1600, height: int = 1000, plain: bool = False) -> None:
        self.recording = Path(recording)
        if not self.recording.is_file():
            raise FileNotFoundError(f"there is no recording {recording}")
        self._plain = plain
        self._size = f"{width}x{height + (TOP_BAR if plain else 0)}"
        self._process: subprocess.Popen[bytes] | None = None
        self._client: ViewerClient | None = None
        self._tab: str | None = None
        self._clear_at = 0.0  # time at which the start notices have disappeared

    def __enter__(self) -> HeadlessViewer:
        try:
            self._start()
            self._open()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the viewer."""
        if self._process is not None:
            self._process.terminate()
            try:
                self._process.wait(10)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process = None

    @property
    def process_id(self) -> int | None:
        """Number of the viewer's process; None while it does not run."""
        return None if self._process is None else self._process.pid

    @property
    def tabs(self) -> list[str]:
        """Names of the tabs, in their order."""
        return [self._name(each) for each in contents_of(self._root()[1])]

    @property
    def views(self) -> list[str]:
        """Names of all views of all tabs."""
        return [view.name or "" for view in self._running().get_state().views]

    def timeline(self, name: str) -> tuple[int, int]:
        """Return the first and last value of a timeline."""
        state = self._running().get_state()
        for recording in state.recordings:
            for line in recording.timelines:
                if line.name == name and line.start is not None and line.end is not None:
                    return int(line.start), int(line.end)
        raise NoPictureError(f"{self.recording} has no timeline {name!r}")

    def warnings(self) -> list[str]:
        """Return the viewer's reports of missing data, of all views drawn so far."""
        return [
            f"{view.name}: {report.summary}" for view in self._running().get_state().views for report in view.reports
        ]

    def show_tab(self, name: str) -> None:
        """Bring a tab to the front; raise NoPictureError if there is none of that name."""
        path, root = self._root()
        for each in contents_of(root):
            if self._name(each) == name:
                blueprint = self._running().get_blueprint().blueprint
                blueprint[path]["ContainerBlueprint"]["active_tab"] = each
                self._running().set_blueprint(blueprint, "recording")
                self._tab = name
                return
        raise NoPictureError(f"{self.recording} has no tab {name!r}; there are {', '.join(self.tabs)}")

    def set_time(self, timeline: str, value: int) -> None:
        """Move the cursor of a timeline and stop there."""
        self._running().set_time(timeline, sequence=value, play_state="paused")

    def draw(self) -> bytes:
        """Draw the window once, complete or not, and return the picture as PNG."""
        return self._running().take_screenshot()

    def picture(self, view: str | None = None) -> bytes:
        """Take a picture once two consecutive ones are equal.

        Parameters
        ----------
        view : str, optional
            The view, whose tab comes to the front; None: the whole window.

        Returns
        -------
        bytes
            The picture as PNG.

        Raises
        ------
        NoPictureError
            If there is no such view, or the picture still changes after ANSWER_SECONDS.
        """
        client = self._running()
        view_id = None if view is None else self._bring_to_front(view)
        while time.monotonic() < self._clear_at:
            client.take_screenshot(max_size=64)
            time.sleep(0.3)
        end, previous = time.monotonic() + ANSWER_SECONDS, b""
        while time.monotonic() < end:
            try:
                picture = client.take_screenshot(view_id)
            except ConnectionError as error:
                if "NotFound" not in str(error):
                    raise
                picture = b""  # a view that has just come to the front has no layout yet
            digest = hashlib.sha256(picture).digest()
            if picture and digest == previous:
                return self._without_buttons(picture) if self._plain and view is None else picture
            previous = digest
            time.sleep(PICTURE_INTERVAL)
        raise NoPictureError(f"{self.recording}: the picture still changed after {ANSWER_SECONDS:g} s")

    def _without_buttons(self, picture: bytes) -> bytes:
        blueprint = self._running().get_blueprint().blueprint
        tab = next(each for each in contents_of(self._root()[1]) if self._name(each) == self._tab)
        return erase_buttons(picture, blueprint, path_of(tab))

    def _start(self) -> None:
        if not vulkan_drivers():
            raise NoPictureError(
                "no Vulkan driver found: pictures without a screen need one (apt-get install mesa-vulkan-drivers)"
            )
        environment = {"XDG_RUNTIME_DIR": tempfile.gettempdir()}
        software = [file for file in vulkan_drivers() if "lvp_icd" in file]
        if software and not Path("/dev/dri").exists():
            environment["VK_ICD_FILENAMES"] = software[0]
        port = free_port()
        self._process = start_viewer(
            "--headless", "--hide-welcome-screen", "--bind", "127.0.0.1", "--port", str(port),
            "--window-size", self._size,
            environment={name: value for name, value in environment.items() if name not in os.environ},
        )  # fmt: skip
        self._clear_at = time.monotonic() + NOTICE_SECONDS
        end = time.monotonic() + START_SECONDS
        while time.monotonic() < end:
            if self._process.poll() is not None:
                raise NoPictureError(f"the viewer ended with status {self._process.returncode} instead of drawing")
            with suppress(Exception):  # until the viewer listens, the client raises various errors
                client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
                client.get_state()
                self._client = client
            if self._client is not None:
                self._refuse_other_user(port)
                return
            time.sleep(0.1)
        raise NoPictureError(f"the viewer did not answer within {START_SECONDS:g} s")

    def _refuse_other_user(self, port: int) -> None:
        """Raise NoPictureError where the port is not the viewer's: another user took it and would draw the pictures."""
        listening = users_of_listeners(port)
        if self._process is None or self._process.poll() is not None or (listening and listening != {os.geteuid()}):
            raise NoPictureError(f"port {port} was taken by another program before the viewer had it: try again")

    def _open(self) -> None:
        # One by one: the viewer does not answer while it loads a long part.
        for file in parts_of(self.recording.resolve()):
            self._running().open(str(file))
            self._wait_until_loaded()
        self._running().set_time(play_state="paused")  # a blueprint may start it playing
        if self._plain:
            self._running().set_blueprint(without_panels(self._running().get_blueprint().blueprint), "recording")
            self.show_tab(self._name(self._root()[1].get("active_tab") or contents_of(self._root()[1])[0]))

    def _wait_until_loaded(self) -> None:
        client, end = self._running(), time.monotonic() + ANSWER_SECONDS
        while True:
            with suppress(TimeoutError):
                client.take_screenshot(max_size=64)  # a view exists after it was drawn
                state = client.get_state()
                if not state.loading and state.active_recording is not None and state.views:
                    return
            if time.monotonic() > end:
                raise NoPictureError(f"{self.recording} was not loaded within {ANSWER_SECONDS:g} s")
            time.sleep(0.1)

    def _running(self) -> ViewerClient:
        if self._client is None:
            raise RuntimeError("HeadlessViewer must be used in a with block")
        return self._client

    def _root(self) -> tuple[str, dict]:
        """Return path and content of the container of the tabs."""
        for path, parts in self._running().get_blueprint().blueprint.items():
            container = parts.get("ContainerBlueprint", {})
            if container.get("container_kind") == "Tabs" and container.get("display_name") == ROOT_CONTAINER:
                return path, container
        raise NoPictureError(f"{self.recording} has no tabs")

    def _name(self, item: str) -> str:
        return _display_name(self._running().get_blueprint().blueprint[path_of(item)])

    def _bring_to_front(self, name: str) -> str:
        """Return the view of this name in the front tab, or else in the first tab that has one, and show that tab."""
        views = self._running().get_state().views
        named = {str(view.view_id) for view in views if name in (view.name, (view.name or "").partition(REMARK)[0])}
        if not named:
            shown = ", ".join(sorted(repr(each) for each in set(self.views)))
            raise NoPictureError(f"{self.recording} has no view {name!r}; there are {shown}")
        tabs = self.tabs
        for tab in [self._tab or tabs[0], *tabs]:
            inside = sorted(named & self._views_of_tab(tab))
            if inside:
                if tab != self._tab:
                    self.show_tab(tab)
                return inside[0]
        raise NoPictureError(f"{self.recording}: the view {name!r} is in no tab")

    def _views_of_tab(self, tab: str) -> set[str]:
        blueprint = self._running().get_blueprint().blueprint
        pending = [each for each in contents_of(self._root()[1]) if self._name(each) == tab]
        views: set[str] = set()
        while pending:
            item = pending.pop()
            if path_of(item).startswith("/view/"):
                views.add(path_of(item).removeprefix("/view/"))
            else:
                pending += contents_of(blueprint[path_of(item)]["ContainerBlueprint"])
        return views


def _display_name(parts: dict) -> str:
    return next((part["display_name"] for part in parts.values() if "display_name" in part), "")
