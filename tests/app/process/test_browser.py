"""A page is opened by a file of this user alone: its token stands in no argument list."""

from __future__ import annotations

import threading
import webbrowser
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from rodsight.process.machine import browser as opening
from rodsight.process.machine.browser import open_page, redirect_page
from rodsight.workbench.service.server import WorkbenchServer
from rodsight.workbench.service.workbench import Workbench

ADDRESS = "http://127.0.0.1:1/?token=secret"


@pytest.fixture
def opened(monkeypatch, tmp_path) -> list[str]:
    """Addresses that the browser was given."""
    seen: list[str] = []
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr(webbrowser, "open", lambda address: seen.append(address) or True)
    return seen


def test_the_browser_gets_a_file_that_only_this_user_can_read(opened):
    open_page(ADDRESS)
    file = Path(opened[0].removeprefix("file://"))
    assert "secret" not in opened[0]
    assert file.stat().st_mode & 0o777 == 0o600
    assert file.parent.stat().st_mode & 0o777 == 0o700
    assert f"url={ADDRESS}" in file.read_text()


def test_a_browser_in_the_foreground_does_not_stop_the_program(opened, monkeypatch):
    ended = threading.Event()
    monkeypatch.setattr(opening, "STARTED", 0.01)
    monkeypatch.setattr(webbrowser, "open", lambda _: ended.wait(30.0))
    open_page(ADDRESS)
    ended.set()


def test_an_address_cannot_leave_its_attribute():
    assert '"><script>' not in redirect_page('http://127.0.0.1/?token="><script>')


@pytest.mark.screen
def test_a_browser_enters_the_workbench_through_the_file(opened, tmp_path, browser: Browser):
    server = WorkbenchServer(Workbench(tmp_path))
    running = threading.Thread(target=server.serve, daemon=True)
    running.start()
    page = browser.new_page()
    try:
        open_page(server.address)
        page.goto(opened[0])
        page.wait_for_selector("h1")
        assert "token" not in page.url
        assert page.url.startswith(f"http://127.0.0.1:{server.gate.port}/")
    finally:
        page.close()
        server.shutdown()
        running.join(10.0)
        server.close()
