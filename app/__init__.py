"""Rodsight: contact forces inside a granular packing of rods, from photographs.

This folder is installed as the package `rodsight`, so that a user's own app.py is never in its way.
"""

__version__ = "0.1.0"
