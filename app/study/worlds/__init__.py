"""Simulated worlds scored: forces, statistics and small changes of input against the truth. Stands on solved worlds."""
