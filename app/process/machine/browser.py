"""Open a page of this machine in the browser without its token in an argument list, which every user can read."""

from __future__ import annotations

import atexit
import html
import os
import shutil
import tempfile
import threading
import webbrowser
from pathlib import Path

STARTED = 2.0  # [s] in which a browser that runs in the background has been started
REDIRECT = """<!doctype html>
<html lang="en">
<head><meta charset="utf-8"><meta http-equiv="refresh" content="0;url={address}"><title>Rodsight</title></head>
<body><p><a href="{address}">Rodsight</a></p></body>
</html>
"""


def redirect_page(address: str) -> str:
    """Return a page that leads to an address at once."""
    return REDIRECT.format(address=html.escape(address))


def open_page(address: str) -> None:
    """Open an address by a file that only this user can read, and that leads to it; it is removed with the process.

    A browser that runs in the foreground does not stop this process.
    """
    folder = Path(tempfile.mkdtemp(prefix="rodsight-page-"))  # closed to others
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    file = folder / "open.html"
    with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as stream:
        stream.write(redirect_page(address))
    browser = threading.Thread(target=webbrowser.open, args=(file.as_uri(),), daemon=True)
    browser.start()
    browser.join(STARTED)
