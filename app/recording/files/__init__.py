"""Writes recordings: of a finished run, of a run while it is solved, and side files."""
