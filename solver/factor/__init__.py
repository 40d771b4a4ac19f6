"""Sparse matrices of small blocks, a block row for each of many neighbours, factorised. Knows no grain."""
