"""Hostile values in requests of the page itself: every one is refused or answered, none ends in a traceback.

The values are those of endpoints and of queries, drawn at random: wrong types, numbers without end, texts that no file
can be named by, paths out of the folder.
"""

from __future__ import annotations

import inspect
import json
import random
import shutil
from typing import Any
from urllib.parse import quote

import pytest
from rodsight.recording.viewing.gate import Gate
from rodsight.workbench.running.job import Job
from rodsight.workbench.service.endpoints import ENDPOINTS
from rodsight.workbench.service.server import make_application
from rodsight.workbench.service.workbench import Workbench
from starlette.testclient import TestClient

from .table import REQUESTS, note

QUICK, SEED, PORT = 160, 8, 4711
HOST = f"http://127.0.0.1:{PORT}"
VALID = 0.5  # fraction of requests whose other values are valid where the table below has one
TEXTS: tuple[str, ...] = (
    "", ".", "..", "../..", "/etc", "experiment", "experiment/.", "nested", "bad", "a\0b", "\0", "\ud800", "\udcff",
    "\uffff", "x" * 301, "x" * 5000, "a" * 255, "é", "%00", "%2e%2e", "wall\n", "../secret.csv", "same", "measured",
    "top", "times", "nan", "-1", "1e400", "0x10", "٣", "٣٤", "１２", "\u202e", "NaN", "Infinity", "-0", "1_0",
)  # fmt: skip
NUMBERS: tuple[Any, ...] = (
    0, 1, -1, 2, 3.5, -0.0, 1e-300, 1e300, 1e12, 2**53, 2**63, 2**64, 10**400, float("inf"), float("-inf"),
    float("nan"), 0.1, 1e-9, 240, 4000,
)  # fmt: skip
OTHER: tuple[Any, ...] = (None, True, False, [], {}, [[]], [None], {"a": {}}, [[0.0, 0.0], [1.0, 1.0]], [1, 2, 3, 4])
QUERIES = ("/photograph", "/thumbnail", "/crop", "/shared", "/viewer/script.js", "/page/app.js", "/")
NAMES = ("at", "frame", "size", "folder", "suffix", "x", "y", "width", "columns", "rows", "token")
GIVEN: dict[str, tuple[Any, ...]] = {
    "at": ("experiment",), "frame": (0, 1, 2), "first": (0,), "stop": (2, None), "name": ("name", "times"),
    "i": (0, 3), "j": (1, "top"), "x": (50.0,), "y": (50.0,), "radius": (9.0,), "width": (20.0,), "radii": ([0.008],),
    "line": ([[0.0, 0.0], [9.0, 0.0]],), "reviewer": ("anna",), "folder": (".", "experiment/photos"),
    "suffix": (".jpg",), "id": (0, 3), "ids": ([0, 1],), "theta": (0.1,),
}  # fmt: skip
BAD = {"nested": "name = " + "[" * 300 + "]" * 300, "bad": 'name = "a\\u0000b"\nwalls.file = 3'}
SLOW = ("prediction", "quality", "duplicate", "sample", "detect_rods")  # seconds each: tried with a wrong `at` alone


@pytest.fixture(scope="module")
def client(originals, tmp_path_factory) -> TestClient:
    """A workbench with a good experiment beside bad ones, requested with the cookie."""
    root = tmp_path_factory.mktemp("bench")
    shutil.copytree(originals.photographed, root / "experiment")
    for name, content in BAD.items():
        (root / name).mkdir()
        (root / name / "experiment.toml").write_text(content)
    gate = Gate(PORT, "open")
    application = make_application(Workbench(root), gate)
    client = TestClient(application, base_url=HOST, follow_redirects=False, raise_server_exceptions=False)
    client.cookies.set(gate.cookie_name, gate.secret)
    return client


@pytest.fixture(autouse=True)
def no_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Job, "start", lambda *_: None)


def hostile(rng: random.Random, depth: int = 0) -> Any:
    """Draw a value of any kind."""
    kind = rng.randrange(8 if depth < 3 else 6)
    if kind < 3:
        return rng.choice(TEXTS)
    if kind < 5:
        return rng.choice(NUMBERS)
    if kind < 6:
        return rng.choice(OTHER)
    if kind < 7:
        return [hostile(rng, depth + 1) for _ in range(rng.randrange(4))]
    return {str(hostile(rng, 9))[:50]: hostile(rng, depth + 1) for _ in range(rng.randrange(3))}


def values_of(rng: random.Random, endpoint: str) -> dict[str, Any]:
    """Draw the values of one endpoint: some valid, at least one of them not."""
    names = [name for name in inspect.signature(ENDPOINTS[endpoint]).parameters if name != "workbench"]
    drawn = {name: hostile(rng) for name in names if rng.random() < 0.7}
    for name in names:
        if name in GIVEN and rng.random() < VALID:
            drawn[name] = rng.choice(GIVEN[name])
    if endpoint in SLOW and drawn.get("at") == "experiment":
        drawn["at"] = rng.choice(TEXTS[:5])
    if rng.random() < 0.03:
        drawn[str(hostile(rng, 9))] = hostile(rng)
    return drawn


def send(client: TestClient, rng: random.Random) -> tuple[str, int]:
    """Send one request; return it in words, and the status of its answer."""
    if rng.random() < 0.3:
        chosen = {name: str(rng.choice((*TEXTS, *NUMBERS))) for name in NAMES[:-1] if rng.random() < 0.6}
        for name in chosen:
            if name in GIVEN and rng.random() < VALID:
                chosen[name] = str(rng.choice(GIVEN[name]))
        query = "&".join(f"{name}={quote(value, errors='surrogatepass')}" for name, value in chosen.items())
        path = f"{rng.choice(QUERIES)}?{query}"
        return path, client.get(path).status_code
    endpoint = rng.choice(sorted(ENDPOINTS))
    values = values_of(rng, endpoint)
    headers = {"Origin": HOST, "Content-Type": "application/json"}
    answer = client.post(f"/api/{endpoint}", content=json.dumps(values), headers=headers)
    return f"{endpoint} {values!r}", answer.status_code


def send_many(client: TestClient, count: int, seed: int) -> list[str]:
    """Send a number of requests and return those that ended in a traceback."""
    problems = []
    for number in range(count):
        words, status = send(client, random.Random(f"{seed} {number}"))
        if status >= 500:
            problems.append(f"{seed} {number}: {words[:300]}: {status}")
    return problems


def test_some_hostile_values_are_refused(client):
    assert send_many(client, QUICK, SEED) == []


@pytest.mark.slow
def test_many_hostile_values_are_refused(client):
    problems = send_many(client, 12 * REQUESTS, SEED + 1)
    note("values", tried=12 * REQUESTS, wrong=len(problems))
    assert problems == []
