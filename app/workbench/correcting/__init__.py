"""Poses corrected by hand: correlated from a given pose, stored in the table that the next run applies."""
