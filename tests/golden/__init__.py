"""Stored runs of earlier versions, and of this one, as they were written."""
