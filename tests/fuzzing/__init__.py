"""Robustness: corrupted files, failing writes, kills, hostile requests. `python -m tests.fuzzing` prints the counts."""
