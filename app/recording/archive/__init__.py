"""Recordings that exist: listed, read back, summarised as cards, shared and repaired."""
