"""Explicit discrete-element simulation: the truth of synthetic experiments."""
