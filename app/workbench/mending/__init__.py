"""Poses mended by hand: correlated again from where a hand puts them, kept in the table that the next run obeys.
Knows no page; the correlation is the tracker's own."""
