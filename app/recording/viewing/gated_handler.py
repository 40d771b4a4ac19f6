"""One connection behind the gate: admission, refusal and answers; the subclass defines the content."""

from __future__ import annotations

from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from typing import Any
from urllib.parse import parse_qs, urlsplit

from ...process.machine.browser import redirect_page
from .connections import is_other_user
from .gate import SAFE_HEADERS, Gate, QuietServer

TIMEOUT = 60.0  # [s] without data from the client


class GatedHandler(BaseHTTPRequestHandler):
    """A request handler with a gate. A subclass answers GET requests; a second one names server and `gate`."""

    gate: Gate
    protocol_version = "HTTP/1.1"
    server_version = "rodsight"
    sys_version = ""
    timeout = TIMEOUT
    disable_nagle_algorithm = True

    def answer_get(self, path: str, query: dict[str, str]) -> None:
        """Answer an admitted GET request."""
        raise NotImplementedError

    def is_open(self, path: str) -> bool:
        """Return whether a path is served without the cookie, for a viewer that stores none."""
        return False

    def first_page(self, query: dict[str, str]) -> str:
        """Return the address to which the first visit is redirected."""
        return "/"

    def do_GET(self) -> None:
        parts = urlsplit(self.path)
        query = {key: values[-1] for key, values in parse_qs(parts.query).items()}
        entering = parts.path == "/" and "token" in query
        if self.refused(changes=False, entering=entering or self.is_open(parts.path)):
            return
        if not entering:
            self.answer_get(parts.path, query)
        elif (refusal := self.gate.refuse_entry(query["token"], dict(self.headers.items()))) is None:
            place, cookie = self.first_page(query), self.gate.set_cookie
            if self.gate.admits_at_once(dict(self.headers.items())):
                self.send(b"", "text/plain", HTTPStatus.SEE_OTHER, Location=place, Set_Cookie=cookie)
            else:
                self.send(redirect_page(place).encode(), "text/html; charset=utf-8", Set_Cookie=cookie)
        else:
            self.close_connection = True
            self.send_text(HTTPStatus.FORBIDDEN, refusal)

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing: the terminal shows messages for the user only."""

    def refused(self, *, changes: bool, entering: bool = False) -> bool:
        """Return whether the gate refuses the request; a refusal is sent and the connection ends."""
        refusal = self.gate.refusal(self.headers, changes=changes, entering=entering)
        known = self.server.known if isinstance(self.server, QuietServer) else None
        client = (str(self.client_address[0]), int(self.client_address[1]))
        if refusal is None and known is not None and known.is_new(client) and is_other_user(client, self.gate.port):
            refusal = HTTPStatus.FORBIDDEN, "this page belongs to another user of this machine"
        if refusal is not None:
            self.close_connection = True  # the body, if any, was not read
            self.send_text(*refusal)
        elif known is not None and not entering:  # the token of a first visit is still to be compared
            known.forget(client)
        return refusal is not None

    def send_text(self, status: HTTPStatus, sentence: str) -> None:
        """Answer with a sentence as plain text."""
        self.send(sentence.encode(), "text/plain; charset=utf-8", status)

    def send(self, content: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK, **headers: str) -> None:
        """Answer with content of known length; headers by name, with _ for -."""
        named = {key.replace("_", "-"): value for key, value in headers.items()}
        self.head(kind, status, {"Content-Length": str(len(content)), **named})
        self.wfile.write(content)

    def head(self, kind: str, status: HTTPStatus, headers: dict[str, str]) -> None:
        """Send status and headers."""
        self.send_response(status)
        for name, value in {"Content-Type": kind, "Cache-Control": "no-store", **SAFE_HEADERS, **headers}.items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
