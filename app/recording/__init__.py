"""Recordings: a run as one file for the Rerun viewer. Only this package imports Rerun."""

import os

os.environ.setdefault("RUST_LOG", "error")  # before the SDK is imported: its log is not meant for the user
