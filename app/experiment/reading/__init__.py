"""Read tables and other input files."""
