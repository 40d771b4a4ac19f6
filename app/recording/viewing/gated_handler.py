"""One connection behind the gate: how it enters, is refused, and is answered; what it is given says the subclass."""

from __future__ import annotations

from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from typing import Any
from urllib.parse import parse_qs, urlsplit

from .gate import SAFE_HEADERS, Gate

PATIENCE = 60.0  # [s] for a client that says nothing


class GatedHandler(BaseHTTPRequestHandler):
    """Subclassed with what it gives, and once more with the server it belongs to, whose `gate` is named."""

    gate: Gate
    protocol_version = "HTTP/1.1"
    server_version = "rodsight"
    sys_version = ""
    timeout = PATIENCE
    disable_nagle_algorithm = True

    def give(self, path: str, query: dict[str, str]) -> None:
        """Answer a GET that may pass."""
        raise NotImplementedError

    def is_open(self, path: str) -> bool:
        """Whether a path may be asked for without the cookie, by a viewer that keeps none."""
        return False

    def entrance(self, query: dict[str, str]) -> str:
        """Where the first address leads."""
        return "/"

    def do_GET(self) -> None:
        parts = urlsplit(self.path)
        query = {key: values[-1] for key, values in parse_qs(parts.query).items()}
        entering = parts.path == "/" and "token" in query
        if self.refused(changes=False, entering=entering or self.is_open(parts.path)):
            return
        if not entering:
            self.give(parts.path, query)
        elif self.gate.opens(query["token"]):
            place, cookie = self.entrance(query), self.gate.set_cookie
            self.send(b"", "text/plain", HTTPStatus.SEE_OTHER, Location=place, Set_Cookie=cookie)
        else:
            self.say(HTTPStatus.FORBIDDEN, f"this token is not the one that `rodsight {self.gate.command}` printed")

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: the terminal belongs to the person."""

    def refused(self, *, changes: bool, entering: bool = False) -> bool:
        """Whether the gate refuses the request; then it is answered, and the connection ends."""
        refusal = self.gate.refusal(self.headers, changes=changes, entering=entering)
        if refusal is not None:
            self.close_connection = True  # the body, if any, was not read
            self.say(*refusal)
        return refusal is not None

    def say(self, status: HTTPStatus, sentence: str) -> None:
        self.send(sentence.encode(), "text/plain; charset=utf-8", status)

    def send(self, content: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK, **headers: str) -> None:
        """Answer with a content of known length; headers by name, _ for -."""
        named = {key.replace("_", "-"): value for key, value in headers.items()}
        self.head(kind, status, {"Content-Length": str(len(content)), **named})
        self.wfile.write(content)

    def head(self, kind: str, status: HTTPStatus, headers: dict[str, str]) -> None:
        self.send_response(status)
        for name, value in {"Content-Type": kind, "Cache-Control": "no-store", **SAFE_HEADERS, **headers}.items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
