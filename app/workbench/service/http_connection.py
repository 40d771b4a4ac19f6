"""One connection of the workbench's server: it is counted, and its headers and bodies arrive within time limits."""

from __future__ import annotations

import asyncio
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from ...recording.viewing.connections import DEADLINE, Connections, is_other_user

BODY_DEADLINE = 30.0  # [s] without data of a body


class HttpConnection(H11Protocol):
    """uvicorn's connection, which itself waits for ever for the end of a header or of a body."""

    def __init__(self, known: Connections, **more: Any) -> None:
        super().__init__(**more)
        self._known = known
        self._deadline: asyncio.TimerHandle | None = None
        self._awaits: Any = None  # part of a request that the deadline is for

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if self.client is not None and self.server is not None and is_other_user(self.client, self.server[1] or 0):
            transport.abort()  # before it takes the place of the owner's
        elif self.client is not None:
            self._known.opened(self.client, transport.abort)
            self.loop.call_later(DEADLINE, self._known.close_expired)
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        if self.client is not None:
            self._known.forget(self.client)
        self._await(None)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        self._watch()

    def _watch(self) -> None:
        """Set the deadline: of a header from its first byte on, of a body from its last data on."""
        state = self.conn.their_state
        if state is h11.SEND_BODY:
            self._await(None)
            self._await(state, BODY_DEADLINE)
        elif state is not h11.IDLE:
            self._await(None)
        elif self._awaits is not state:
            self._await(state, DEADLINE)

    def _await(self, state: Any, limit: float = 0.0) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
        self._awaits = state
        self._deadline = None if state is None else self.loop.call_later(limit, self.transport.abort)
