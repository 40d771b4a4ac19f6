"""Who may talk to the page: this browser, this page, this machine.

The first address carries a random token; it is turned into a cookie that no other site's request carries (same-site,
strict) and no script reads. `Host` must name this machine, so that a foreign name which resolves to it opens
nothing; `Origin`, where a browser sends it, must be this page's own, and a request that changes something must have
one. No answer carries a CORS header. The content policy lets the page, and the viewer in it, talk to this server only.
"""

from __future__ import annotations

import secrets
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from email.message import Message
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from http.server import ThreadingHTTPServer
from typing import Any

CONTENT_POLICY = "; ".join(
    (
        "default-src 'none'", "script-src 'self' 'wasm-unsafe-eval'", "style-src 'self'", "img-src 'self' blob:",
        "connect-src 'self'", "base-uri 'none'", "form-action 'none'", "frame-ancestors 'none'",
        "require-trusted-types-for 'script'",
    )
)  # fmt: skip
_HEADERS = ("Host", "Origin", "Sec-Fetch-Site", "Content-Type", "Cookie")
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
    """A server that says nothing of clients that break off; the terminal belongs to the person."""

    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


@dataclass(frozen=True, slots=True)
class Gate:
    """The rules of one server."""

    port: int
    command: str = "review"  # that printed the address
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))  # in the first address
    secret: str = field(default_factory=lambda: secrets.token_urlsafe(32))  # in the cookie

    @property
    def address(self) -> str:
        """The first address, to be opened once."""
        return f"http://127.0.0.1:{self.port}/?token={self.token}"

    @property
    def cookie_name(self) -> str:
        # Cookies do not tell ports apart: two pages on one machine must not throw each other out.
        return f"rodsight_{self.command}_{self.port}"

    @property
    def set_cookie(self) -> str:
        return f"{self.cookie_name}={self.secret}; Path=/; HttpOnly; SameSite=Strict"

    def refusal(self, headers: Message, *, changes: bool, entering: bool = False) -> tuple[HTTPStatus, str] | None:
        """Likewise `objection`, for headers as they came: with a status."""
        for name in ("Host", "Origin"):
            if len(headers.get_all(name) or []) > 1:
                return HTTPStatus.BAD_REQUEST, f"{name} stands twice"
        told = {name: value for name in _HEADERS if (value := headers.get(name)) is not None}
        objection = self.objection(told, changes=changes, entering=entering)
        return None if objection is None else (HTTPStatus.FORBIDDEN, objection)

    def opens(self, token: str) -> bool:
        return secrets.compare_digest(token.encode(), self.token.encode())

    def objection(self, headers: Mapping[str, str], *, changes: bool, entering: bool = False) -> str | None:
        """Why a request is refused; None: it may pass.

        changes: it is a POST. entering: it is the first visit, which has no cookie yet and may be a link elsewhere.
        """
        host = headers.get("Host") or ""
        if host not in (f"127.0.0.1:{self.port}", f"localhost:{self.port}"):
            return "this host name is not served"
        origin = headers.get("Origin")
        if (origin is None and changes) or (origin is not None and origin != f"http://{host}"):
            return "this origin may not ask"
        if not entering and (headers.get("Sec-Fetch-Site") or "none") not in ("same-origin", "none"):
            return "another site may not ask"
        if changes and (headers.get("Content-Type") or "").split(";")[0].strip() != "application/json":
            return "only JSON is taken"
        if not entering and not self._has_cookie(headers.get("Cookie") or ""):
            return f"open the address that `rodsight {self.command}` printed"
        return None

    def _has_cookie(self, header: str) -> bool:
        try:
            found = SimpleCookie(header).get(self.cookie_name)
        except CookieError:
            return False
        return found is not None and secrets.compare_digest(found.value.encode(), self.secret.encode())
