"""Walls of an experiment that is being set up: bars, circles, and discs in the corners of a frame."""
