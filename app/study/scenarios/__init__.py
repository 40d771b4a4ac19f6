"""Simulated scenarios solved and compared with the truth: forces, statistics, effects of small changes of input."""
