"""Admission to the server: every request passes the gate, every answer carries the safe headers."""

from __future__ import annotations

import secrets

from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ...process.browser import redirect_page
from ...recording.viewing.gate import SAFE_HEADERS, Gate

HEADERS = ("Host", "Origin", "Sec-Fetch-Site", "Content-Type", "Cookie")


class Guard:
    """Middleware that refuses requests to which the gate objects."""

    def __init__(self, application: ASGIApp, gate: Gate, open_path: str, entry: str = "/") -> None:
        """Guard an application.

        Parameters
        ----------
        application : ASGIApp
            The application behind the gate.
        gate : Gate
            The access rules.
        open_path : str
            Secret beginning of paths that are served without a cookie: the viewer stores none.
        entry : str
            Address to which the first visit is redirected.
        """
        self.application, self.gate, self.open_path, self.entry = application, gate, open_path, entry

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.application(scope, receive, send)
            return
        request = Request(scope)

        async def send_safely(message: Message) -> None:
            if message["type"] == "http.response.start":
                given = {name.lower() for name, _ in message["headers"]}
                safe = {"Cache-Control": "no-store"} | SAFE_HEADERS
                more = [(k.encode(), v.encode()) for k, v in safe.items() if k.lower().encode() not in given]
                message = {**message, "headers": [*message["headers"], *more]}
            await send(message)

        refusal = self._refusal(request)
        await (refusal or self.application)(scope, receive, send_safely)

    def _refusal(self, request: Request) -> Response | None:
        for name in ("host", "origin"):
            if len(request.headers.getlist(name)) > 1:
                return PlainTextResponse(f"the header {name} is given twice", 400)
        entering = request.url.path == "/" and "token" in request.query_params
        headers = {name: value for name in HEADERS if (value := request.headers.get(name)) is not None}
        beginning = request.url.path[: len(self.open_path)].encode()
        is_open = secrets.compare_digest(beginning, self.open_path.encode())
        objection = self.gate.objection(headers, changes=request.method != "GET", entering=entering or is_open)
        if objection is not None:
            return PlainTextResponse(objection, 403)
        if not entering:
            return None
        refusal = self.gate.refuse_entry(request.query_params["token"], headers)
        if refusal is not None:
            return PlainTextResponse(refusal, 403)
        cookie = {"Set-Cookie": self.gate.set_cookie}
        if self.gate.admits_at_once(headers):
            return RedirectResponse(self.entry, 303, cookie)
        return HTMLResponse(redirect_page(self.entry), headers=cookie)
