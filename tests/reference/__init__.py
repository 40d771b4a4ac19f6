"""Slow, plain twins of the compiled kernels, written from the equations, and the comparison with them."""
