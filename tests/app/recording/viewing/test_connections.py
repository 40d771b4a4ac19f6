"""Connections without a secret keep nobody out, wait a short time only, and other users get nothing."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from rodsight.recording.viewing import connections
from rodsight.recording.viewing.connections import Connections, is_other_user, user_of_connection, users_of_listeners
from rodsight.recording.viewing.gate import Gate
from rodsight.recording.viewing.recording_server import RecordingServer
from rodsight.workbench.service import http_connection
from rodsight.workbench.service.server import WorkbenchServer
from rodsight.workbench.service.workbench import Workbench

KINDS = ("workbench", "recording")
MANY, DESCRIPTORS = 330, 256
OTHERS = 2 * connections.UNKNOWN_LIMIT
LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_NOFILE, (int(sys.argv[3]), int(sys.argv[3])))
from pathlib import Path
if sys.argv[1] == "workbench":
    from rodsight.workbench.service.server import WorkbenchServer
    from rodsight.workbench.service.workbench import Workbench
    server = WorkbenchServer(Workbench(Path(sys.argv[2])))
    print(server.address, flush=True)
    server.serve()
else:
    from rodsight.recording.viewing.recording_server import RecordingServer
    server = RecordingServer([Path(sys.argv[2]) / "recording.rrd"])
    print(server.address, flush=True)
    sys.stdin.read()
"""


@contextmanager
def serving(kind: str, folder: Path) -> Iterator[Gate]:
    """A server in this process."""
    if kind == "recording":
        (folder / "recording.rrd").write_bytes(b"")
        server = RecordingServer([folder / "recording.rrd"])
        yield server.gate
        server.close()
        return
    bench = WorkbenchServer(Workbench(folder))
    thread = threading.Thread(target=bench.serve, daemon=True)
    thread.start()
    yield bench.gate
    bench.shutdown()
    thread.join()
    bench.close()


def answer_to(port: int, path: str, *headers: str) -> bytes:
    """The answer to one request; empty where the server ends the connection."""
    with socket.create_connection(("127.0.0.1", port), timeout=20.0) as connection:
        lines = (f"GET {path} HTTP/1.1", f"Host: 127.0.0.1:{port}", "Connection: close", *headers)
        connection.sendall("\r\n".join((*lines, "", "")).encode())
        return read_all(connection)


def read_all(connection: socket.socket) -> bytes:
    content = b""
    with contextlib.suppress(ConnectionError):
        while piece := connection.recv(65536):
            content += piece
    return content


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="no limit of descriptors")
@pytest.mark.parametrize("kind", [KINDS[0], *(pytest.param(each, marks=pytest.mark.slow) for each in KINDS[1:])])
def test_connections_without_a_request_do_not_lock_the_owner_out(kind, tmp_path):
    (tmp_path / "recording.rrd").write_bytes(b"")
    process = subprocess.Popen(
        [sys.executable, "-c", LIMITED, kind, str(tmp_path), str(DESCRIPTORS)], stdin=subprocess.PIPE,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )  # fmt: skip
    with process, ExitStack() as stack:
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            port, path = int(address.split(":")[2].split("/")[0]), address.partition("/?")[2]
            for _ in range(MANY):
                connection = socket.create_connection(("127.0.0.1", port), timeout=20.0)
                stack.callback(connection.close)
            began = time.monotonic()
            assert b" 303 " in answer_to(port, f"/?{path}")
            assert time.monotonic() - began < 5.0
        finally:
            process.kill()
            assert process.stderr is not None
            errors = process.stderr.read()
    assert "Traceback" not in errors
    assert "Too many open files" not in errors


@pytest.fixture
def hasty(monkeypatch) -> None:
    """Deadlines that a test can wait for."""
    monkeypatch.setattr(connections, "DEADLINE", 0.5)
    monkeypatch.setattr(http_connection, "DEADLINE", 0.5)
    monkeypatch.setattr(http_connection, "BODY_DEADLINE", 0.5)


@pytest.mark.parametrize("kind", KINDS)
def test_a_header_that_never_ends_is_not_waited_for(kind, tmp_path, hasty):
    with serving(kind, tmp_path) as gate, socket.create_connection(("127.0.0.1", gate.port), timeout=20.0) as slow:
        ended = threading.Event()
        threading.Thread(target=drip, args=(slow, b"GET / HTTP/1.1\r\nX: ", ended), daemon=True).start()
        began = time.monotonic()
        assert read_all(slow) == b""
        ended.set()
        assert time.monotonic() - began < 5.0


def test_a_body_that_never_comes_is_not_waited_for(tmp_path, hasty):
    with serving("workbench", tmp_path) as gate:
        cookie = f"Cookie: {gate.cookie_name}={gate.secret}"
        lines = (
            "POST /api/home HTTP/1.1", f"Host: 127.0.0.1:{gate.port}", f"Origin: http://127.0.0.1:{gate.port}",
            "Content-Type: application/json", "Content-Length: 10", cookie, "", "{",
        )  # fmt: skip
        with socket.create_connection(("127.0.0.1", gate.port), timeout=20.0) as slow:
            slow.sendall("\r\n".join(lines).encode())
            began = time.monotonic()
            assert b" 200 " not in read_all(slow)
            assert time.monotonic() - began < 5.0


def drip(connection: socket.socket, start: bytes, ended: threading.Event) -> None:
    """Send the beginning of a request, and then a byte now and then."""
    with contextlib.suppress(OSError):
        connection.sendall(start)
        while not ended.wait(0.1):
            connection.sendall(b"x")


@pytest.mark.thorough
@pytest.mark.parametrize("kind", KINDS)
def test_a_connection_with_the_cookie_is_kept_among_many_others(kind, tmp_path, hasty):
    with serving(kind, tmp_path) as gate, ExitStack() as stack:
        own = stack.enter_context(socket.create_connection(("127.0.0.1", gate.port), timeout=20.0))
        request = f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{gate.port}\r\nCookie: {gate.cookie_name}={gate.secret}\r\n\r\n"
        own.sendall(request.encode())
        assert b" 200 " in own.recv(65536)
        others = [socket.create_connection(("127.0.0.1", gate.port), timeout=20.0) for _ in range(OTHERS)]
        for each in others:
            stack.callback(each.close)
            assert read_all(each) == b""  # at its deadline, or as the oldest of too many
        own.settimeout(0.2)
        with contextlib.suppress(TimeoutError):
            while own.recv(1 << 20):
                pass
        own.settimeout(20.0)
        own.sendall(request.encode())
        assert b" 200 " in own.recv(65536)


def test_the_oldest_unknown_connection_makes_room(monkeypatch):
    monkeypatch.setattr(connections, "UNKNOWN_LIMIT", 2)
    known, closed = Connections(), []

    def closing(number: int) -> Callable[[], None]:
        return lambda: closed.append(number)

    for number in range(3):
        known.opened(("127.0.0.1", number), closing(number))
        if number == 0:
            known.forget(("127.0.0.1", 0))  # it showed the secret
    known.opened(("127.0.0.1", 3), closing(3))
    assert closed == [1]


def test_the_user_of_a_connection_is_known(tmp_path):
    if not Path("/proc/net/tcp").exists():
        pytest.skip("no table of connections")
    with serving("recording", tmp_path) as gate:
        with socket.create_connection(("127.0.0.1", gate.port), timeout=20.0) as connection:
            client = connection.getsockname()
            for tables in (connections.TABLES, Path("/proc/net")):  # the kernel's answer, and its table
                assert user_of_connection(client, gate.port, tables) == os.geteuid()
            assert not is_other_user(client, gate.port)
        assert user_of_connection(("testclient", 50000), gate.port) is None
        assert user_of_connection(("127.0.0.1", 1), gate.port, tmp_path / "none") is None


THIEF = """
import encodings.idna, os, socket, sys  # all now: the other user may be refused the library's files
os.setgroups([]); os.setgid(65534); os.setuid(65534)
port, request = int(sys.argv[1]), sys.argv[2].encode()
won = 0
for _ in range(50):
    answer = b""
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=20.0) as connection:
            connection.sendall(request)
            while piece := connection.recv(65536):
                answer += piece
    except ConnectionError:  # it was closed at once
        pass
    won += answer != b"" and b" 403 " not in answer.split(b"\\r\\n")[0]
print(won)
"""


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root may act as another user")
@pytest.mark.parametrize("kind", KINDS)
def test_another_user_who_knows_the_secrets_gets_nothing(kind, tmp_path):
    with serving(kind, tmp_path) as gate:
        host = f"Host: 127.0.0.1:{gate.port}\r\nConnection: close\r\n"
        for request in (
            f"GET /?token={gate.token} HTTP/1.1\r\n{host}\r\n",
            f"GET / HTTP/1.1\r\n{host}Cookie: {gate.cookie_name}={gate.secret}\r\n\r\n",
        ):
            done = subprocess.run(
                [sys.executable, "-c", THIEF, str(gate.port), request], capture_output=True, text=True, timeout=60
            )  # fmt: skip
            assert (done.stdout, done.stderr) == ("0\n", "")
        assert b" 303 " in answer_to(gate.port, f"/?token={gate.token}")


FLOOD = """
import encodings.idna, os, socket, sys, time
os.setgroups([]); os.setgid(65534); os.setuid(65534)
held = []
print("begun", flush=True)
while True:
    try:
        held.append(socket.create_connection(("127.0.0.1", int(sys.argv[1])), timeout=2.0))
    except OSError:
        held.clear()
    del held[:-200]
    time.sleep(0.002)
"""


@pytest.mark.screen
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root may act as another user")
@pytest.mark.parametrize("kind", KINDS)
def test_connections_of_another_user_without_end_do_not_push_out_the_owner(kind, tmp_path, monkeypatch):
    monkeypatch.setattr(connections, "UNKNOWN_LIMIT", 1)  # each of them would push out one of the owner's
    with serving(kind, tmp_path) as gate:
        flood = subprocess.Popen([sys.executable, "-c", FLOOD, str(gate.port)], stdout=subprocess.PIPE, text=True)
        try:
            assert flood.stdout is not None
            assert flood.stdout.readline() == "begun\n"
            cookie = f"Cookie: {gate.cookie_name}={gate.secret}"
            answers = [answer_to(gate.port, "/", cookie).split(b"\r\n")[0] for _ in range(100)]
        finally:
            flood.kill()
            flood.communicate()
    assert [each for each in answers if b" 200 " not in each] == []


def test_the_user_who_listens_at_a_port_is_known():
    if not Path("/proc/net/tcp").exists():
        pytest.skip("no table of connections")
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
        assert users_of_listeners(port) == set()
        listener.listen()
        assert users_of_listeners(port) == {os.geteuid()}
