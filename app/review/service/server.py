"""The review page's server: the standard library's, on 127.0.0.1 only.

It serves a fixed list of names and the answers of one session: no path of a request ever reaches the file system.
"""

from __future__ import annotations

import gzip
import json
import threading
from collections.abc import Callable
from http import HTTPStatus
from importlib.resources import files
from typing import Any
from urllib.parse import urlsplit

from ...errors import InputError
from ...recording.viewing.gate import Gate, QuietServer
from ...recording.viewing.gated_handler import GatedHandler
from ...recording.viewing.web_viewer import WebViewer, read_web_viewer
from ...verdicts.log import Flag, Origin, Verdict
from .session import BadRequest, ReviewSession, Viewpoint

LARGEST_BODY = 64 * 1024  # bytes of a question
LONGEST_NAME = 60  # characters of a reviewer

_PAGE = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/style.css": ("style.css", "text/css; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
    "/viewer.js": ("viewer.js", "text/javascript; charset=utf-8"),
    "/crop.js": ("crop.js", "text/javascript; charset=utf-8"),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
}
_SCRIPT, _MODULE = "/re_viewer.js", "/re_viewer_bg.wasm"
_RRD = "application/octet-stream"


class ReviewServer:
    """Serves one session; port 0 takes a free one."""

    def __init__(self, session: ReviewSession, port: int = 0, reviewer: str = "") -> None:
        self.session, self.reviewer = session, reviewer
        server = self

        class Handler(_Handler):
            review = server

        self._http = QuietServer(("127.0.0.1", port), Handler)
        self.gate = Handler.gate = Gate(self._http.server_address[1])
        page = files(__name__.rsplit(".", 2)[0]) / "page"
        self.assets = {path: (page.joinpath(name).read_bytes(), kind) for path, (name, kind) in _PAGE.items()}
        self._viewer: WebViewer | None = None
        self._packed: bytes | None = None
        self._viewer_lock = threading.Lock()

    @property
    def address(self) -> str:
        """The address to open first, with its token."""
        return self.gate.address

    def serve(self) -> None:
        """Serve until shutdown is called."""
        self._http.serve_forever(poll_interval=0.2)

    def shutdown(self) -> None:
        self._http.shutdown()

    def close(self) -> None:
        self._http.server_close()

    def viewer(self) -> WebViewer:
        with self._viewer_lock:
            if self._viewer is None:
                self._viewer = read_web_viewer()
            return self._viewer

    def packed_module(self) -> bytes:
        """The viewer's module, compressed once: over an ssh tunnel it is 16 MB instead of 43."""
        module = self.viewer().module
        with self._viewer_lock:
            if self._packed is None:
                self._packed = gzip.compress(module, 1)
            return self._packed

    def answer(self, name: str, values: dict[str, Any]) -> Any:
        """Answer one question of the page with JSON values."""
        try:
            question = _QUESTIONS[name]
        except KeyError:
            raise BadRequest(f"there is no question {name}") from None
        return question(self, _Values(values))


class _Values:
    """The fields of a question, checked as they are taken."""

    def __init__(self, values: dict[str, Any]) -> None:
        self._values = values

    def get(self, key: str, kind: type, default: Any = None) -> Any:
        value = self._values.get(key, default)
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise BadRequest(f"{key} is not {kind.__name__}")
        if kind is float and not abs(value) < 1e9:  # refuses NaN too
            raise BadRequest(f"{key} is out of range")
        return value

    def key(self, name: str = "key") -> int:
        # A key may exceed what a number of the page holds exactly, so that it travels as text.
        text = self.get(name, str)
        if not text.isdecimal() or len(text) > 18:
            raise BadRequest(f"{name} is not a key")
        return int(text)

    def has(self, key: str) -> bool:
        return self._values.get(key) is not None

    def member(self, key: str, kind: Callable[[str], Any]) -> Any:
        try:
            return kind(self.get(key, str))
        except ValueError as error:
            raise BadRequest(str(error)) from None

    def view(self) -> Viewpoint:
        name = " ".join(self.get("reviewer", str).split())
        if not 0 < len(name) <= LONGEST_NAME or not name.isprintable():
            raise BadRequest("a reviewer has a name of 1 to 60 printable characters")
        return Viewpoint(name, self.get("frame", int), self.get("sampled", bool, False), self.get("blind", bool, False))


def _open(server: ReviewServer, values: _Values) -> dict[str, Any]:
    return server.session.opening() | {"reviewer": server.reviewer}


def _status(server: ReviewServer, values: _Values) -> dict[str, Any]:
    return server.session.status(values.view())


def _next(server: ReviewServer, values: _Values) -> dict[str, Any]:
    after = None
    if values.has("after_key"):
        after = (values.get("after_frame", int), values.key("after_key"))
    return {"pair": server.session.following(values.view(), after)}


def _pick(server: ReviewServer, values: _Values) -> dict[str, Any]:
    return server.session.pick(values.view(), values.get("x", float), values.get("y", float))


def _named(server: ReviewServer, values: _Values) -> dict[str, Any]:
    return {"pair": server.session.named(values.view(), values.get("a", str), values.get("b", str))}


def _judge(server: ReviewServer, values: _Values) -> dict[str, Any]:
    """Write a verdict and give the next candidate in the same answer: one journey for one key."""
    view = values.view()
    verdict, origin = values.member("verdict", Verdict), values.member("origin", Origin)
    if origin is Origin.IMPORT:
        raise BadRequest("the page imports nothing")
    frame, key = values.get("pair_frame", int), values.key()
    told = server.session.judge(view, frame, key, verdict, max(values.get("seconds", float), 0.0), origin)
    return told | {"pair": server.session.following(view, (frame, key))}


def _undo(server: ReviewServer, values: _Values) -> dict[str, Any]:
    return server.session.undo(values.view())


def _flag(server: ReviewServer, values: _Values) -> dict[str, Any]:
    server.session.flag(values.view(), values.member("flag", Flag), values.get("on", bool))
    return {}


_QUESTIONS: dict[str, Callable[[ReviewServer, _Values], dict[str, Any]]] = {
    "open": _open, "status": _status, "next": _next, "pick": _pick, "named": _named, "judge": _judge, "undo": _undo,
    "flag": _flag,
}  # fmt: skip


class _Handler(GatedHandler):
    """One connection. Subclassed with the server it belongs to."""

    review: ReviewServer

    def give(self, path: str, query: dict[str, str]) -> None:
        self._guarded(lambda: self._get(path, query))

    def do_POST(self) -> None:
        if self.refused(changes=True):
            return
        length = self.headers.get("Content-Length") or ""
        if not length.isdecimal() or int(length) > LARGEST_BODY:
            self.say(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "a question must be short")
            return
        body = self.rfile.read(int(length))
        self._guarded(lambda: self._post(urlsplit(self.path).path, body))

    def _get(self, path: str, query: dict[str, str]) -> None:
        if path in self.review.assets:
            self.send(*self.review.assets[path])
        elif path == _SCRIPT:
            self.send(self.review.viewer().script, "text/javascript; charset=utf-8")
        elif path == _MODULE:
            packs = "gzip" in (self.headers.get("Accept-Encoding") or "")
            content = self.review.packed_module() if packs else self.review.viewer().module
            encoding = "gzip" if packs else "identity"
            self.send(content, "application/wasm", Vary="Accept-Encoding", Content_Encoding=encoding)
        elif path in ("/backdrop", "/marks", "/look", "/crop"):
            self._send_picture(path, query)
        else:
            self.say(HTTPStatus.NOT_FOUND, "there is nothing here")

    def _send_picture(self, path: str, query: dict[str, str]) -> None:
        session = self.review.session
        frame = _whole(query, "frame")
        key = _whole(query, "key") if "key" in query else None
        if not 0 <= frame < len(session.results.frames):
            raise BadRequest(f"there is no frame {frame}")
        if path == "/backdrop":
            self.send(session.picture.backdrop(frame), _RRD)
        elif path == "/marks":
            asked = {"reviewer": query.get("reviewer", ""), "frame": frame, "blind": query.get("blind") == "1"}
            self.send(session.marks(_Values(asked).view(), key), _RRD)
        elif path == "/look":
            aspect = _whole(query, "aspect") / 1000.0
            point = session.point_of(frame, key) if key is not None else None
            self.send(session.picture.look(point, aspect), _RRD)
        else:
            if key is None:
                raise BadRequest("a crop is of a pair")
            windows = session.picture.windows(session.point_of(frame, key))
            zoom = _whole(query, "zoom")
            if zoom >= len(windows):
                raise BadRequest(f"there is no zoom {zoom}")
            self.send(session.picture.crop(frame, windows[zoom]), "image/jpeg")

    def _post(self, path: str, body: bytes) -> None:
        try:
            values = json.loads(body)
        except (ValueError, RecursionError):
            raise BadRequest("this is not JSON") from None
        if not path.startswith("/ask/") or not isinstance(values, dict):
            raise BadRequest("there is no such question")
        answer = self.review.answer(path.removeprefix("/ask/"), values)
        self.send(json.dumps(answer, allow_nan=False).encode(), "application/json")

    def _guarded(self, work: Callable[[], None]) -> None:
        try:
            work()
        except BadRequest as error:
            self.say(HTTPStatus.BAD_REQUEST, str(error))
        except (InputError, OSError) as error:
            if isinstance(error, ConnectionError):
                self.close_connection = True  # the page went away
            else:
                self.say(HTTPStatus.INTERNAL_SERVER_ERROR, str(error))


def _whole(query: dict[str, str], name: str) -> int:
    text = query.get(name, "")
    if not text.isdecimal() or len(text) > 18:
        raise BadRequest(f"{name} is not a whole number")
    return int(text)
