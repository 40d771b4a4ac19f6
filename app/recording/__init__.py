"""Recordings: a run as one file that shows it all. The only importers of Rerun."""

import os

os.environ.setdefault("RUST_LOG", "error")  # before the SDK is imported: its remarks are none of the user's
