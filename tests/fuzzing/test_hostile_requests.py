"""Strangers at the doors of the pages: other sites, other names, guessed secrets, broken requests. Nobody gets in.

The doors are those of a recording, of a live run's growing recording, of the review and of the workbench.
"""

from __future__ import annotations

import random
import shutil
import socket
import threading

import pytest
from rodsight.recording.viewing.recording_server import RecordingServer
from rodsight.review.command import open_session
from rodsight.review.reviewed_run import open_reviewed
from rodsight.review.service.server import ReviewServer
from rodsight.workbench.service.bench import Bench
from rodsight.workbench.service.server import WorkbenchServer

from .table import REQUESTS, note

QUICK, SEED = 160, 6
SECRET = b"bytes of a recording that no stranger sees"
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
    "/ask/judge",
    "/ask/open",
    "/look",
    "/crop?frame=0&key=1&zoom=0",
    "/backdrop?frame=0",
    "/ask/home",
    "/ask/run_start",
    "/ask/set_scale",
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
    recordings, live = RecordingServer([file]), RecordingServer([growing], grows=True)
    review = ReviewServer(open_session(open_reviewed(originals.solved)), reviewer="anna")
    workbench = WorkbenchServer(Bench(folder / "bench"))
    threads = [threading.Thread(target=each.serve, daemon=True) for each in (review, workbench)]
    for thread in threads:
        thread.start()
    yield recordings, review, workbench, live
    for each in (recordings, live):
        each.close()
    for each in (review, workbench):
        each.shutdown()
    for thread in threads:
        thread.join()
    review.close()
    workbench.close()


def request_of(chance: random.Random, port: int) -> bytes:
    """A request of somebody who knows everything but the secrets."""
    key = chance.choice(("guess", "", "%00", "A" * 43, "\u00e9", "null"))
    lines = [f"{chance.choice(METHODS)} {chance.choice(PATHS)} HTTP/{chance.choice(VERSIONS)}"]
    lines.append(f"Host: {chance.choice(HOSTS)}")
    lines += chance.sample(HEADERS, chance.randint(0, 4))
    body = chance.choice(BODIES)
    if chance.random() < 0.5:
        lines.append(f"Content-Length: {len(body)}")
    text = "\r\n".join(lines).replace("{port}", str(port)).replace("{key}", key)
    content = f"{text}\r\n\r\n{body}".encode()
    return content if chance.random() < 0.9 else content[: chance.randrange(len(content))]


def answer_to(port: int, request: bytes) -> bytes:
    with socket.create_connection(("127.0.0.1", port), timeout=20) as connection:
        try:
            connection.sendall(request)
            connection.shutdown(socket.SHUT_WR)
            answer = b""
            while piece := connection.recv(65536):
                answer += piece
        except OSError:  # it was refused while it still spoke
            return b""
    return answer


def let_in(answers: bytes) -> bool:
    """Whether something was given: a page, a recording, a cookie, a word to another site."""
    lines = [line for line in answers.split(b"\r\n") if line.startswith(b"HTTP/1.")]
    opened = any(line.split()[1][:1] in (b"2", b"3") for line in lines)
    lowered = answers.lower()
    return opened or SECRET in answers or b"set-cookie" in lowered or b"access-control-allow" in lowered


def knock(servers, count: int, seed: int, said) -> list[str]:
    """What went wrong with so many requests."""
    wrong = []
    for number in range(count):
        server = servers[number % len(servers)]
        request = request_of(random.Random(f"{seed} {number}"), server.gate.port)
        answer = answer_to(server.gate.port, request)
        if let_in(answer) or b"Traceback" in answer:
            wrong.append(f"{seed} {number}: {request[:300]!r}: {answer[:300]!r}")
    told = said.readouterr().err
    if told:
        wrong.append(told[-1500:])
    return wrong


def test_some_strangers_are_kept_out(servers, capsys):
    assert knock(servers, QUICK, SEED, capsys) == []


@pytest.mark.slow
def test_many_strangers_are_kept_out(servers, capsys):
    wrong = knock(servers, 4 * REQUESTS, SEED + 1, capsys)
    note("requests", tried=4 * REQUESTS, wrong=len(wrong))
    assert wrong == []


def test_who_knows_the_secrets_is_let_in(servers):
    recordings, _, workbench, _ = servers
    named = f"GET /?token={workbench.gate.token} HTTP/1.1\r\nHost: 127.0.0.1:{workbench.gate.port}"
    assert b" 303 " in answer_to(workbench.gate.port, f"{named}\r\nConnection: close\r\n\r\n".encode())
    port, gate = recordings.port, recordings.gate
    entry = f"GET /?token={gate.token}&renderer=webgl HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n"
    answer = answer_to(port, entry.encode())
    assert b" 303 " in answer
    assert b"Location: /?renderer=webgl" in answer
    (path,) = recordings.named
    asked = f"GET {path} HTTP/1.1\r\nHost: localhost:{port}\r\nConnection: close\r\n\r\n"
    assert SECRET in answer_to(port, asked.encode())
    assert SECRET not in answer_to(port, asked.replace("localhost", "evil.example").encode())
    own = f"Host: localhost:{port}\r\nCookie: {gate.cookie_name}={gate.secret}"
    page = f"GET / HTTP/1.1\r\n{own}\r\nConnection: close\r\n\r\n"
    assert path.split("/")[1].encode() in answer_to(port, page.encode())
