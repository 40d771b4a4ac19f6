"""Cholesky factorisation of sparse matrices of small dense blocks; independent of grains."""
