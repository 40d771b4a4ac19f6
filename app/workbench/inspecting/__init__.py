"""Frames of a run for the page, finished or in progress: stored numbers, places in pixels."""
