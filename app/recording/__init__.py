"""Recordings: a run as one file that shows it all. The only importers of Rerun."""
