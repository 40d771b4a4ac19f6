"""Hostile requests to the servers: other sites, other host names, guessed secrets, invalid requests are refused.

The servers are those of a recording, of a live run's growing recording, and of the workbench.
"""

from __future__ import annotations

import random
import shutil
import socket
import threading

import pytest
from rodsight.recording.viewing.recording_server import RecordingServer
from rodsight.workbench.service.server import WorkbenchServer
from rodsight.workbench.service.workbench import Workbench

from .table import REQUESTS, note

QUICK, SEED = 160, 6
SECRET = b"bytes of a protected recording"
HOSTS = (
    "evil.example",
    "evil.example:{port}",
    "127.0.0.1",
    "127.0.0.1:{port}",
    "localhost:{port}",
    "[::1]:{port}",
    "",
    "0:{port}",
    "127.0.0.1:{port}.evil.example",
    "127.0.0.1:{port}@evil.example",
    "127.1:{port}",
    "LOCALHOST:{port}",
)
PATHS = (
    "/",
    "/0.rrd",
    "/{key}/0.rrd",
    "/page.js",
    "/re_viewer.js",
    "/?token={key}",
    "/?token=",
    "/api/judge",
    "/api/review_status",
    "/api/next_pair",
    "/crop?at=experiment&frame=0&x=1&y=1&width=9",
    "/api/undo_verdict",
    "/api/home",
    "/api/run_start",
    "/api/set_scale",
    "/events?at=experiment",
    "/photograph?at=experiment&frame=0",
    "/crop?at=../..&frame=0&x=0&y=0&width=9",
    "/page/app.js",
    "/page/..%2fserver.py",
    "/viewer/module.wasm",
    "/recording/{key}/experiment/recording.rrd",
    "/growing.rrd",
    "/{key}/growing.rrd",
    "/../results.h5",
    "/%2e%2e/verdicts.jsonl",
    "//etc/passwd",
    "//[",
    "http://evil.example/",
    "/" + "a" * 9000,
    "*",
    "/\x00",
    "/?token=%ff",
    "/?token=\u00e9",
    "/{key}/../0.rrd",
    "?",
    "",
)
METHODS = (
    "GET",
    "GET",
    "GET",
    "POST",
    "POST",
    "HEAD",
    "PUT",
    "DELETE",
    "OPTIONS",
    "CONNECT",
    "TRACE",
    "get",
    "G\x00T",
    "",
)
HEADERS = (
    "Origin: http://evil.example",
    "Origin: null",
    "Origin: http://127.0.0.1:{port}",
    "Sec-Fetch-Site: cross-site",
    "Sec-Fetch-Site: same-origin",
    "Cookie: rodsight_{port}={key}",
    "Cookie: rodsight_{port}=",
    "Cookie: ;;;=\x01",
    "Content-Length: -1",
    "Content-Length: 99999999999",
    "Content-Length: 5",
    "Transfer-Encoding: chunked",
    "Host: evil.example",
    "Host: 127.0.0.1:{port}",
    "Content-Type: application/json",
    "Content-Type: text/plain",
    "X: " + "y" * 70_000,
    "Upgrade: websocket",
    "Range: bytes=0-9",
    "no header at all",
    "Access-Control-Request-Method: POST",
    "Forwarded: host=127.0.0.1:{port}",
    "X-Forwarded-Host: localhost:{port}",
)
VERSIONS = ("1.1", "1.1", "1.0", "0.9", "2.0", "x")
BODIES = ("", "{}", "[" * 5000, '{"a": ' * 3000, "9" * 5000, "\x00" * 100, "x" * 70_000, '{"reviewer": "mallory"}')


@pytest.fixture(scope="module")
def servers(originals, tmp_path_factory):
    folder = tmp_path_factory.mktemp("served")
    file, growing = folder / "recording.rrd", folder / "growing.rrd"
    for each in (file, growing):
        each.write_bytes(SECRET)
    shutil.copytree(originals.photographed, folder / "bench" / "experiment")
    recordings, live = RecordingServer([file]), RecordingServer([growing], growing=True)
    workbench = WorkbenchServer(Workbench(folder / "bench"))
    thread = threading.Thread(target=workbench.serve, daemon=True)
    thread.start()
    yield recordings, workbench, live
    for each in (recordings, live):
        each.close()
    workbench.shutdown()
    thread.join()
    workbench.close()


def request_of(rng: random.Random, port: int) -> bytes:
    """Draw a request that uses everything except the secrets."""
    key = rng.choice(("guess", "", "%00", "A" * 43, "\u00e9", "null"))
    lines = [f"{rng.choice(METHODS)} {rng.choice(PATHS)} HTTP/{rng.choice(VERSIONS)}"]
    lines.append(f"Host: {rng.choice(HOSTS)}")
    lines += rng.sample(HEADERS, rng.randint(0, 4))
    body = rng.choice(BODIES)
    if rng.random() < 0.5:
        lines.append(f"Content-Length: {len(body)}")
    text = "\r\n".join(lines).replace("{port}", str(port)).replace("{key}", key)
    content = f"{text}\r\n\r\n{body}".encode()
    return content if rng.random() < 0.9 else content[: rng.randrange(len(content))]


def answer_to(port: int, request: bytes) -> bytes:
    with socket.create_connection(("127.0.0.1", port), timeout=20) as connection:
        try:
            connection.sendall(request)
            connection.shutdown(socket.SHUT_WR)
            answer = b""
            while piece := connection.recv(65536):
                answer += piece
        except OSError:  # the server closed the connection
            return b""
    return answer


def is_admitted(answers: bytes) -> bool:
    """Whether an answer has a page, a recording, a cookie or a permission for another site."""
    lines = [line for line in answers.split(b"\r\n") if line.startswith(b"HTTP/1.")]
    opened = any(line.split()[1][:1] in (b"2", b"3") for line in lines)
    lowered = answers.lower()
    return opened or SECRET in answers or b"set-cookie" in lowered or b"access-control-allow" in lowered


def send_requests(servers, count: int, seed: int, capture) -> list[str]:
    """Send a number of requests and return the problems."""
    problems = []
    for number in range(count):
        server = servers[number % len(servers)]
        request = request_of(random.Random(f"{seed} {number}"), server.gate.port)
        answer = answer_to(server.gate.port, request)
        if is_admitted(answer) or b"Traceback" in answer:
            problems.append(f"{seed} {number}: {request[:300]!r}: {answer[:300]!r}")
    printed = capture.readouterr().err
    if printed:
        problems.append(printed[-1500:])
    return problems


@pytest.mark.thorough
def test_some_hostile_requests_are_refused(servers, capsys):
    assert send_requests(servers, QUICK, SEED, capsys) == []


@pytest.mark.slow
def test_many_hostile_requests_are_refused(servers, capsys):
    problems = send_requests(servers, 4 * REQUESTS, SEED + 1, capsys)
    note("requests", tried=4 * REQUESTS, wrong=len(problems))
    assert problems == []


def test_requests_with_the_secret_are_admitted(servers):
    recordings, workbench, _ = servers
    named = f"GET /?token={workbench.gate.token} HTTP/1.1\r\nHost: 127.0.0.1:{workbench.gate.port}"
    assert b" 303 " in answer_to(workbench.gate.port, f"{named}\r\nConnection: close\r\n\r\n".encode())
    port, gate = recordings.port, recordings.gate
    entry = f"GET /?token={gate.token}&renderer=webgl HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n"
    answer = answer_to(port, entry.encode())
    assert b" 303 " in answer
    assert b"Location: /?renderer=webgl" in answer
    (path,) = recordings.recording_paths
    request = f"GET {path} HTTP/1.1\r\nHost: localhost:{port}\r\nConnection: close\r\n\r\n"
    assert SECRET in answer_to(port, request.encode())
    assert SECRET not in answer_to(port, request.replace("localhost", "evil.example").encode())
    own = f"Host: localhost:{port}\r\nCookie: {gate.cookie_name}={gate.secret}"
    page = f"GET / HTTP/1.1\r\n{own}\r\nConnection: close\r\n\r\n"
    assert path.split("/")[1].encode() in answer_to(port, page.encode())
