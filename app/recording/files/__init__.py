"""Recordings as files: written, live, read back, mended, shared, catalogued."""
