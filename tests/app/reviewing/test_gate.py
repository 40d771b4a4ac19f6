"""Requests of other sites and of other users to the review: the server refuses all of them."""

import http.client
import json

import pytest
from rodsight.cli.main import main
from rodsight.verdicts.log import VERDICTS

from .conftest import review_server, session_of


@pytest.fixture(scope="module")
def server(made_tracks, tmp_path_factory):
    out = tmp_path_factory.mktemp("gate") / "run"
    with pytest.raises(SystemExit):
        main(["solve", str(made_tracks), "--out", str(out), "--quiet", "--set", "solver.sweeps=20"])
    with review_server(out) as server:
        yield server


def request(server, method, path, body=None, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.gate.port, timeout=20)
    content = None if body is None else json.dumps(body)
    connection.request(method, path, content, {key.replace("_", "-"): value for key, value in headers.items()})
    answer = connection.getresponse()
    content = answer.status, answer.headers, answer.read()
    connection.close()
    return content


def own(server, **more):
    """The headers of the page's own requests."""
    return {
        "Cookie": f"{server.gate.cookie_name}={server.gate.secret}", "Origin": f"http://127.0.0.1:{server.gate.port}",
        "Content_Type": "application/json", "Sec_Fetch_Site": "same-origin",
    } | more  # fmt: skip


def verdict(server):
    """A valid request to judge a pair."""
    session = session_of(server)
    contacts = session.candidates(0).contacts
    i, j = (session.bodies.name(int(row[0])) for row in (contacts.i, contacts.j))
    return {
        "at": ".", "view": {"reviewer": "mallory", "frame": 0}, "pair": {"frame": 0, "i": i, "j": j},
        "verdict": "contact", "seconds": 0.0, "origin": "queue",
    }  # fmt: skip


def written(server):
    file = session_of(server).log.file
    return file.read_text() if file.exists() else ""


@pytest.mark.thorough
def test_the_token_is_exchanged_for_a_strict_cookie(server):
    status, headers, _ = request(server, "GET", f"/?token={server.gate.token}")
    assert (status, headers["Location"]) == (303, "/#at=.&step=review")
    cookie = headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert server.gate.token not in cookie
    status, _, content = request(server, "GET", "/", Cookie=cookie.split(";")[0])
    assert status == 200
    assert b"<canvas" in content


@pytest.mark.parametrize(
    "path",
    [
        "/",
        "/page/app.js",
        "/page/steps/review.js",
        "/photograph?at=.&frame=0",
        "/viewer/script.js",
        "/crop?at=.&frame=0&x=1&y=1&width=9",
    ],
)
def test_without_the_cookie_nothing_is_served(server, path):
    assert request(server, "GET", path)[0] == 403
    assert request(server, "GET", path, Cookie=f"{server.gate.cookie_name}=guess")[0] == 403
    assert request(server, "GET", "/?token=guess")[0] == 403


@pytest.mark.parametrize(
    "foreign",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
        {"Origin": "https://127.0.0.1"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
        {"Host": "evil.example"},  # a name that was made to point here
        {"Host": "127.0.0.1"},
        {"Content_Type": "text/plain"},  # a form of another site can send this
        {"Content_Type": "application/x-www-form-urlencoded"},
        {"Cookie": ""},
    ],
)
def test_the_hostile_page_in_the_next_tab_writes_nothing(server, foreign):
    before = written(server)
    status, headers, _ = request(server, "POST", "/api/judge", verdict(server), **own(server, **foreign))
    assert status == 403
    assert written(server) == before
    assert not [name for name in headers if name.lower().startswith("access-control")]


def test_a_change_needs_an_origin(server):
    headers = own(server)
    del headers["Origin"]
    assert request(server, "POST", "/api/judge", verdict(server), **headers)[0] == 403


def test_the_page_itself_may(server):
    status, headers, content = request(server, "POST", "/api/judge", verdict(server), **own(server))
    assert status == 200, content
    assert '"mallory"' in written(server)
    assert not [name for name in headers if name.lower().startswith("access-control")]


def test_a_preflight_is_not_answered(server):
    status, headers, _ = request(server, "OPTIONS", "/api/judge", Origin="http://evil.example")
    assert status == 403
    assert not [name for name in headers if name.lower().startswith("access-control")]


def test_every_answer_carries_the_policy(server):
    for path in ("/", "/page/app.js", "/nowhere", "/viewer/script.js"):
        _, headers, _ = request(server, "GET", path, **own(server))
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "connect-src 'self';" in policy
        assert "unsafe-inline" not in policy
        assert "frame-ancestors 'none'" in policy
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Cache-Control"] == "no-store"


@pytest.mark.parametrize(
    "path",
    [
        "/../verdicts.jsonl",
        f"/{VERDICTS}",
        "/results.h5",
        "/page/../../server.py",
        "/%2e%2e/results.h5",
        "//etc/passwd",
    ],
)
def test_no_path_reaches_the_file_system(server, path):
    assert request(server, "GET", path, **own(server))[0] == 404


@pytest.mark.parametrize(
    "change",
    [
        {"pair": {"frame": 0, "i": 999999999, "j": 1}}, {"pair": {"frame": 0, "i": -1, "j": 1}},
        {"pair": {"frame": 0, "i": 1, "j": 1}}, {"pair": {"frame": 0, "i": "top", "j": "left"}},
        {"pair": {"frame": 99, "i": 1, "j": 2}}, {"pair": {"frame": 0, "i": 1, "j": "9" * 200}}, {"pair": 5},
        {"pair": {"frame": 0, "i": 1.5, "j": 2}}, {"verdict": "yes"}, {"origin": "import"}, {"seconds": "1"},
        {"seconds": 1e300}, {"seconds": -1.0}, {"view": {"reviewer": "", "frame": 0}}, {"view": {"frame": 0}},
        {"view": {"reviewer": "x" * 61, "frame": 0}}, {"view": {"reviewer": "a\u0000b", "frame": 0}},
        {"view": {"reviewer": "anna", "frame": True}}, {"view": {"reviewer": "anna", "frame": 0, "order": "mine"}},
        {"more": 1}, {"at": 3},
    ],
)  # fmt: skip
def test_a_wrong_request_is_refused_and_writes_nothing(server, change):
    before = written(server)
    assert request(server, "POST", "/api/judge", verdict(server) | change, **own(server))[0] == 400
    assert written(server) == before


def test_a_long_request_is_not_read(server):
    assert request(server, "POST", "/api/judge", {"reviewer": "x" * 300_000}, **own(server))[0] == 413


@pytest.mark.thorough
def test_the_viewer_comes_from_the_installed_wheel(server):
    status, headers, module = request(server, "GET", "/viewer/module.wasm", **own(server))
    assert (status, headers["Content-Type"]) == (200, "application/wasm")
    assert module.startswith(b"\x00asm")
    status, headers, packed = request(server, "GET", "/viewer/module.wasm", **own(server, Accept_Encoding="gzip"))
    assert headers["Content-Encoding"] == "gzip"
    assert len(packed) < 0.5 * len(module)


def test_blind_answers_hide_the_detector(server):
    def answer(endpoint, **view):
        body = {"at": ".", "view": {"reviewer": "anna", "frame": 0, **view}}
        return json.loads(request(server, "POST", f"/api/{endpoint}", body, **own(server))[2])

    reveals = {"detected", "probability", "gap_um", "gap_sd_um", "threshold_um", "fn", "priority"}
    for order in ("influence", "frame", "sample"):
        assert not reveals & set(answer("next_pair", order=order, blind=True)["pair"])
        assert reveals <= set(answer("next_pair", order=order)["pair"])
    assert not {"estimate", "kappas", "sampled"} & set(answer("review_status", blind=True))
    blind, seeing = (answer("candidate_pairs", blind=each)["pairs"] for each in (True, False))
    assert not any(reveals & set(each) for each in blind)
    names = [[(each["i"], each["j"]) for each in pairs] for pairs in (blind, seeing)]
    assert set(names[0]) == set(names[1])
    assert names[0] != names[1]  # the order reveals nothing, either
