"""Connections of a local server: those that showed no secret are few and short, those of other users are refused.

Every client of 127.0.0.1 has the same address. Without a limit, connections without a request use up the descriptors of
the process, and its owner gets none.
"""

from __future__ import annotations

import os
import socket
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

UNKNOWN_LIMIT = 48  # connections that showed no secret yet; for one more, the oldest of them is closed
BACKLOG = 64  # connections that are accepted at once: more would reach the limit of descriptors
DEADLINE = 10.0  # [s] in which a connection shows the secret, and in which every header is complete

Address = tuple[str, int]


@dataclass(slots=True)
class _Unknown:
    since: float  # [s] of time.monotonic
    close: Callable[[], None]


class Connections:
    """The open connections of one server, by the address of the client."""

    def __init__(self) -> None:
        self._unknown: dict[Address, _Unknown] = {}  # in the order in which they were opened
        self._lock = threading.Lock()

    def opened(self, client: Address, close: Callable[[], None]) -> None:
        """Note a new connection; `close` ends it from any thread. Where there are too many, the oldest is closed."""
        with self._lock:
            self._unknown[client] = _Unknown(time.monotonic(), close)
            excess = list(self._unknown)[: len(self._unknown) - UNKNOWN_LIMIT]
            closed = [self._unknown.pop(each) for each in excess]
        for each in closed:
            each.close()

    def is_new(self, client: Address) -> bool:
        """Return whether a connection has shown no secret yet."""
        return client in self._unknown

    def forget(self, client: Address) -> None:
        """Note that a connection has shown the secret, or has ended: it is not closed from here any more."""
        with self._lock:
            self._unknown.pop(client, None)

    def close_expired(self) -> None:
        """Close the connections that have shown no secret within the deadline."""
        oldest = time.monotonic() - DEADLINE
        with self._lock:
            expired = [client for client, each in self._unknown.items() if each.since <= oldest]
            closed = [self._unknown.pop(each) for each in expired]
        for each in closed:
            each.close()


def is_other_user(client: Address, port: int) -> bool:
    """Return whether a connection to a port of 127.0.0.1 comes from another user of this machine; False if unknown.

    A browser sends the cookies of 127.0.0.1 to every port of it: the page of another user, once visited, knows them.
    """
    user = user_of_connection(client, port)
    if user is None:
        return False
    started_by = os.environ.get("SUDO_UID", "")
    return user not in {0, os.geteuid(), os.getuid(), int(started_by) if started_by.isdecimal() else 0}


def user_of_connection(client: Address, port: int, tables: Path = Path("/proc/self/net")) -> int | None:
    """Return the id of the user whose program opened a connection over 127.0.0.1; None where the system keeps no table.

    Parameters
    ----------
    client : tuple
        Address and port of the client.
    port : int
        The port of the server.
    tables : Path
        Folder of the system's tables of connections.
    """
    try:
        four = _as_listed(socket.inet_aton(client[0]))
        served = _as_listed(socket.inet_aton("127.0.0.1"))
    except OSError:  # no address, as of a request without a network
        return None
    mapped = _as_listed(b"\0\0\0\0") * 2 + _as_listed(b"\0\0\xff\xff")
    for table, before in (("tcp", ""), ("tcp6", mapped)):
        ends = [f"{before}{four}:{client[1]:04X}", f"{before}{served}:{port:04X}"]
        try:
            lines = (tables / table).read_text(encoding="ascii").splitlines()
        except OSError:
            continue
        for line in lines:
            parts = line.split()
            if parts[1:3] == ends and parts[9] != "0":  # 0: its program has closed it
                return int(parts[7])
    return None


def _as_listed(address: bytes) -> str:
    """Four bytes of an address as the system's table lists them."""
    return f"{int.from_bytes(address, sys.byteorder):08X}"
