"""The native viewer without a screen: opens a recording, moves its cursor, takes pictures of tabs and views.

It draws with any Vulkan driver; without a graphics card the software one of Mesa does (package
mesa-vulkan-drivers).
"""

from __future__ import annotations

import glob
import hashlib
import socket
import subprocess
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from rerun.experimental import ViewerClient

from ..parts import parts_of
from .viewer import viewer_binary, viewer_environment

START_SECONDS = 60.0
ANSWER_SECONDS = 60.0
NOTICE_SECONDS = 9.0  # for which the viewer shows what it says at the start over a corner of the window
STILL_SECONDS = 0.25  # between two pictures that must be equal: data is fetched on demand


class NoPictureError(RuntimeError):
    """The viewer could not be started or did not draw; the message says what to install or to change."""


def vulkan_drivers() -> list[str]:
    """Files of the installed Vulkan drivers; empty where no picture can be taken."""
    places = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d")
    return [file for place in places for file in sorted(glob.glob(f"{place}/*.json"))]


def free_port() -> int:
    """A port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class HeadlessViewer:
    """One viewer process with one recording. Use it in a `with` block: the process ends with it."""

    def __init__(self, recording: Path | str, *, width: int = 1600, height: int = 1000) -> None:
        self.recording = Path(recording)
        if not self.recording.is_file():
            raise FileNotFoundError(f"there is no recording {recording}")
        self._size = f"{width}x{height}"
        self._process: subprocess.Popen[bytes] | None = None
        self._client: ViewerClient | None = None
        self._tab: str | None = None
        self._clear_at = 0.0  # when the notices of the start are gone

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
    def tabs(self) -> list[str]:
        """Names of the tabs, in their order."""
        return [self._name(each) for each in self._root()[1]["contents"]]

    @property
    def views(self) -> list[str]:
        """Names of all views of all tabs."""
        return [view.name or "" for view in self._running().get_state().views]

    def timeline(self, name: str) -> tuple[int, int]:
        """First and last value of a timeline."""
        state = self._running().get_state()
        for recording in state.recordings:
            for line in recording.timelines:
                if line.name == name and line.start is not None and line.end is not None:
                    return int(line.start), int(line.end)
        raise NoPictureError(f"{self.recording} has no timeline {name!r}")

    def warnings(self) -> list[str]:
        """What the viewer says it could not draw, of all views drawn so far."""
        return [
            f"{view.name}: {report.summary}" for view in self._running().get_state().views for report in view.reports
        ]

    def show_tab(self, name: str) -> None:
        """Bring a tab to the front; raises NoPictureError where there is none of that name."""
        path, root = self._root()
        for each in root["contents"]:
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

    def draw(self) -> None:
        """Draw the window once, as it is."""
        self._running().take_screenshot()

    def picture(self, view: str | None = None) -> bytes:
        """A picture (PNG) of the window, or of one view, whose tab comes to the front, taken once it stands still."""
        client = self._running()
        view_id = None if view is None else self._bring_to_front(view)
        while time.monotonic() < self._clear_at:
            client.take_screenshot(max_size=64)
            time.sleep(0.3)
        end, former = time.monotonic() + ANSWER_SECONDS, b""
        while time.monotonic() < end:
            try:
                picture = client.take_screenshot(view_id)
            except ConnectionError as error:
                if "NotFound" not in str(error):
                    raise
                picture = b""  # a view that has just come to the front is still laid out
            digest = hashlib.sha256(picture).digest()
            if picture and digest == former:
                return picture
            former = digest
            time.sleep(STILL_SECONDS)
        raise NoPictureError(f"{self.recording}: the picture still changed after {ANSWER_SECONDS:g} s")

    def _start(self) -> None:
        if not vulkan_drivers():
            raise NoPictureError(
                "no Vulkan driver found: pictures without a screen need one (apt-get install mesa-vulkan-drivers)"
            )
        environment = viewer_environment()
        environment.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())
        software = [file for file in vulkan_drivers() if "lvp_icd" in file]
        if software and not Path("/dev/dri").exists():
            environment.setdefault("VK_ICD_FILENAMES", software[0])
        port = free_port()
        self._process = subprocess.Popen(
            [
                str(viewer_binary()), "--headless", "--hide-welcome-screen", "--bind", "127.0.0.1", "--port", str(port),
                "--window-size", self._size,
            ],
            env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        self._clear_at = time.monotonic() + NOTICE_SECONDS
        end = time.monotonic() + START_SECONDS
        while time.monotonic() < end:
            if self._process.poll() is not None:
                raise NoPictureError(f"the viewer ended with status {self._process.returncode} instead of drawing")
            with suppress(Exception):  # until it listens, whatever the client raises means: not yet
                client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
                client.get_state()
                self._client = client
                return
            time.sleep(0.1)
        raise NoPictureError(f"the viewer did not answer within {START_SECONDS:g} s")

    def _open(self) -> None:
        for file in parts_of(self.recording.resolve()):  # one by one: a viewer that loads a long part hears nothing
            self._running().open(str(file))
            self._wait_until_loaded()
        self._running().set_time(play_state="paused")  # a blueprint may start it playing

    def _wait_until_loaded(self) -> None:
        client, end = self._running(), time.monotonic() + ANSWER_SECONDS
        while True:
            with suppress(TimeoutError):
                client.take_screenshot(max_size=64)  # views exist once they were drawn
                state = client.get_state()
                if not state.loading and state.active_recording is not None and state.views:
                    return
            if time.monotonic() > end:
                raise NoPictureError(f"{self.recording} was not loaded within {ANSWER_SECONDS:g} s")
            time.sleep(0.1)

    def _running(self) -> ViewerClient:
        if self._client is None:
            raise RuntimeError("HeadlessViewer is used in a with block")
        return self._client

    def _root(self) -> tuple[str, dict]:
        """Path and content of the container that holds the tabs."""
        for path, parts in self._running().get_blueprint().blueprint.items():
            container = parts.get("ContainerBlueprint", {})
            if container.get("container_kind") == "Tabs":
                return path, container
        raise NoPictureError(f"{self.recording} has no tabs")

    def _name(self, item: str) -> str:
        return _display_name(self._running().get_blueprint().blueprint[_path(item)])

    def _bring_to_front(self, name: str) -> str:
        """The view of this name in the tab in front, or else in the first tab that has one."""
        named = {str(view.view_id) for view in self._running().get_state().views if view.name == name}
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
        todo = [each for each in self._root()[1]["contents"] if self._name(each) == tab]
        views: set[str] = set()
        while todo:
            item = todo.pop()
            if _path(item).startswith("/view/"):
                views.add(_path(item).removeprefix("/view/"))
            else:
                todo += blueprint[_path(item)]["ContainerBlueprint"]["contents"]
        return views


def _path(item: str) -> str:
    """Blueprint path of a container's content, which is named with or without its leading slash."""
    return "/" + item.lstrip("/")


def _display_name(parts: dict) -> str:
    return next((part["display_name"] for part in parts.values() if "display_name" in part), "")
