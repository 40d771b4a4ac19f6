"""The hostile page in the next tab, and other strangers: nothing for them."""

import http.client
import json
import threading

import pytest
from rodsight.cli.main import main
from rodsight.review.command import open_session
from rodsight.review.reviewed_run import open_reviewed
from rodsight.review.service.server import ReviewServer
from rodsight.verdicts.log import VERDICTS


@pytest.fixture(scope="module")
def server(made_tracks, tmp_path_factory):
    out = tmp_path_factory.mktemp("gate") / "run"
    with pytest.raises(SystemExit):
        main(["solve", str(made_tracks), "--out", str(out), "--quiet", "--set", "solver.sweeps=20"])
    server = ReviewServer(open_session(open_reviewed(out)), reviewer="anna")
    thread = threading.Thread(target=server.serve, daemon=True)
    thread.start()
    yield server
    server.shutdown()
    server.close()
    thread.join()


def ask(server, method, path, body=None, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.gate.port, timeout=20)
    content = None if body is None else json.dumps(body)
    connection.request(method, path, content, {key.replace("_", "-"): value for key, value in headers.items()})
    answer = connection.getresponse()
    told = answer.status, dict(answer.getheaders()), answer.read()
    connection.close()
    return told


def own(server, **more):
    """What the page's own requests carry."""
    return {
        "Cookie": f"{server.gate.cookie_name}={server.gate.secret}", "Origin": f"http://127.0.0.1:{server.gate.port}",
        "Content_Type": "application/json", "Sec_Fetch_Site": "same-origin",
    } | more  # fmt: skip


def verdict(server):
    key = str(int(server.session.candidates(0).key[0]))
    view = {"reviewer": "mallory", "frame": 0}
    return view | {"verdict": "contact", "seconds": 0, "origin": "queue", "pair_frame": 0, "key": key}


def written(server):
    file = server.session.log.file
    return file.read_text() if file.exists() else ""


def test_the_token_is_turned_into_a_strict_cookie(server):
    status, headers, _ = ask(server, "GET", f"/?token={server.gate.token}")
    assert (status, headers["Location"]) == (303, "/")
    cookie = headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert server.gate.token not in cookie
    status, _, content = ask(server, "GET", "/", Cookie=cookie.split(";")[0])
    assert status == 200
    assert b"<canvas" in content


@pytest.mark.parametrize("path", ["/", "/page.js", "/backdrop?frame=0", "/re_viewer.js", "/crop?frame=0&key=1&zoom=0"])
def test_without_the_cookie_nothing_is_served(server, path):
    assert ask(server, "GET", path)[0] == 403
    assert ask(server, "GET", path, Cookie=f"{server.gate.cookie_name}=guess")[0] == 403
    assert ask(server, "GET", "/?token=guess")[0] == 403


@pytest.mark.parametrize(
    "stranger",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
        {"Origin": "https://127.0.0.1"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
        {"Host": "evil.example"},  # a name that was made to point here
        {"Host": "127.0.0.1"},
        {"Content_Type": "text/plain"},  # what a form of another site can send unasked
        {"Content_Type": "application/x-www-form-urlencoded"},
        {"Cookie": ""},
    ],
)
def test_the_hostile_page_in_the_next_tab_writes_nothing(server, stranger):
    before = written(server)
    status, headers, _ = ask(server, "POST", "/ask/judge", verdict(server), **own(server, **stranger))
    assert status == 403
    assert written(server) == before
    assert not [name for name in headers if name.lower().startswith("access-control")]


def test_a_change_needs_an_origin(server):
    headers = own(server)
    del headers["Origin"]
    assert ask(server, "POST", "/ask/judge", verdict(server), **headers)[0] == 403


def test_the_page_itself_may(server):
    status, headers, content = ask(server, "POST", "/ask/judge", verdict(server), **own(server))
    assert status == 200, content
    assert '"mallory"' in written(server)
    assert not [name for name in headers if name.lower().startswith("access-control")]


def test_a_preflight_is_not_answered(server):
    status, headers, _ = ask(server, "OPTIONS", "/ask/judge", Origin="http://evil.example")
    assert status == 501
    assert not [name for name in headers if name.lower().startswith("access-control")]


def test_every_answer_carries_the_policy(server):
    for path in ("/", "/page.js", "/nowhere", "/re_viewer.js"):
        _, headers, _ = ask(server, "GET", path, **own(server))
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
    assert ask(server, "GET", path, **own(server))[0] == 404


@pytest.mark.parametrize(
    "change",
    [
        {"key": "999999999"}, {"key": "-1"}, {"key": 5}, {"pair_frame": 99}, {"verdict": "yes"}, {"origin": "import"},
        {"reviewer": ""}, {"reviewer": "x" * 61}, {"reviewer": "a\u0000b"}, {"seconds": "1"}, {"frame": True},
        {"seconds": 1e300},
    ],
)  # fmt: skip
def test_a_wrong_question_is_refused_and_writes_nothing(server, change):
    before = written(server)
    assert ask(server, "POST", "/ask/judge", verdict(server) | change, **own(server))[0] == 400
    assert written(server) == before


def test_a_long_question_is_not_read(server):
    assert ask(server, "POST", "/ask/judge", {"reviewer": "x" * 70_000}, **own(server))[0] == 413


def test_the_viewer_comes_from_the_installed_wheel(server):
    status, headers, module = ask(server, "GET", "/re_viewer_bg.wasm", **own(server))
    assert (status, headers["Content-Type"]) == (200, "application/wasm")
    assert module.startswith(b"\x00asm")
    status, headers, packed = ask(server, "GET", "/re_viewer_bg.wasm", **own(server, Accept_Encoding="gzip"))
    assert headers["Content-Encoding"] == "gzip"
    assert len(packed) < 0.5 * len(module)


def test_blind_answers_hide_what_the_detector_said(server):
    view = {"reviewer": "anna", "frame": 0, "blind": True}
    pair = json.loads(ask(server, "POST", "/ask/next", view, **own(server))[2])["pair"]
    assert not {"detected", "probability", "gap_um", "sigma_um", "threshold_um"} & set(pair)
    status = json.loads(ask(server, "POST", "/ask/status", view, **own(server))[2])
    assert not {"estimate", "agreement"} & set(status)
    blind = ask(server, "GET", "/marks?frame=0&reviewer=anna&blind=1", **own(server))[2]
    seeing = ask(server, "GET", "/marks?frame=0&reviewer=anna&blind=0", **own(server))[2]
    assert blind != seeing
