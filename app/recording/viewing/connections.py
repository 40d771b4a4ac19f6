"""Connections of a local server: those that showed no secret are few and short, those of other users are refused.

Every client of 127.0.0.1 has the same address. Without a limit, connections without a request use up the descriptors of
the process, and its owner gets none.
"""

from __future__ import annotations

import errno
import os
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

UNKNOWN_LIMIT = 48  # connections that showed no secret yet; for one more, the oldest of them is closed
BACKLOG = 64  # connections that are accepted at once: more would reach the limit of descriptors
DEADLINE = 10.0  # [s] in which a connection shows the secret, and in which every header is complete

TABLES = Path("/proc/self/net")  # the system's tables of connections
LISTENING = "0A"  # state of a socket in them
SERVED = socket.inet_aton("127.0.0.1")
# Of Linux: sock_diag(7), netlink(7).
NETLINK_SOCK_DIAG, SOCK_DIAG_BY_FAMILY, NLM_F_REQUEST, NO_COOKIE = 4, 20, 1, b"\xff" * 8

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


def users_of_listeners(port: int, tables: Path = TABLES) -> set[int]:
    """Return the ids of the users whose programs listen at a port; empty where the system keeps no table."""
    found = set()
    for table in ("tcp", "tcp6"):
        try:
            lines = (tables / table).read_text(encoding="ascii").splitlines()[1:]
        except OSError:
            continue
        for parts in map(str.split, lines):
            if parts[3] == LISTENING and parts[1].endswith(f":{port:04X}"):
                found.add(int(parts[7]))
    return found


def user_of_connection(client: Address, port: int, tables: Path = TABLES) -> int | None:
    """Return the id of the user whose program opened a connection over 127.0.0.1; None where it is unknown.

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
        address = socket.inet_aton(client[0])
    except OSError:  # no address, as of a request without a network
        return None
    if tables == TABLES and hasattr(socket, "AF_NETLINK"):
        with suppress(OSError):  # this kernel does not answer
            return _diagnosed_user(address, client[1], port)
    return _listed_user(address, client[1], port, tables)


def _diagnosed_user(address: bytes, client_port: int, port: int) -> int | None:
    """Look one connection up in the kernel, in the same time however many there are. Raises OSError."""
    connection = struct.pack("!HH16s16sI", client_port, port, address, SERVED, 0) + NO_COOKIE
    request = struct.pack("=BBBBI", socket.AF_INET, socket.IPPROTO_TCP, 0, 0, 0xFFFFFFFF) + connection
    header = struct.pack("=IHHII", 16 + len(request), SOCK_DIAG_BY_FAMILY, NLM_F_REQUEST, 0, 0)
    with socket.socket(socket.AF_NETLINK, socket.SOCK_DGRAM, NETLINK_SOCK_DIAG) as kernel:
        kernel.settimeout(1.0)
        kernel.send(header + request)
        answer = kernel.recv(4096)
    kind = struct.unpack_from("=IH", answer)[1]
    if kind != SOCK_DIAG_BY_FAMILY or len(answer) < 88:
        (error,) = struct.unpack_from("=i", answer, 16)
        if -error == errno.ENOENT:  # its program has closed it
            return None
        raise OSError(-error, os.strerror(-error))
    user, entry = struct.unpack_from("=II", answer, 80)
    return int(user) if entry else None  # 0: its program has closed it


def _listed_user(address: bytes, client_port: int, port: int, tables: Path) -> int | None:
    """Search the tables of connections for one; None where it is missing."""
    four, served = _as_listed(address), _as_listed(SERVED)
    mapped = _as_listed(b"\0\0\0\0") * 2 + _as_listed(b"\0\0\xff\xff")
    for table, before in (("tcp", ""), ("tcp6", mapped)):
        ends = [f"{before}{four}:{client_port:04X}", f"{before}{served}:{port:04X}"]
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
