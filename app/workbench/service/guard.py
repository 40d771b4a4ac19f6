"""Admission to the server: every request passes the gate, every answer carries the safe headers."""

from __future__ import annotations

import secrets
from http import HTTPStatus

from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ...process.machine.browser import redirect_page
from ...recording.viewing.connections import Connections, is_other_user
from ...recording.viewing.gate import READ_HEADERS, SAFE_HEADERS, Gate


class Guard:
    """Middleware that refuses requests to which the gate objects."""

    def __init__(self, application: ASGIApp, gate: Gate, open_path: str, entry: str, known: Connections) -> None:
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
        known : Connections
            The connections of the server; one whose request is admitted is taken from its list.
        """
        self.application, self.gate, self.open_path, self.entry = application, gate, open_path, entry
        self.known = known

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

        answer = self._first_answer(request)
        client = scope.get("client")
        if answer is not None and answer.status_code >= HTTPStatus.BAD_REQUEST:
            answer.headers["Connection"] = "close"  # a body, if any, was not read
        elif client is not None:
            self.known.forget(tuple(client))
        await (answer or self.application)(scope, receive, send_safely)

    def _first_answer(self, request: Request) -> Response | None:
        for name in ("host", "origin"):
            if len(request.headers.getlist(name)) > 1:
                return PlainTextResponse(f"the header {name} is given twice", 400)
        entering = request.url.path == "/" and "token" in request.query_params
        headers = {name: value for name in READ_HEADERS if (value := request.headers.get(name)) is not None}
        beginning = request.url.path[: len(self.open_path)].encode()
        is_open = secrets.compare_digest(beginning, self.open_path.encode())
        objection = self.gate.objection(headers, changes=request.method != "GET", entering=entering or is_open)
        if objection is not None:
            return PlainTextResponse(objection, 403)
        if self._is_of_other_user(request):
            return PlainTextResponse("this page belongs to another user of this machine", 403)
        if not entering:
            return None
        refusal = self.gate.refuse_entry(request.query_params["token"], headers)
        if refusal is not None:
            return PlainTextResponse(refusal, 403)
        cookie = {"Set-Cookie": self.gate.set_cookie}
        if self.gate.admits_at_once(headers):
            return RedirectResponse(self.entry, 303, cookie)
        return HTMLResponse(redirect_page(self.entry), headers=cookie)

    def _is_of_other_user(self, request: Request) -> bool:
        """Whether a connection, at its first request, comes from another user."""
        client = request.client
        if client is None or not self.known.is_new((client.host, client.port)):
            return False
        return is_other_user((client.host, client.port), self.gate.port)
