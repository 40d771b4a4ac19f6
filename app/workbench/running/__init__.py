"""A run as a child process, the same `rodsight run` that a person types: begun, paused, gone on with, cancelled.
Knows no page."""
