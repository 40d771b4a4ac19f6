"""Who may talk to the page: this browser, this page, this machine.

The first address carries a random token; it is turned into a cookie that no other site's request carries (same-site,
strict) and no script reads. `Host` must name this machine, so that a foreign name which resolves to it opens
nothing; `Origin`, where a browser sends it, must be this page's own, and a request that changes something must have
one. No answer carries a CORS header. The content policy lets the page, and the viewer in it, talk to this server only.
"""

from __future__ import annotations

import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie

CONTENT_POLICY = "; ".join(
    (
        "default-src 'none'", "script-src 'self' 'wasm-unsafe-eval'", "style-src 'self'", "img-src 'self' blob:",
        "connect-src 'self'", "base-uri 'none'", "form-action 'none'", "frame-ancestors 'none'",
        "require-trusted-types-for 'script'",
    )
)  # fmt: skip
SAFE_HEADERS = {
    "Content-Security-Policy": CONTENT_POLICY,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}


@dataclass(frozen=True, slots=True)
class Gate:
    """The rules of one server."""

    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))  # in the first address
    secret: str = field(default_factory=lambda: secrets.token_urlsafe(32))  # in the cookie

    @property
    def address(self) -> str:
        """The first address, to be opened once."""
        return f"http://127.0.0.1:{self.port}/?token={self.token}"

    @property
    def cookie_name(self) -> str:
        # Cookies do not tell ports apart: two reviews on one machine must not throw each other out.
        return f"rodsight_review_{self.port}"

    @property
    def set_cookie(self) -> str:
        return f"{self.cookie_name}={self.secret}; Path=/; HttpOnly; SameSite=Strict"

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
            return "open the address that `rodsight review` printed"
        return None

    def _has_cookie(self, header: str) -> bool:
        try:
            found = SimpleCookie(header).get(self.cookie_name)
        except CookieError:
            return False
        return found is not None and secrets.compare_digest(found.value.encode(), self.secret.encode())
