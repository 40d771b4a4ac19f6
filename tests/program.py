"""The command in a process of its own."""

from __future__ import annotations

import sys

RODSIGHT = (sys.executable, "-u", "-c", "from rodsight.cli.main import main; main()")
