"""Runs held against forces that were measured. Stands on results alone."""
