"""Runs compared with measured forces, from stored results only."""
