"""Rodsight: contact forces inside a granular packing, from photographs."""

__version__ = "0.1.0"
