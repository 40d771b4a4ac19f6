"""Compiled sweeps: contact law, visiting order, and vectorised access to grain records."""
