"""Requests without the cookie get nothing from the workbench; every answer carries the safe headers."""

import os

import pytest
from rodsight.workbench.service.server import _Json
from rodsight.workbench.service.workbench import Workbench
from rodsight.workbench.setup.draft import Draft
from starlette.testclient import TestClient

from .conftest import HOST, Visitor


@pytest.fixture
def outsider(tmp_path):
    return Visitor(Workbench(tmp_path))


@pytest.fixture
def outside_client():
    """A client of the same server without a cookie."""
    return lambda visitor: TestClient(visitor.client.app, base_url=HOST)


@pytest.mark.parametrize(
    "path",
    [
        "/",
        "/page/app.js",
        "/photograph?at=.&frame=0",
        "/viewer/script.js",
        "/shared?at=.",
        "/recording/guess/mine/recording.rrd",
    ],
)
def test_without_the_cookie_nothing_is_served(outsider, path):
    assert outsider.client.get(path).status_code == 403


def test_the_token_opens_once_it_is_right(outsider):
    assert outsider.client.get("/", params={"token": "guess"}).status_code == 403
    cookie = outsider.client.get("/", params={"token": outsider.gate.token}).headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert outsider.client.get("/").status_code == 200


@pytest.mark.parametrize(
    "headers",
    [{"Origin": "http://evil.example"}, {"Host": "evil.example"}, {"Sec-Fetch-Site": "cross-site"},
     {"Content-Type": "text/plain"}],
)  # fmt: skip
def test_requests_of_another_page_are_refused(visitor, headers):
    assert visitor.post("home", {}, **headers).status_code == 403


@pytest.mark.parametrize("name", ["Host", "Origin"])
def test_a_header_that_stands_twice_is_refused(visitor, name):
    right = {"Host": HOST.removeprefix("http://"), "Origin": HOST}[name]
    answer = visitor.client.get("/page/app.js", headers=[(name, right), (name, right)])
    assert answer.status_code == 400
    assert "twice" in answer.text


def test_a_request_needs_an_origin(visitor):
    assert visitor.client.post("/api/home", json={}).status_code == 403


def test_every_answer_carries_the_policy(visitor):
    for path in ("/", "/page/none.js", "/photograph?at=none&frame=0"):
        headers = visitor.client.get(path).headers
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert headers["Cache-Control"] == "no-store"
        assert headers["X-Frame-Options"] == "DENY"


def test_the_root_itself_may_be_the_experiment(photographs_only):
    folder = photographs_only / "my photographs"
    Draft(folder).set_keys("all", {"name": "mine", "photographs.files": "pictures/*.jpg"})
    visitor = Visitor(Workbench(folder)).enter()
    (folder / "runs" / "mine").mkdir(parents=True)
    (folder / "runs" / "mine" / "recording.rrd").write_bytes(b"what was recorded")
    (address,) = visitor.request("recording", at=".")["addresses"]
    assert "/./" not in address  # a browser requests it without
    assert visitor.client.get(address).content == b"what was recorded"


def test_a_recording_is_given_under_its_secret_name_alone(visitor, outside_client, photographs_only):
    at = visitor.request("begin", folder="my photographs/pictures", suffix=".jpg", name="mine")["at"]
    assert "no recording" in visitor.refused("recording", at=at)
    run = photographs_only / "runs" / "mine"
    run.mkdir(parents=True)
    (run / "recording.rrd").write_bytes(b"what was recorded")
    described = visitor.request("recording", at=at)
    (address,) = described["addresses"]
    assert visitor.workbench.key in address
    answer = outside_client(visitor).get(address)  # the viewer's request carries no cookie
    assert answer.content == b"what was recorded"
    assert answer.headers["Cross-Origin-Resource-Policy"] == "same-origin"
    wrong = "A" if visitor.workbench.key[0] != "A" else "B"
    assert (
        outside_client(visitor)
        .get(address.replace(visitor.workbench.key, wrong + visitor.workbench.key[1:]))
        .status_code
        == 403
    )
    assert outside_client(visitor).get(address, headers={"Host": "evil.example"}).status_code == 403
    assert outside_client(visitor).get(address.replace("recording.rrd", "tracks.h5")).status_code == 404
    above = address.replace("/my%20photographs/", "/..%2f../")
    assert outside_client(visitor).get(above).status_code in (404, 422)


def test_the_shared_file_is_described_and_downloaded(visitor, photographs_only):
    at = visitor.request("begin", folder="my photographs/pictures", suffix=".jpg", name="mine")["at"]
    assert visitor.request("shared", at=at) == {"file": None, "ready": False}
    assert "no recording" in visitor.refused("share", at=at)
    assert visitor.client.get("/shared", params={"at": at}).status_code == 404
    run = photographs_only / "runs" / "mine"
    run.mkdir(parents=True)
    page, recording = run / "mine-share.html", run / "recording.rrd"
    page.write_text("a page with the viewer in it")
    recording.write_bytes(b"")
    os.utime(recording, (1e9, 1e9))
    described = visitor.request("shared", at=at)
    assert (described["file"], described["bytes"], described["old"]) == (str(page), page.stat().st_size, False)
    os.utime(page, (5e8, 5e8))
    assert visitor.request("shared", at=at)["old"]
    answer = visitor.client.get("/shared", params={"at": at})
    assert answer.headers["Content-Disposition"].startswith("attachment")
    assert answer.text == "a page with the viewer in it"
    assert visitor.client.get("/shared", params={"at": ".."}).status_code == 422
    assert visitor.post("share", {"at": at, "scale": 2.0}).status_code == 400


@pytest.mark.thorough
def test_the_viewer_is_the_installed_one_as_a_module(visitor):
    script = visitor.client.get("/viewer/script.js")
    assert script.text.endswith("export default wasm_bindgen;\n")
    packed = visitor.client.get("/viewer/module.wasm")
    assert packed.headers["Content-Encoding"] == "gzip"
    assert packed.content[:4] == b"\0asm"


def test_no_path_leads_out_of_the_folder(visitor):
    for at in ("..", "/etc", "my photographs/../../.."):
        assert visitor.post("project", {"at": at}).status_code == 422
    for name in ("..%2f..%2fcommand.py", "conftest.py", "__init__.py"):
        assert visitor.client.get(f"/page/{name}").status_code == 404


def test_an_experiment_beside_the_folder_is_none(tmp_path):
    for name in ("opened", "beside"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "experiment.toml").write_text('name = "x"\n')
    visitor = Visitor(Workbench(tmp_path / "opened")).enter()
    assert visitor.post("project", {"at": "."}).status_code == 200
    assert "is no experiment" in visitor.refused("project", at="../beside")


@pytest.mark.parametrize(
    ("endpoint", "values"),
    [("nothing", {}), ("project", {}), ("project", {"at": 3}), ("begin", {"series": -1, "name": "x"}),
     ("home", {"workbench": 1}), ("set_scale", {"at": ".", "pixel_size": "1e-4"})],
)  # fmt: skip
def test_a_malformed_request_is_refused(visitor, endpoint, values):
    assert visitor.post(endpoint, values).status_code == 400


@pytest.mark.parametrize("body", ["[" * 90_000, '{"at": ' * 9000, "9" * 5000, '{"at": ' + "9" * 5000 + "}", "\x00", ""])
def test_a_body_that_is_no_object_is_refused(tmp_path, body):
    visitor = Visitor(Workbench(tmp_path)).enter()
    headers = {"Origin": HOST, "Content-Type": "application/json"}
    assert visitor.client.post("/api/home", content=body.encode(), headers=headers).status_code == 400


def test_a_long_request_is_refused(visitor):
    body = b'{"at": "' + b"x" * 300_000 + b'"}'
    answer = visitor.client.post(
        "/api/home", content=body, headers={"Origin": HOST, "Content-Type": "application/json"}
    )
    assert answer.status_code == 413


def test_the_token_opens_one_browser_which_may_come_again(outsider, outside_client):
    address = {"token": outsider.gate.token}
    outsider.enter()
    answer = outside_client(outsider).get("/", params=address, follow_redirects=False)
    assert answer.status_code == 403
    assert "Set-Cookie" not in answer.headers
    assert "opens once" in answer.text
    assert outsider.client.get("/", params=address).status_code == 303  # it has the cookie
    assert outsider.client.get("/").status_code == 200


def test_the_cookie_of_one_server_opens_no_other(outsider, tmp_path):
    outsider.enter()
    other = Visitor(Workbench(tmp_path))
    other.client.cookies = outsider.client.cookies
    assert other.client.get("/").status_code == 403


@pytest.mark.parametrize(
    ("content", "body"),
    [
        ({"r": [0.25, float("nan")], "name": "März"}, '{"r":[0.25,null],"name":"März"}'),
        ({"file": "a\udcff.png"}, '{"file":"a?.png"}'),  # not UTF-8
    ],
)
def test_every_answer_is_json_that_a_browser_reads(content, body):
    assert _Json(content).body.decode() == body
