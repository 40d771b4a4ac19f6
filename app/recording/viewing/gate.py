"""Access control of the local pages: only this browser, this page and this machine are admitted.

The first address contains a random token, which opens once. The server exchanges it for a cookie that requests of other
sites do not carry (same-site, strict) and that scripts cannot read. Both are drawn anew by every process. `Host` must
name this machine, so that a foreign name that resolves to it is refused. `Origin`, where a browser sends it, must be
that of this page, and a request that changes something must have one. No answer carries a CORS header. The content
policy restricts the page, and the viewer in it, to requests to this server.
"""

from __future__ import annotations

import secrets
import socket
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from email.message import Message
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from http.server import ThreadingHTTPServer
from typing import Any

from .connections import BACKLOG, Connections, is_other_user

CONTENT_POLICY = "; ".join(
    (
        "default-src 'none'", "script-src 'self' 'wasm-unsafe-eval'", "style-src 'self'", "img-src 'self' blob:",
        "connect-src 'self'", "base-uri 'none'", "form-action 'none'", "frame-ancestors 'none'",
        "require-trusted-types-for 'script'",
    )
)  # fmt: skip
READ_HEADERS = ("Host", "Origin", "Sec-Fetch-Site", "Content-Type", "Cookie")
SAFE_HEADERS = {
    "Content-Security-Policy": CONTENT_POLICY,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}


class QuietServer(ThreadingHTTPServer):
    """A server that prints nothing about clients that disconnect: the terminal shows messages for the user only."""

    daemon_threads = True
    request_queue_size = BACKLOG

    def __init__(self, *arguments: Any, **more: Any) -> None:
        self.known = Connections()
        super().__init__(*arguments, **more)

    def process_request(self, request: Any, client_address: Any) -> None:
        if is_other_user(client_address, self.server_address[1]):  # before it takes the place of the owner's
            self.shutdown_request(request)
            return
        self.known.opened(client_address, lambda: _end(request))
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self.known.forget(client_address)

    def service_actions(self) -> None:
        self.known.close_expired()

    def handle_error(self, request: Any, client_address: Any) -> None:
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


def _end(connection: socket.socket) -> None:
    """End a connection that another thread reads from."""
    with suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)


@dataclass(frozen=True, slots=True)
class Gate:
    """The access rules of one server."""

    port: int
    command: str = "review"  # the command that printed the address
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))  # in the first address
    secret: str = field(default_factory=lambda: secrets.token_urlsafe(32))  # in the cookie
    _unused: list[bool] = field(default_factory=lambda: [True])  # emptied by the first visit

    @property
    def address(self) -> str:
        """The address to open first, once; it contains the token."""
        return f"http://127.0.0.1:{self.port}/?token={self.token}"

    @property
    def cookie_name(self) -> str:
        # Cookies ignore the port: two pages on one machine must not overwrite the cookie of each other.
        return f"rodsight_{self.command}_{self.port}"

    @property
    def set_cookie(self) -> str:
        return f"{self.cookie_name}={self.secret}; Path=/; HttpOnly; SameSite=Strict"

    def refusal(self, headers: Message, *, changes: bool, entering: bool = False) -> tuple[HTTPStatus, str] | None:
        """Return status and reason for which a request with these headers is refused, None if it is admitted."""
        for name in ("Host", "Origin"):
            if len(headers.get_all(name) or []) > 1:
                return HTTPStatus.BAD_REQUEST, f"the header {name} is given twice"
        known = {name: value for name in READ_HEADERS if (value := headers.get(name)) is not None}
        objection = self.objection(known, changes=changes, entering=entering)
        return None if objection is None else (HTTPStatus.FORBIDDEN, objection)

    def refuse_entry(self, token: str, headers: Mapping[str, str]) -> str | None:
        """Return why a first visit with this token is refused, None if it is admitted.

        The token is used up by the first visit; the browser that has the cookie may come again.
        """
        if not secrets.compare_digest(token.encode(), self.token.encode()):
            return f"this token is not the one that `rodsight {self.command}` printed"
        if self._has_cookie(headers.get("Cookie") or ""):
            return None
        try:
            self._unused.pop()  # one of two visits at the same moment
        except IndexError:
            address = f"http://127.0.0.1:{self.port}/"
            return (
                f"this address has been opened before, and opens once: use {address} in the browser that opened it, or "
                f"run `rodsight {self.command}` again"
            )
        return None

    def admits_at_once(self, headers: Mapping[str, str]) -> bool:
        """Return whether a browser sends the new cookie with the redirection of the first visit.

        It does not if a page or a file elsewhere led to the first visit; a page of this server must lead on then.
        """
        return (headers.get("Sec-Fetch-Site") or "none") in ("same-origin", "none")

    def objection(self, headers: Mapping[str, str], *, changes: bool, entering: bool = False) -> str | None:
        """Return why a request is refused, None if it is admitted.

        Parameters
        ----------
        headers : mapping
            Headers of the request by name.
        changes : bool
            The request changes something: it is a POST.
        entering : bool
            The request is the first visit, which has no cookie yet and may come from a link on another page.
        """
        host = headers.get("Host") or ""
        if host not in (f"127.0.0.1:{self.port}", f"localhost:{self.port}"):
            return "this host name is not served"
        origin = headers.get("Origin")
        if (origin is None and changes) or (origin is not None and origin != f"http://{host}"):
            return "requests from this origin are refused"
        if not entering and (headers.get("Sec-Fetch-Site") or "none") not in ("same-origin", "none"):
            return "requests from another site are refused"
        if changes and (headers.get("Content-Type") or "").split(";")[0].strip() != "application/json":
            return "only JSON is accepted"
        if not entering and not self._has_cookie(headers.get("Cookie") or ""):
            return f"open the address that `rodsight {self.command}` printed"
        return None

    def _has_cookie(self, header: str) -> bool:
        try:
            found = SimpleCookie(header).get(self.cookie_name)
        except CookieError:
            return False
        return found is not None and secrets.compare_digest(found.value.encode(), self.secret.encode())
